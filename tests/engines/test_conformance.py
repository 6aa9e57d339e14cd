"""What every engine owes on every scene, whatever its method: each claim once, for all of them."""

import re
from dataclasses import dataclass, fields
from functools import reduce

import numpy as np
import pytest

from engine_models.engine import Engine, RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.engines import engine_class, make_engine
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.mechanics.start import start_state
from studies.judges.metrics import constraint_violation_m
from tests.engines.runs import SAMPLES, engine, errors, fresh, impact_numbers, numbers, run, true_solution
from tests.helpers.starts import started_from
from tests.scenes import scene

SMOOTH = ("free", "clocked", "tabled", "everything", "bead", "yoke")
LOOSE = ("rubbing", "bearing", "loop", "linear", "rigid", "walls")


@dataclass(frozen=True)
class Owes:
    """The order of smooth motion, None where a tolerance decides; largest errors, smooth and with impacts."""

    order: int | None
    smooth: float
    loose: float


#: Two to five times what is measured at the shorter step, as a part of the largest of its kind.
ENGINES = {
    "reference": Owes(4, 6e-10, 3e-8),
    "exudyn": Owes(2, 1e-4, 3e-4),
    "pymunk": Owes(2, 4e-4, 1e-2),
    "scipy": Owes(None, 1e-11, 3e-6),
}
#: Methods of theirs, on a scene: their order past the first samples.
METHODS = {
    ("reference stabilisation=none", "everything"): 4,
    ("reference stabilisation=baumgarte", "everything"): 4,
    ("exudyn solver=GeneralizedAlpha", "everything"): 2,
    ("exudyn solver=RK44", "bead"): 4,  # explicit ones have no loops
    ("pymunk iterations=30", "everything"): 2,
}
#: Each engine by methods that a tolerance decides, on a scene that it runs by them.
CONTROLLED = {
    "reference method=dop853 step_tolerance=1e-6": "everything",
    "reference method=dopri5 step_tolerance=1e-6": "everything",
    "exudyn solver=DOPRI5 step_tolerance=1e-6": "bead",
    "scipy rtol=1e-6 atol=1e-8": "everything",
    "scipy method=LSODA rtol=1e-6 atol=1e-8": "free",
}
#: What is not an engine's, and in which words.
REFUSED = {
    ("exudyn", "rigid"): "exudyn has no rigid contact",
    ("exudyn", "walls"): "exudyn has no rigid contact",
    ("pymunk", "bead"): "Chipmunk's groove",
    ("pymunk", "yoke"): "Chipmunk's groove",
    ("scipy", "walls"): "no friction on a rigid wall",
}
#: Pymunk's dry friction acts at any speed, however low: its losses are other ones.
OWN_LAW = {("pymunk", "walls"): ("work B normal_loss_J", "work B friction_loss_J")}
#: Larger errors: where SciPy locates no kink of a table, and the last bounces before a rest are left out.
LARGER = {("scipy", "tabled"): 1e-7, ("reference", "walls"): 3e-6}
PAIRS = [(name, case) for name in ENGINES for case in (*SMOOTH, *LOOSE) if (name, case) not in REFUSED]
pairs = pytest.mark.parametrize(("name", "case"), PAIRS, ids=map("-".join, PAIRS))
each = pytest.mark.parametrize("name", ENGINES)
#: Odd numbers of steps between samples, as an even one would hide a force that rings from step to step.
STEPS, MANY = (27, 81), (243, 729)
#: Scenes of which a run is made twice; of the others, once more with half the samples alone.
REPEATED = ("clocked", "everything", "bead", "loop", "walls")
#: By how much joints may be open in m: by Pymunk's sweeps, elsewhere by round-off or a tolerance.
CLOSED_M = {"reference": 1e-13, "exudyn": 1e-6, "pymunk": 5e-6, "scipy": 1e-9}
#: How many of the bounces before a rest each engine tells.
LOCATED = {"reference": 9, "pymunk": 2}
#: An error below this part of the largest is round-off, and has no order.
ROUND_OFF = 1e-10


def steps_of(name: str, case: str) -> tuple[int, int]:
    """Return numbers of steps between samples, a few and many of them."""
    if engine(name).controls_error:
        return 1, 1
    return MANY if case in LOOSE else STEPS


def sharp(name: str, case: str) -> Trajectory:
    return run(name, scene(case), steps_of(name, case)[1])


def true(name: str, case: str) -> Trajectory:
    """Return the reference solution of what an engine says that it solves."""
    return true_solution(engine(name).twin(scene(case)))


