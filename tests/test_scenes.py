"""Tests simulate the scenes of the library and of ``tests/scenes``; who makes others is named, and why."""

import ast
from pathlib import Path

from engine_models.scene.library import ALL_SCENES
from tests.scenes import NAMES, scene

TESTS = Path(__file__).parent
#: What makes a scene or a mechanism of a text or of its parts.
MAKERS = {"from_toml", "Scene", "checked", "model_validate", "Mechanism", "MechanismData"}
#: Folders whose matter is such texts: input that is read, scenes as files, the form of a scene.
OF_INPUT = ("input/", "scenes/", "engine_models/scene/")
#: Files and folders that make scenes or mechanisms of their own, and why none of the shared ones serves.
OWN = {
    "conformance/properties/": "laws and motions that Hypothesis draws",
    "docs/test_snippets.py": "what documentation shows is run as it stands",
    "engines/mechanism_texts.py": "mechanisms whose ends an independent integration has",
    "engines/test_limits.py": "scenes that are absurd, or at the edge of what engines can",
    "engines/test_mechanisms.py": "corners of mechanisms by hand",
    "engines/test_pymunk.py": "one body, for what Chipmunk does with an impulse",
    "helpers/chains.py": "chains as long as kernels have to be",
    "helpers/crank_sliders.py": "a crank that is held, a pendulum: closed forms",
    "helpers/singular.py": "singular positions, of every kind",
    "solver/": "the solver takes mechanisms, which closed forms are of",
    "studies/command/test_outputs.py": "a mechanism with every output",
    "studies/command/test_tables.py": "tables in files",
    "studies/judges/test_question.py": "scenes that ask the same",
    "studies/test_scalar_stability.py": "the scalar equation of stability's theory",
    "studies/test_sweep.py": "closed forms over a sweep",
    "studies/truth/test_contacts.py": "bounces in closed form",
}


def makes_scenes(file: Path) -> bool:
    """Return whether a file calls what makes a scene."""
    called = (
        node.func for node in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(node, ast.Call)
    )
    names = (getattr(func, "attr", getattr(func, "id", "")) for func in called)
    return not MAKERS.isdisjoint(names)


def test_no_test_makes_a_scene_of_its_own_without_a_reason() -> None:
    files = (file.relative_to(TESTS).as_posix() for file in TESTS.rglob("*.py"))
    makers = [file for file in files if not file.startswith(OF_INPUT) and makes_scenes(TESTS / file)]
    unnamed = [file for file in makers if not file.startswith(tuple(OWN))]
    assert unnamed == [], "use tests.scenes, or name the file above with the reason"


def test_shared_scenes_are_few_short_and_told_in_their_first_line() -> None:
    assert 12 <= len(NAMES) <= 14
    assert tuple(sorted({scene(name).name for name in NAMES})) == NAMES
    assert not {*NAMES} & {*ALL_SCENES}
    for name in NAMES:
        assert (TESTS / "scenes" / f"{name}.toml").read_text("utf-8").startswith("# ")
