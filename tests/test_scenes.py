"""The scenes that tests share are few, short and told in their first line."""

from engine_models.scene.library import ALL_SCENES
from tests.scenes import FOLDER, NAMES, scene


def test_shared_scenes_are_few_short_and_told_in_their_first_line() -> None:
    assert 12 <= len(NAMES) <= 14
    assert tuple(sorted({scene(name).name for name in NAMES})) == NAMES
    assert not {*NAMES} & {*ALL_SCENES}
    for name in NAMES:
        assert (FOLDER / f"{name}.toml").read_text("utf-8").startswith("# ")