def allowed(name: str, case: str) -> float:
    usual = ENGINES[name].smooth if case in SMOOTH else ENGINES[name].loose
    return LARGER.get((name, case), usual)


def too_slow(name: str, case: str, order: int, since: int = 0) -> dict[str, tuple[float, float]]:
    """Return the errors that do not fall by an order, at the longer and at the shorter step."""
    long, short = (
        errors(run(name, scene(case), steps), true(name, case), since) for steps in steps_of(name, case)
    )
    least = {key: max(ROUND_OFF, error / (0.65 * 3**order)) for key, error in long.items()}
    return {key: (long[key], error) for key, error in short.items() if error > least[key]}


@pytest.mark.parametrize(("name", "case"), REFUSED, ids=map("-".join, REFUSED))
def test_what_an_engine_cannot_run_it_refuses_in_one_line(name: str, case: str) -> None:
    with pytest.raises((UnsupportedScene, SimulationFailed), match=REFUSED[name, case]) as refused:
        fresh(name, scene(case), 1)
    assert "\n" not in str(refused.value)


@pairs
def test_a_run_tells_all_begins_in_the_scenes_state_and_keeps_joints_closed(name: str, case: str) -> None:
    mine = sharp(name, case)
    told = {key: value.shape for key, value in numbers(mine).items() if np.isfinite(value).all()}
    wanted = {key: value.shape for key, value in numbers(true(name, case)).items()}
    assert {item for item in wanted.items() if not item[0].startswith("moment")} <= told.items()
    assert mine.steps > 0
    assert mine.solve_time_s > 0
    np.testing.assert_allclose(mine.time_s, np.linspace(0, scene(case).end_time_s, SAMPLES + 1), rtol=1e-12)
    position, velocity = start_state(scene(case))
    np.testing.assert_allclose(mine.position[0], position, rtol=0, atol=1e-12)
    np.testing.assert_allclose(mine.velocity[0], velocity, rtol=0, atol=1e-9 * (1 + np.abs(velocity).max()))
    assert constraint_violation_m(scene(case), mine).max() < CLOSED_M[name]


@pairs
def test_every_number_is_the_true_one(name: str, case: str) -> None:
    found = errors(sharp(name, case), true(name, case))
    if case in ("rigid", "walls") and name == "pymunk":  # there a force is an impulse over a step
        found = {key: error for key, error in found.items() if not key.startswith(("force", "torque"))}
    found = {key: error for key, error in found.items() if key not in OWN_LAW.get((name, case), ())}
    assert {key: error for key, error in found.items() if not error < allowed(name, case)} == {}


@pytest.mark.parametrize(
    ("name", "case"), [(name, case) for name, case in PAIRS if ENGINES[name].order and case in SMOOTH]
)
def test_every_error_falls_by_the_order(name: str, case: str) -> None:
    assert engine(name).order == ENGINES[name].order
    slow = too_slow(name, case, ENGINES[name].order or 0)
    if (name, case) == ("pymunk", "tabled"):  # its forces jump with a table's third derivative
        slow = {key: error for key, error in slow.items() if not key.startswith(("force", "torque"))}
    assert slow == {}


@pytest.mark.parametrize(("name", "case"), METHODS, ids=map(" on ".join, METHODS))
def test_so_do_those_of_other_methods(name: str, case: str) -> None:
    assert engine(name).order == METHODS[name, case]
    assert too_slow(name, case, METHODS[name, case], since=2) == {}


@pytest.mark.parametrize(("name", "case"), CONTROLLED.items(), ids=CONTROLLED)
def test_errors_fall_with_the_tolerance(name: str, case: str) -> None:
    loose, tight = engine(name), reduce(lambda sharpened, _: sharpened.sharper(), range(3), engine(name))

    def worst(of: Engine) -> float:
        mine = of.simulate(scene(case), RunSettings(scene(case).end_time_s, SAMPLES))
        return max(errors(mine, true(name, case)).values())

    assert worst(tight) < max(worst(loose) / 50, ROUND_OFF), "a thousandth of a tolerance"


@pairs
def test_energy_is_accounted_for(name: str, case: str) -> None:
    mine = sharp(name, case)
    left = np.abs(energy_balance_residual_J(scene(case), mine)).max()
    assert left < allowed(name, case) * energy_in_play_J(scene(case), mine)


