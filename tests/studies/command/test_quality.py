"""``simulate`` checks every engine's run: nonsense is exit code 1, what is doubtful a warning."""

from pathlib import Path

import pytest

from engine_models.engines import ENGINES
from engine_models.scene.library import SCENES
from tests.helpers.command import crankslider
from tests.helpers.engines import supporting


@pytest.mark.parametrize("engine", ENGINES)
def test_a_young_modulus_typed_in_gpa_is_no_run_of_any_engine(engine: str, tmp_path: Path) -> None:
    """A wall of 207 Pa lets the pin out of its bearing, in any step."""
    file, out = tmp_path / "mine.toml", tmp_path / "run.csv"
    steel = crankslider("show", "clearance-driven-0.5mm").stdout
    butter = steel.replace("young_modulus_Pa = 207000000000.0", "young_modulus_Pa = 207.0")
    assert butter != steel
    file.write_text(butter)
    out.write_text("before")
    done = crankslider("simulate", file, "--engine", engine, "--end", 0.012, "--out", out)
    assert (done.code, done.stdout, out.read_text()) == (1, "", "before")
    assert done.stderr.startswith("error: pin ")
    assert "the wall of its bearing" in done.stderr
    assert " at t = 0.001" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_step_too_long_for_pymunk_says_so() -> None:
    """At 5 ms, twenty steps a turn, it loses half of the energy."""
    done = crankslider("simulate", "ideal-free", "--engine", "pymunk", "--step", "5e-3")
    assert (done.code, done.stdout) == (1, "")
    assert done.stderr.startswith("error: energy off by 5")
    assert done.stderr.endswith("with step 0.005 s: shorten the step, or sharpen the tolerance\n")


@pytest.mark.parametrize(("engine", "step"), [("pymunk", 1e-3), ("exudyn", 2e-3)])
def test_a_doubtful_run_is_written_with_a_warning(engine: str, step: float) -> None:
    done = crankslider("simulate", "ideal-free", "--engine", engine, "--step", step)
    assert done.code == 0
    assert len(done.stdout.splitlines()) == 202
    warning, *notes = done.stderr.splitlines()
    assert warning.startswith("warning: energy off by ")
    assert ", past 1 % at t = 0.0" in warning
    assert all(note.startswith("note: ") for note in notes)


@pytest.mark.parametrize(
    ("scene", "engine"),
    [
        (name, own)
        for name in ("ideal-driven", "clearance-driven-0.1mm")
        for own in supporting(SCENES[name]())
    ],
)
def test_a_sound_run_is_written_without_a_warning(scene: str, engine: str) -> None:
    done = crankslider("simulate", scene, "--engine", engine, "--end", 0.003)
    assert done.code == 0
    assert done.stderr.startswith("note: ")
    assert "warning" not in done.stderr
