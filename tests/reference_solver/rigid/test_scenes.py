"""Every rigid scene of the library against minimal coordinates, as long as its motion can be predicted."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engine_models.engine import Trajectory
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.equations import loads_of, mechanism_of
from engine_models.scene.drives import RampDrive
from engine_models.scene.library import RIGID_SCENES
from engine_models.scene.loads import Loads, SliderLoad
from engine_models.scene.scene import Clearances, Friction, Scene
from reference_solver.solution import Solution
from reference_solver.solver import StepChoice, solve
from studies.judges.horizon import moved
from studies.truth.equations import CONTACT, FOLLOWS
from studies.truth.motion import Motion
from studies.truth.stepping import collocated, radau
from tests.helpers.crank_sliders import in_minimal_coordinates
from tests.helpers.mechanism_energy import energy_residual_J

FloatArray = NDArray[np.float64]

#: An impact's time and the slider's place: far above both solvers' errors while nothing amplifies them
#: (measured 1e-12 s, 1e-12 m), far below what a wrong term would leave.
TIME, PLACE = 1e-10, 1e-9
#: An approach speed in m/s: the times' tolerance times the largest acceleration, 3e4 m/s^2.
APPROACH = 3e-6
#: A normal force, as a part of the largest: an acceleration's relative error, that of the places' tolerance.
#: So it is of torques and of works, which are made by those forces (measured 4e-7 and 1.1e-8 at most).
FORCE = 1e-6
#: A pin comes to rest after ever shorter flights, of which both sides leave out the last, differently. Those
#: below a thousandth of the step take less than step/1000/(1 - e), and those that round-off hides this.
THOUSANDTH, HIDDEN = 1e-3, 1e-7
#: Slower impacts are the ends of such series; their times are places' errors over speeds.
SLOW = 1e-2
#: The independent twin starts this much beside, in rad: more than both solvers' own errors come to.
MOVED_RAD = 1e-12
#: A quotient of two forces.
ROUND_OFF = 4 * float(np.finfo(float).eps)
#: RK4's theory is 4; the steps are cut at events, differently for each step, which scatters the order.
ORDER_TOLERANCE = 0.1


@dataclass(frozen=True)
class Case:
    """Run to ``end_s`` with a step; what the horizon has to contain."""

    end_s: float
    step_s: float
    impacts: int
    mode_changes: int


CASES = {
    "rigid-driven-0.5mm": Case(0.0105, 2e-6, 80, 3),
    "rigid-driven-0.1mm": Case(0.0102, 2e-6, 50, 3),
    "rigid-driven-0.02mm": Case(0.0015, 5e-7, 40, 1),
    "rigid-driven-damped": Case(0.002, 5e-7, 8, 1),
    "rigid-driven-A": Case(0.0045, 1e-6, 50, 1),
    "rigid-driven-AB": Case(0.003, 5e-7, 40, 0),
    "rigid-free-0.5mm": Case(0.08, 1e-5, 12, 0),
    "rigid-free-OAB": Case(0.03, 1e-5, 40, 0),
    "rigid-pendulum": Case(0.2, 1e-4, 15, 1),
    "rigid-start-up": Case(0.012, 2e-6, 30, 1),
    "rigid-compressor": Case(0.012, 2e-6, 30, 1),
    "two rubbing joints": Case(0.006, 1e-6, 15, 4),
    "two rubbing joints sped up under load": Case(0.006, 1e-6, 15, 9),
}
SAMPLES = 100


def run(scene: Scene, end: float, step: float | StepChoice, compiled: bool) -> Solution:
    q, v = start_state(scene)
    return solve(
        mechanism_of(scene),
        q.ravel(),
        v.ravel(),
        end_time_s=end,
        samples=SAMPLES,
        step=step,
        compiled=compiled,
    )


def restitution(scene: Scene) -> float:
    """Return the largest restitution of the scene's joints."""
    return max(joint.wall.restitution for joint in mechanism_of(scene).contacts)