@pytest.mark.parametrize(("name", "case"), [pair for pair in PAIRS if pair[1] in LOOSE])
def test_impacts_are_those_of_the_reference_solution(name: str, case: str) -> None:
    own = impact_numbers(sharp(name, case))
    for key, value in impact_numbers(true(name, case)).items():
        if case == "walls":  # the last of many bounces are left out, by each in its own way
            value = value[: LOCATED[name]]
            own[key] = own[key][: LOCATED[name]]
        assert own[key].shape == value.shape, key
        known = np.isfinite(value)  # rigid walls have no depths, and peaks are the converged solution's
        slack = 3 * allowed(name, case) * np.abs(value[known]).max(initial=0.0)
        np.testing.assert_allclose(own[key][known], value[known], rtol=0, atol=slack, err_msg=key)


@each
def test_impulses_and_losses_of_impacts_add_up_to_those_of_the_contact(name: str) -> None:
    mine = sharp(name, "rubbing")
    contact = mine.contacts["B"]
    over = contact.impacts.time_s + contact.impacts.duration_s
    after = int(np.searchsorted(mine.time_s, over[-1]))  # the first sample in flight after the last impact
    assert contact.penetration_m[after] < 0
    assert contact.friction_loss_J is not None
    assert contact.friction_loss_J[after] > 1e-3 * contact.dissipated_energy_J[after], "friction takes a part"
    lost, impulse = contact.impacts.energy_lost_J.sum(), contact.impacts.normal_impulse_N_s.sum()
    assert lost == pytest.approx(contact.dissipated_energy_J[after], rel=1e-6)
    assert impulse == pytest.approx(contact.normal_impulse_N_s[after], rel=1e-6)


@pairs
def test_a_run_repeats_itself_and_samples_change_nothing(name: str, case: str) -> None:
    steps = steps_of(name, case)[0]
    first = numbers(run(name, scene(case), steps))
    if case in REPEATED:
        again = numbers(fresh(name, scene(case), steps))
        assert [key for key, value in first.items() if not np.array_equal(value, again[key])] == []
    half = numbers(fresh(name, scene(case), 2 * steps, SAMPLES // 2))
    for key, value in first.items():
        # Pymunk's forces are differences of speeds, over the step: they magnify roundings (measured 1e-9).
        slack = 1e-11 if ENGINES[name].order and name != "pymunk" else 1e-8
        np.testing.assert_allclose(
            half[key], value[::2], rtol=0, atol=slack * np.abs(value).max(), err_msg=key
        )


@each
def test_a_run_begun_later_is_the_rest_of_the_whole_one(name: str) -> None:
    whole_scene, steps, middle = scene("clocked"), steps_of(name, "clocked")[1], SAMPLES // 2
    whole = run(name, whole_scene, steps)
    there = true(name, "clocked")
    state = there.position[middle], there.velocity[middle], float(there.time_s[middle])
    rest = fresh(name, started_from(whole_scene, *state, whole_scene.end_time_s / 2), steps, middle)
    slack = 3 * ENGINES[name].smooth * np.abs(whole.position).max()
    np.testing.assert_allclose(rest.position, whole.position[middle:], rtol=0, atol=slack)


@each
def test_a_run_that_cannot_go_on_says_when_in_one_line(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    wild = scene("free").replace("start.crank_speed_rad_s", 1e200)
    with pytest.raises(SimulationFailed, match=r"^[^\n]*t = \S+ s[^\n]*$") as failed:
        engine(name).simulate(wild, RunSettings(1e-5, 10))
    (time_s, *_) = re.findall(r"t = (\S+) s", str(failed.value))
    assert 0 <= float(time_s) <= wild.end_time_s
    assert capfd.readouterr() == ("", "")


@each
def test_settings_that_are_none_are_refused_by_name(name: str) -> None:
    for field in fields(engine_class(name)):
        with pytest.raises(ValueError, match=f"{field.name}: expected "):
            make_engine(name, **{field.name: object()})


#: Those that step over a singular position; a tolerance lets it by luck of round-off alone, or not at all.
@pytest.mark.parametrize("name", ["reference", "exudyn", "pymunk"])
def test_a_fold_is_passed_along_the_one_smooth_branch(name: str) -> None:
    """A rod as long as the crank is at minus its angle, before and after the fold: x = 2 r cos(theta)."""
    mine = run(name, scene("fold"), 81)
    angle = mine.position[:, 0, 2]
    assert angle[-1] == pytest.approx(1.9609893, abs=5e-4)
    np.testing.assert_allclose(
        mine.position[:, 2, 0], 0.1 * np.cos(angle), rtol=0, atol=CLOSED_M[name.split()[0]]
    )
