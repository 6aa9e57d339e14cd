"""Every run is checked: nonsense is exit code 1, what is doubtful or changes nothing is a warning."""

from pathlib import Path

import pytest

from engine_models.convergence.doubts import doubts
from engine_models.engine import RunSettings
from engine_models.engines import ENGINES, make_engine
from engine_models.mechanics.quality import quality_of
from engine_models.scene.library import SCENES
from tests.helpers.command import crankslider

SHORT = SCENES["clearance-driven-0.5mm"]().replace("end_time_s", 0.002)


@pytest.mark.parametrize("engine", ["exudyn", "pymunk"])
def test_any_engine_is_run_once_more_unless_it_is_to_be_quick(engine: str, tmp_path: Path) -> None:
    """In steps of 9 degrees both are off by a millimetre."""
    steps = ("--end", 0.024, "--step", 6e-4, "--samples", 20)
    run = ("simulate", "ideal-driven", "--engine", engine, *steps, "--out", tmp_path / "run.csv")
    words, unchecked = "slider position in doubt by 1 % of the crank or more from t = ", ", not checked\n"
    told, quick = crankslider(*run).stderr, crankslider(*run, "--quick").stderr
    assert (words in told, unchecked in told) == (True, False), told
    assert (words in quick, unchecked in quick) == (False, True), quick


def test_a_setting_that_changes_nothing_is_told_and_a_slider_that_stays_where_it_is_is_not() -> None:
    settings = RunSettings(1e-5, 20)
    gain, tolerance = {"baumgarte_alpha_s": 50.0}, {"step_tolerance": 1e-6}
    for chosen, lines in (
        ({**gain, "stabilisation": "baumgarte"}, []),
        (gain, ["baumgarte_alpha_s changes nothing with stabilisation = projection"]),
        (tolerance, ["step_tolerance changes nothing with method = rk4"]),
    ):
        engine = make_engine("reference", **chosen)
        run = engine.simulate(SHORT, settings)
        assert doubts(engine, SHORT, run, quality_of(SHORT, run), settings) == lines


@pytest.mark.parametrize("engine", ENGINES)
def test_a_young_modulus_typed_in_gpa_is_no_run_of_any_engine(engine: str, tmp_path: Path) -> None:
    """A wall of 207 Pa lets the pin out of its bearing, in any step."""
    out = tmp_path / "run.csv"
    out.write_text("before")
    butter = ("--with", "clearance.B.young_modulus_Pa=207", "--engine", engine, "--end", 0.012)
    done = crankslider("simulate", "clearance-driven-0.5mm", *butter, "--out", out)
    assert (done.code, done.stdout, out.read_text(), done.stderr.count("\n")) == (1, "", "before", 1)
    assert done.stderr.startswith("error: pin ")
    assert "the wall of its bearing" in done.stderr
    assert " at t = 0.001" in done.stderr
