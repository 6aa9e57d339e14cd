"""The short form of a scene: what a file of it says, and that it comes back as it was."""

from collections.abc import Iterator
from random import Random
from typing import Any

from hypothesis import given, reject, settings
from hypothesis import strategies as st

from engine_models.scene.file import from_toml
from engine_models.scene.library import ALL_SCENES, SCENES
from engine_models.scene.plain_words import BadInput

NAMES = st.text(st.characters(codec="utf-8"))


@given(NAMES, st.floats(-1e6, 1e6), st.none() | st.floats(1e-6, 1e6))
@settings(max_examples=100, deadline=None)
def test_a_scene_survives_a_file_that_names_no_other_joint(
    name: str, angle: float, slowest: float | None
) -> None:
    changes = {"name": f"n{name}", "start.crank_angle_rad": angle}
    changes["clearance.B.minimum_impact_speed_m_s"] = slowest
    scene = SCENES["clearance-driven-damped"]().replace(changes)
    text = scene.to_toml()
    assert from_toml(text) == scene
    sections = [line for line in text.splitlines() if line.startswith("[clearance")]
    assert sections == ["[clearance.B]", "[clearance.B.friction]"]


@given(st.sampled_from([*ALL_SCENES]), st.randoms(use_true_random=False), st.floats(0.999, 1.001))
@settings(max_examples=60, deadline=None)
def test_a_changed_scene_of_either_spelling_survives_a_file(name: str, chosen: Random, factor: float) -> None:
    scene = ALL_SCENES[name]()
    path, value = chosen.choice([*numbers(scene.as_written())])
    try:
        changed = scene.replace(path, value * factor)
    except BadInput:  # a length that is held open, a table that no longer repeats
        reject()
    again = from_toml(changed.to_toml())
    assert (again, again.mechanism, again.placed) == (changed, changed.mechanism, changed.placed)
    assert again.to_toml() == changed.to_toml()


def numbers(data: dict[str, Any], path: str = "") -> Iterator[tuple[str, float]]:
    """Yield the numbers in the sections of a scene by their paths."""
    for key, value in data.items():
        if isinstance(value, dict):
            yield from numbers(value, f"{path}{key}.")
        elif isinstance(value, float):
            yield f"{path}{key}", value


def test_the_compressors_gas_is_that_of_a_polytrope_between_suction_and_discharge() -> None:
    """A bore of 30 mm, 0.7069 cm2 a bar: 353 N at 6 bar against 1. Heights are 8 mm and 108 at dead centres.

    At 20 degrees 12.24 mm: 6 bar (8/12.24)^1.3 = 3.452 bar; at 270, 68.91 mm: (108/68.91)^1.3 = 1.793 bar.
    """
    load = SCENES["ideal-compressor"]().short.load["slider"]
    assert load.gas is not None
    force = load.gas.force_N
    assert (force[0], force[2], force[18], force[27], force[-1]) == (-353, -173, 0, -56, -353)
