"""Rigid walls: flight, impact and following of one pin in closed form, and of crank-sliders' pins."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from engine_models.mechanics.start import start_state
from engine_models.reference.run import mechanism_of
from reference_solver.failures import InconsistentStart
from reference_solver.mechanism.contacts import ContactLaw, RigidWall
from reference_solver.mechanism.data import FrictionLaw
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.solver import ErrorControl, StepChoice
from tests.helpers.mechanism_energy import energy_residual_J
from tests.helpers.orders import slope
from tests.scenes import scene
from tests.solver.pins import CLEARANCE, GRAVITY, MASS, RADIUS, bearing, disc, joint_force_N, run

FloatArray = NDArray[np.float64]

INERTIA, STILL = 4e-6, [0.0] * 3
#: RK4 integrates a free disc exactly. A time is a position's round-off (1e-19 m) over the speed, down to
#: 2e-6 m/s before the closing: 1e-13 s; sums of a hundred flights stay an order below what is asked. So do
#: speeds: products of a few numbers, a few units in the last place for each impact, and the times' errors.
CLOSED_FORM = 1e-12
#: A product of a few numbers.
ROUND_OFF = 64 * float(np.finfo(float).eps)


def pinned(restitution: float, gravity: float = 0.0, friction: float = 0.0, **sizes: Any) -> Mechanism:
    law = FrictionLaw("tanh", friction, 0.01) if friction else None
    return disc(bearing(RigidWall(restitution), law, **sizes), gravity=gravity, inertia=INERTIA)


def close(found: object, expected: object, tolerance: float, what: str) -> None:
    difference = np.abs(np.asarray(found) - np.asarray(expected)).max()
    assert difference <= tolerance, f"{what}: off by {difference:.2e}, allowed {tolerance:.1e}"


@pytest.mark.parametrize("controlled", [False, True], ids=["rk4", "dop853"])
def test_the_bounces_under_gravity_converge_in_closed_form_and_end_at_rest_on_the_wall(
    controlled: bool,
) -> None:
    e, end, longest = 0.6, 0.3, 3e-4
    step = ErrorControl(1e-12) if controlled else StepChoice(longest)
    found = run(pinned(e, GRAVITY), STILL, STILL, end, step)
    speed, fall = np.sqrt(2 * GRAVITY * CLEARANCE), np.sqrt(2 * CLEARANCE / GRAVITY)
    speeds = speed * e ** np.arange(len(found.impacts))
    flights = 2 * speeds * e / GRAVITY  # after each impact
    times = fall + np.concatenate([[0], np.cumsum(flights[:-1])])
    close([i.time_s for i in found.impacts], times, CLOSED_FORM, "times")
    close([i.approach_speed_m_s for i in found.impacts], speeds, CLOSED_FORM * GRAVITY, "approach")
    # The last impact is the first whose next flight is below a thousandth of the step, or whose height is of
    # the tolerance, as a part of the mechanism's length.
    heights = (flights / 2) ** 2 * GRAVITY / 2
    closing = int(np.argmax(heights < 1e-12 * RADIUS if controlled else flights < 1e-3 * longest))
    assert [i.kind for i in found.impacts] == ["impact"] * closing + ["closing"]
    for impact in found.impacts:
        e = e if impact.kind == "impact" else 0.0
        exact = (1 - e**2) / 2 * impact.approach_speed_m_s**2 * MASS
        assert impact.energy_lost_J == pytest.approx(exact, rel=ROUND_OFF)
        assert impact.effective_mass_kg == pytest.approx(MASS, rel=ROUND_OFF)
    last, fallen = found.impacts[-1], MASS * GRAVITY * CLEARANCE
    assert found.sums["closing0"][-1] == last.energy_lost_J
    # All that was lost is the fall through c.
    close(found.sums["impact0"][-1] + last.energy_lost_J, fallen, CLOSED_FORM * fallen, "losses in J")
    close(energy_residual_J(found), 0.0, CLOSED_FORM * fallen, "ledger in J")
    rest = found.time_s > last.time_s
    assert found.closed[:, 0].tolist() == rest.tolist()
    exactly = 1e-12 if controlled else ROUND_OFF
    close(joint_force_N(found)[rest], [[0.0, MASS * GRAVITY]], exactly * MASS * GRAVITY, "weight in N")
    close(found.q[rest, :2], [0.0, -CLEARANCE], exactly * CLEARANCE, "place at rest in m")
    assert [change.following for change in found.mode_changes] == [(0,)]


@pytest.mark.parametrize("above", [1e-9, -1e-9])
def test_a_graze_within_one_step_is_not_missed_and_a_near_miss_is_none(above: float) -> None:
    # Thrown upwards off centre, the pin peaks between two ends of steps, past or short of the wall.
    apex = (1 + above) * CLEARANCE
    rise = np.sqrt(2 * apex / GRAVITY)
    found = run(pinned(0.5, GRAVITY), STILL, [0.0, GRAVITY * rise, 0.0], 1.9 * rise, 10)
    if above < 0:
        assert found.impacts == ()
    else:
        speed = np.sqrt(2 * GRAVITY * (apex - CLEARANCE))
        # The speed at a depth of 1e-9 c is the square root of a difference: half of its digits are lost.
        assert found.impacts[0].approach_speed_m_s == pytest.approx(speed, rel=1e-6)
        assert found.impacts[0].time_s == pytest.approx(rise - speed / GRAVITY, abs=CLOSED_FORM)


def test_pins_hit_where_time_or_angles_are_coarser_than_the_gap() -> None:
    found = run(pinned(1.0, clearance=0.5, radius=1.0), STILL, [10.0, 0.0, 0.0], 50.0, 5000)
    close([impact.time_s for impact in found.impacts], 0.05 + 0.1 * np.arange(500), 1e-11, "times")
    start, v, turned = np.array([-0.05, 0.0, 0.0]), [0.3, 0.1, 3.0], np.array([0.0, 0.0, 200 * np.pi])
    for law in (RigidWall(0.7), ContactLaw(6.61e10)):
        at_arm = disc(bearing(law, point=(0.05, 0.0)))
        one, other = (run(at_arm, q, v, 0.02, StepChoice(1e-5)).q for q in (start, start + turned))
        close(one, other - turned, 1e-7, "places")


LONG = 0.05  # m: a clearance in which a pin slides like a pendulum


def pendulum(rate: float, times: FloatArray) -> FloatArray:
    """Return angle from straight down, where it starts, and rate (2, n) of a pendulum of length ``LONG``."""

    def rates(_: float, y: FloatArray) -> list[float]:
        return [y[1], -GRAVITY / LONG * np.sin(y[0])]

    run = solve_ivp(rates, (0.0, times[-1]), [0.0, rate], "DOP853", times, rtol=1e-13, atol=1e-14)
    return np.asarray(run.y)


def test_a_pin_thrown_up_its_wall_leaves_where_the_closed_form_says_and_falls_back_on_a_parabola() -> None:
    # Without pressure m v^2/c + m g cos(theta) = 0 and v^2 = v0^2 - 2 g c (1 - cos(theta)).
    speed = np.sqrt(3.5 * GRAVITY * LONG)
    leaving = np.arccos((2 * GRAVITY * LONG - speed**2) / (3 * GRAVITY * LONG))
    times = np.linspace(0.0, 0.2, 2001)
    reached = float(np.interp(leaving, pendulum(speed / LONG, times)[0], times))
    for _ in range(4):  # Newton's method on the independent pendulum
        angle, rate = pendulum(speed / LONG, np.array([0.0, reached]))[:, -1]
        reached -= (angle - leaving) / rate
    # From there a parabola, back to the circle: |d|^2 = c^2 is a quartic in time with a triple root at 0.
    sideways = np.sqrt(-GRAVITY * LONG * np.cos(leaving))
    fall = 4 * sideways * np.sin(leaving) / GRAVITY
    counts, errors = [150, 300, 600], []
    for count in counts:
        wide = pinned(0.5, GRAVITY, clearance=LONG, radius=0.2)
        found = run(wide, [0.0, -LONG, 0.0], [speed, 0.0, 0.0], 0.3, count)
        assert [c.following for c in found.mode_changes[:2]] == [(0,), ()]
        leave, back = found.mode_changes[1].time_s, found.impacts[0].time_s
        errors.append(abs(leave - reached))
        assert abs(back - reached - fall) < 20 * errors[-1] + CLOSED_FORM
    assert errors[-1] < 1e-8, f"leaves {errors[-1]:.1e} s off"  # measured 2e-11
    # The end of a cut step adds its own, irregular part to the error: order 4 is a bound here.
    assert -slope(counts, errors) > 3.5, errors


@pytest.mark.parametrize(("friction", "sticks"), [(0.5, True), (0.01, False)])
def test_a_spinning_disc_gets_the_closed_form_tangential_impulse(friction: float, sticks: bool) -> None:
    e, across, spin, arm = 0.7, np.array([0.3, 0.1]), -4.0, RADIUS - CLEARANCE
    approach = float(np.hypot(*across))
    found = run(pinned(e, friction=friction), STILL, [*across, spin], 1.3 * CLEARANCE / approach, 10)
    (impact,) = found.impacts
    assert impact.approach_speed_m_s == pytest.approx(approach, rel=ROUND_OFF)
    normal = (1 + e) * MASS * approach
    sliding = spin * arm  # through the centre the pin hits head on: only its spin slides
    stick = -sliding / (1 / MASS + arm**2 / INERTIA)
    assert (abs(stick) <= friction * normal) == sticks
    tangential = stick if sticks else -friction * normal * np.sign(sliding)
    assert impact.normal_impulse_N_s == pytest.approx(normal, rel=ROUND_OFF)
    assert impact.tangential_impulse_N_s == pytest.approx(tangential, rel=ROUND_OFF)
    n = across / approach
    after = -e * approach * n + tangential / MASS * np.array([-n[1], n[0]])
    expected = [*after, spin + arm * tangential / INERTIA]
    close(found.v[-1], expected, ROUND_OFF * abs(spin), "velocities after")
    remaining = sliding + tangential * (1 / MASS + arm**2 / INERTIA)
    lost = (1 - e**2) / 2 * MASS * approach**2 - tangential * (sliding + remaining) / 2
    assert impact.energy_lost_J == pytest.approx(lost, rel=ROUND_OFF)
    close(energy_residual_J(found), 0.0, ROUND_OFF * MASS * approach**2, "ledger in J")


def test_a_slow_approach_closes_without_rebound_and_a_pin_outside_is_refused() -> None:
    slow = disc(bearing(RigidWall(0.9, 0.02)), gravity=GRAVITY)
    found = run(slow, [0.0, -0.99 * CLEARANCE, 0.0], STILL, 0.1, 100)
    assert [i.kind for i in found.impacts] == ["closing"]
    assert found.closed[-1, 0]
    met = run(pinned(0.5), [CLEARANCE, 0.0, 0.0], [1.0, 0.0, 0.0], 1e-4, 10)  # at its wall at t = 0
    assert (met.v[0, 0], met.impacts[0].time_s) == (pytest.approx(-0.5), 0.0)
    with pytest.raises(InconsistentStart, match="expected pins inside rigid bearings"):
        run(slow, [1.01 * CLEARANCE, 0.0, 0.0], STILL, 1.0, 10)


def test_a_pin_at_rest_on_a_rigid_wall_leaves_when_a_compliant_one_lifts_it() -> None:
    spring = bearing(ContactLaw(1e6, 1.0), centre=(0.0, 1e-4))
    lifted = disc(bearing(RigidWall(0.6)), spring, gravity=GRAVITY)
    found = run(lifted, [0.0, -CLEARANCE, 0.0], STILL, 1e-4, 10, 4)
    assert not found.mode_changes
    # The spring is pressed by 0.1 mm: 100 N.
    assert found.normal_force_N[0] == pytest.approx([0.0, 100.0], rel=1e-10)
    # Lifted by 100 N - m g, less what the spring loses in stiffness on the way: omega^2 t^2 / 12.
    lift = (100.0 / MASS - GRAVITY) * 1e-4**2 / 2
    assert found.q[-1, 1] + CLEARANCE == pytest.approx(lift, rel=1e6 / MASS * 1e-4**2 / 10)


def test_the_ledger_closes_at_order_four_over_a_revolution_with_impacts_closings_and_following() -> None:
    counts, of = [6000, 12000, 24000], scene("rigid").replace("clearance.B.restitution", 0.5)
    q, v = (part.ravel() for part in start_state(of))
    runs = [run(mechanism_of(of), q, v, 0.012, count, 100) for count in counts]
    assert {impact.kind for impact in runs[-1].impacts} == {"impact", "closing"}
    assert len(runs[-1].mode_changes) > 2
    residuals = [float(np.abs(energy_residual_J(one)).max()) for one in runs]
    # The steps are cut at events, differently for each step, which scatters the order.
    assert abs(-slope(counts, residuals) - 4) < 0.2, residuals
    assert runs[-1].sums["impact0"][-1] > 1.0
    assert 0 < runs[-1].sums["closing0"][-1] < 1e-6