def scene_of(name: str) -> Scene:
    """Return the library's scene, or one of two joints with friction that support each other's impacts.

    That one also under every kind of load, with a crank whose speed changes until 3 ms, while pins follow.
    """
    if name in RIGID_SCENES:
        return RIGID_SCENES[name]()
    if name.endswith("sped up under load"):
        scene = scene_of("two rubbing joints")
        full, compressor = scene.start.crank_speed_rad_s, RIGID_SCENES["rigid-compressor"]().load.slider
        assert compressor is not None
        work: Any = {"force_N": -300.0, "viscous_N_s_m": 40.0, "spring_N_m": 2e4, "free_position_m": 0.12}
        return scene.model_copy(
            update={
                "start": scene.start.model_copy(update={"crank_speed_rad_s": 0.6 * full, "time_s": 0.021}),
                "drive": RampDrive(kind="ramp", final_speed_rad_s=full, ramp_time_s=0.024),
                "load": Loads(slider=SliderLoad(gas=compressor.gas, **work)),
            }
        )
    scene = RIGID_SCENES["rigid-driven-AB"]()
    friction = Friction(law="tanh", coefficient=0.1, regularisation_speed_m_s=0.05)
    assert scene.clearance.B is not None
    rubbing = scene.clearance.B.model_copy(update={"restitution": 0.2, "friction": friction})
    return scene.model_copy(update={"clearance": Clearances(A=rubbing, B=rubbing)})


def test_every_rigid_scene_has_its_case() -> None:
    assert RIGID_SCENES.keys() < CASES.keys()


def works_J(found: Solution, scene: Scene) -> dict[str, FloatArray]:
    """Return the works of the drive and of the slider's load that a run has integrated, by part."""
    loads = {f"load{k}": part for k, part in enumerate(loads_of(scene))}
    works = {part: found.sums[name] for name, part in loads.items() if name in found.sums}
    return works | ({"drive": found.constraint_work_J} if scene.speed_is_prescribed else {})


Hits = list[tuple[float, str, float]]


def hits_of(run: Trajectory) -> Hits:
    """Return impacts that are not slow, as (time, joint, approach speed)."""
    found = [
        (float(time), joint, float(speed))
        for joint, contact in run.contacts.items()
        for time, speed in zip(contact.impacts.time_s, contact.impacts.approach_speed_m_s, strict=True)
    ]
    return sorted(hit for hit in found if hit[2] > SLOW)


