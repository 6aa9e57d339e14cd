"""Whoever starts a run can hear how far it has come; a run that would take for ever says what forces it."""

import time

import pytest

from engine_models.engine import RunSettings, SimulationFailed
from engine_models.engines import make_engine
from engine_models.progress import tell, told_to
from engine_models.reference import run as reference_runs
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Friction, Scene
from engine_models.scipy_ivp import calls as scipy_calls
from studies.command.progress_display import shown_progress
from tests.helpers.arrays import arrays
from tests.helpers.engines import supporting


def scene_with(name: str, **changes: object) -> Scene:
    """Return a library scene with another clearance at B."""
    scene = SCENES[name]()
    clearance = scene.clearance.B
    assert clearance is not None
    changed = clearance.model_copy(update=changes)
    return scene.model_copy(update={"clearance": scene.clearance.model_copy(update={"B": changed})})


def friction(regularisation_speed_m_s: float) -> Friction:
    return Friction(law="tanh", coefficient=0.1, regularisation_speed_m_s=regularisation_speed_m_s)


@pytest.mark.parametrize(
    ("engine", "name"),
    [(e, name) for name in ("ideal-driven", "clearance-driven-0.1mm") for e in supporting(SCENES[name]())],
)
def test_every_engine_tells_how_far_it_has_come_and_computes_the_same(engine: str, name: str) -> None:
    scene = SCENES[name]().model_copy(update={"end_time_s": 1e-3})
    settings, times = RunSettings(1e-5, 5), list[float]()
    with told_to(times.append):
        heard = make_engine(engine).simulate(scene, settings)
    assert times
    assert 0 <= min(times) <= max(times) <= 1e-3 * (1 + 1e-6)
    assert arrays(heard) == arrays(make_engine(engine).simulate(scene, settings))


@pytest.mark.parametrize("engine", supporting(SCENES["ideal-free"]()))
def test_what_a_listener_raises_ends_the_run(engine: str) -> None:
    def interrupt(_: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), told_to(interrupt):
        make_engine(engine).simulate(SCENES["ideal-free"](), RunSettings(1e-5, 5))


def test_a_second_run_has_a_time_left_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    """Runs of one tolerance begin anew: without that 1.9 s of the first made 10 s left of the second."""
    with shown_progress(2.0, line_s=0.2):
        tell(1.9)
        time.sleep(0.3)
        tell(1e-9)
        time.sleep(0.3)
    first, *_, last = capsys.readouterr().err.splitlines()
    assert first.startswith("note: t = 1.9 s of 2 s after 0 s, about ")
    assert last.startswith("note: t = 1e-09 s of 2 s in run 2 after 0 s, about ")


def test_a_long_run_is_not_silent_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    said, deadline = "", time.monotonic() + 30
    with shown_progress(2.0, line_s=0.01):
        while said.count("\n") < 2 and time.monotonic() < deadline:
            time.sleep(0.01)
            said += capsys.readouterr().err
    assert said.startswith("note: t = ")
    assert " of 2 s after " in said


@pytest.mark.parametrize(
    ("engine", "scene", "field"),
    [
        ("reference", ("clearance-driven-0.1mm", {"radial_clearance_m": 1e-200}), "radial_clearance_m"),
        (
            "reference",
            ("clearance-driven-0.1mm", {"friction": friction(1e-14)}),
            "friction.regularisation_speed_m_s",
        ),
        (
            "reference",
            ("rigid-driven-0.1mm", {"friction": friction(1e-200)}),
            "friction.regularisation_speed_m_s",
        ),
        (
            "scipy",
            ("clearance-driven-0.1mm", {"friction": friction(1e-14)}),
            "friction.regularisation_speed_m_s",
        ),
    ],
)
def test_a_run_whose_steps_collapse_says_which_field_forces_it(
    engine: str, scene: tuple[str, dict[str, object]], field: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scipy_calls, "OUTLASTING", 5_000)
    monkeypatch.setattr(reference_runs, "LOOK_UP_STEPS", 20_000)
    name, changes = scene
    with pytest.raises(SimulationFailed, match=rf"^clearance\.B\.{field}: expected"):
        make_engine(engine).simulate(scene_with(name, **changes), RunSettings(1e-5, 10))