class Following(Motion):
    """A motion that keeps from when on which joints' pins follow their walls."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, collocated, radau(7, 1e-11))
        self.names = scene.joints_with_clearance
        self.changes: list[tuple[float, tuple[str, ...]]] = []

    def _settle(self, joint: int) -> None:
        before = self._following()
        super()._settle(joint)
        if self._following() != before:
            self.changes.append((self.time_s, self._following()))

    def _following(self) -> tuple[str, ...]:
        return tuple(self.names[k] for k in np.flatnonzero(self.phases[: self.joints, CONTACT] == FOLLOWS))


def first_difference(some: Hits, others: Hits) -> float | None:
    """Return the time of the first impact in which two lists differ by more than ``TIME`` or in the joint."""
    for one, other in zip(some, others, strict=False):
        if one[1] != other[1] or abs(one[0] - other[0]) > TIME:
            return min(one[0], other[0])
    return None


@pytest.mark.parametrize("name", CASES)
def test_up_to_its_horizon_a_scene_moves_as_in_minimal_coordinates(name: str) -> None:
    case, scene = CASES[name], scene_of(name)
    scene = scene.model_copy(update={"end_time_s": case.end_s})
    expected, twin = (in_minimal_coordinates(one, SAMPLES) for one in (scene, moved(scene, MOVED_RAD)))
    times, place = expected.time_s, expected.position[:, -1, 0]
    settled, motion = HIDDEN + THOUSANDTH * case.step_s / (1 - restitution(scene)), Following(scene)
    assert motion.to(case.end_s)
    hits = [hits_of(side) for side in (expected, twin)]
    apart = times[np.abs(place - twin.position[:, -1, 0]) > PLACE]
    horizon = min([case.end_s, *apart[:1], *([at] if (at := first_difference(*hits)) else [])])
    known = [hit for hit in hits[0] if hit[0] < horizon - TIME]
    assert len(known) >= case.impacts, f"the horizon of {horizon} s has {len(known)} impacts"
    changes = [change for change in motion.changes if change[0] < horizon - settled]
    assert len(changes) >= case.mode_changes, f"the horizon of {horizon} s has {changes}"

    found = run(scene, case.end_s, case.step_s, compiled=True)
    joints = scene.joints_with_clearance
    fast = [hit for hit in found.impacts if hit.approach_speed_m_s > SLOW][: len(known)]
    assert [joints[hit.contact] for hit in fast] == [hit[1] for hit in known]
    late = np.abs(np.array([hit.time_s for hit in fast]) - [hit[0] for hit in known])
    assert late.max() < TIME, f"impacts up to {late.max():.1e} s off"
    faster = np.abs(np.array([hit.approach_speed_m_s for hit in fast]) - [hit[2] for hit in known])
    assert faster.max() < APPROACH, f"approach speeds up to {faster.max():.1e} m/s off"
    inside = times < horizon
    off = np.abs(found.q[:, -3] - place)[inside]
    assert off.max() < PLACE, f"{off.max():.1e} m off"
    for change, (at, following) in zip(found.mode_changes, changes, strict=False):
        assert tuple(joints[k] for k in change.following) == following
        assert abs(change.time_s - at) < settled, f"mode change {change.time_s - at:.1e} s off"
    forces = np.stack([expected.contacts[joint].normal_force_N for joint in joints], axis=-1)
    wrong = np.abs(found.normal_force_N - forces)[inside]
    assert wrong.max() <= FORCE * np.abs(forces).max(), f"forces up to {wrong.max():.1e} N off"
    if scene.speed_is_prescribed:
        torque = expected.driver_torque_N_m
        assert torque is not None
        wrong = np.abs(found.multipliers[:, -1] - torque)[inside]
        assert wrong.max() <= FORCE * np.abs(torque).max(), f"torques up to {wrong.max():.1e} N m off"
    works = {"drive": expected.driver_work_J, **expected.load_work_J}
    for part, work in works_J(found, scene).items():
        true = works[part.removeprefix("slider.")]
        assert true is not None
        wrong = np.abs(work - true)[inside]
        assert wrong.max() <= FORCE * np.abs(true).max(), f"{part}: {wrong.max():.1e} J off"


def test_the_ledger_of_the_damped_scene_closes_at_order_four_with_friction_in_following() -> None:
    # Steps in following are cut by friction and by the pin's own swing; both fall with the longest step.
    scene, steps, longest = RIGID_SCENES["rigid-driven-damped"](), [4e-6, 2e-6, 1e-6], StepChoice(4e-6, 200.0)
    runs = [run(scene, scene.end_time_s, longest.at(step), compiled=True) for step in steps]
    last = runs[-1]
    assert last.closed[SAMPLES // 10 :].all()
    residuals = [float(np.abs(energy_residual_J(one)).max()) for one in runs]
    order = float(np.polyfit(np.log(steps), np.log(residuals), 1)[0])
    assert abs(order - 4) < ORDER_TOLERANCE, f"order {order:.2f} of {residuals} J"
    assert last.sums["slide0"][-1] > 1.0, "friction takes joules, its ledger misses nanojoules"
    assert last.sums["slide0"][-1] > 1e8 * residuals[-1]
    # Friction's force stays within Coulomb's limit, and reaches it in fast sliding.
    share = np.abs(last.friction_force_N[:, 0])[last.closed[:, 0]] / last.normal_force_N[last.closed]
    assert 0.099 < share.max() <= 0.1 * (1 + ROUND_OFF)
    impulses = sum(hit.normal_impulse_N_s for hit in last.impacts)
    assert last.sums["normal0"][-1] > 10 * impulses
    assert np.diff(last.sums["normal0"]).min() >= 0


def test_a_pin_follows_a_narrow_bearing_at_any_longest_step() -> None:
    """It rolls round a clearance of 0.02 mm a hundred times faster than the crank turns."""
    scene = RIGID_SCENES["rigid-driven-0.02mm"]()
    found = run(scene, 0.012, 5e-5, compiled=True)
    closed = found.closed[:, 0]
    assert closed.mean() > 0.5
    distance = np.hypot(*found.gap_m[:, 0].T)
    # Samples between steps of a quarter of a radian, or more where a step begins slowly: 0.018 of a clearance
    # off the wall, where steps without that limit left it by 0.53.
    assert np.abs(distance[closed] / 2e-5 - 1).max() < 0.05
