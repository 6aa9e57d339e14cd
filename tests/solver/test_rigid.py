"""Rigid joints: flight, impact and following of one pin, against closed forms and minimal coordinates."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reference_solver.failures import InconsistentStart
from reference_solver.mechanism.contact_laws import FrictionLaw, RigidWall
from reference_solver.mechanism.mechanism import GROUND, Body, ClearanceJoint, Mechanism
from reference_solver.solution import Solution
from reference_solver.solver import solve
from tests.helpers.mechanism_energy import energy_residual_J, kinetic_energy_J
from tests.helpers.orders import ORDER_TOLERANCE, slope

FloatArray = NDArray[np.float64]

EPS = float(np.finfo(float).eps)
GRAVITY, MASS, INERTIA, CLEARANCE, RADIUS = 9.81, 0.1, 4e-6, 5e-4, 0.01
#: RK4 integrates a free disc exactly. A time is a position's round-off (1e-19 m) over the speed, down to
#: 2e-6 m/s before the closing: 1e-13 s; sums of a hundred flights stay an order below what is asked.
CLOSED_FORM = 1e-12
#: A speed is a product of a few numbers, its relative error a few units in the last place for each of up to a
#: hundred impacts, and the times' error times gravity.
SPEED = 1e-12
#: A product of a few numbers.
ROUND_OFF = 64 * EPS


def disc(joint: ClearanceJoint, gravity: float = 0.0) -> Mechanism:
    """Return a disc with a pin in a bearing, and otherwise free."""
    return Mechanism((Body(MASS, INERTIA),), (), (), gravity, (joint,))


def in_bearing(
    restitution: float, friction: float = 0.0, clearance: float = CLEARANCE, radius: float = RADIUS
) -> ClearanceJoint:
    """Return the joint of the disc in a fixed bearing about the origin."""
    law = FrictionLaw("tanh", friction, 0.01) if friction else None
    wall = RigidWall(restitution)
    return ClearanceJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0), clearance, radius, wall, law)


def run(
    mechanism: Mechanism,
    q: list[float],
    v: list[float],
    end: float,
    steps: int,
    samples: int = 10,
    compiled: bool = False,
) -> Solution:
    """Return the run whose longest step is the end's part of so many."""
    start = np.array(q), np.array(v)
    return solve(mechanism, *start, end_time_s=end, samples=samples, step=end / steps, compiled=compiled)


def close(found: object, expected: object, tolerance: float, what: str) -> None:
    difference = np.abs(np.asarray(found) - np.asarray(expected)).max()
    assert difference <= tolerance, f"{what}: off by {difference:.2e}, allowed {tolerance:.1e}"


@pytest.mark.parametrize("compiled", [False, True], ids=["readable", "compiled"])
def test_a_pin_without_gravity_crosses_its_bearing_at_the_closed_form_times(compiled: bool) -> None:
    e, speed = 0.9, 0.01
    found = run(disc(in_bearing(e)), [0.0] * 3, [speed, 0.0, 0.0], 2.0, 100, compiled=compiled)
    k = np.arange(len(found.impacts))
    assert len(k) == 11
    # c/v to the wall, then a diameter 2c at the speed e^k v.
    times = CLEARANCE / speed + np.concatenate([[0], np.cumsum(2 * CLEARANCE / (speed * e ** k[1:]))])
    close([i.time_s for i in found.impacts], times, CLOSED_FORM, "times in s")
    close([i.approach_speed_m_s for i in found.impacts], speed * e**k, SPEED * speed, "approach in m/s")
    for impact in found.impacts:
        exact = (1 - e**2) / 2 * impact.approach_speed_m_s**2 * MASS
        assert impact.energy_lost_J == pytest.approx(exact, rel=ROUND_OFF)
        assert impact.effective_mass_kg == pytest.approx(MASS, rel=ROUND_OFF)
        assert impact.kind == "impact"
    kinetic = kinetic_energy_J(found.mechanism, found.v)[0]
    close(energy_residual_J(found), 0.0, SPEED * kinetic, "ledger in J")
    assert not found.closed.any()
    assert not found.joint_force_N.any()


def test_the_bounces_under_gravity_converge_in_closed_form_and_end_at_rest_on_the_wall() -> None:
    e, end, steps = 0.6, 0.3, 1000
    found = run(disc(in_bearing(e), GRAVITY), [0.0] * 3, [0.0] * 3, end, steps)
    speed, fall = np.sqrt(2 * GRAVITY * CLEARANCE), np.sqrt(2 * CLEARANCE / GRAVITY)
    k = np.arange(len(found.impacts))
    flights = 2 * speed * e ** (k + 1) / GRAVITY  # after impact k
    close(
        [i.time_s for i in found.impacts],
        fall + np.concatenate([[0], np.cumsum(flights[:-1])]),
        CLOSED_FORM,
        "times",
    )
    close([i.approach_speed_m_s for i in found.impacts], speed * e**k, CLOSED_FORM * GRAVITY, "approach")
    # The rule: the last impact is the first whose next flight is below a thousandth of the step.
    closing = int(np.argmax(flights < 1e-3 * end / steps))
    assert [i.kind for i in found.impacts] == ["impact"] * closing + ["closing"]
    last = found.impacts[-1]
    assert last.energy_lost_J == pytest.approx(MASS * last.approach_speed_m_s**2 / 2, rel=ROUND_OFF)
    assert found.sums["closing0"][-1] == last.energy_lost_J
    # All that was lost is the fall through c.
    fallen = MASS * GRAVITY * CLEARANCE
    close(found.sums["impact0"][-1] + found.sums["closing0"][-1], fallen, SPEED * fallen, "losses in J")
    close(energy_residual_J(found), 0.0, SPEED * fallen, "ledger in J")
    rest = found.time_s > last.time_s
    assert found.closed[:, 0].tolist() == rest.tolist()
    close(found.joint_force_N[rest], [[0.0, MASS * GRAVITY]], ROUND_OFF * MASS * GRAVITY, "weight in N")
    close(found.q[rest, :2], [0.0, -CLEARANCE], ROUND_OFF * CLEARANCE, "place at rest in m")
    assert [change.following for change in found.mode_changes] == [(0,)]


def test_a_graze_within_one_step_is_not_missed_and_a_near_miss_is_none() -> None:
    # Thrown upwards off centre, the pin peaks between two ends of steps, past or short of the wall.
    for height, hits in ((1.0 + 1e-9, True), (1.0 - 1e-9, False)):
        apex = height * CLEARANCE
        rise = np.sqrt(2 * apex / GRAVITY)
        end = 1.9 * rise
        found = run(disc(in_bearing(0.5), GRAVITY), [0.0] * 3, [0.0, GRAVITY * rise, 0.0], end, 10)
        assert (len(found.impacts) > 0) == hits, f"apex at {height} c: {found.impacts}"
        if hits:
            speed = np.sqrt(2 * GRAVITY * (apex - CLEARANCE))
            # The speed at a depth of 1e-9 c is the square root of a difference: half of its digits are lost.
            assert found.impacts[0].approach_speed_m_s == pytest.approx(speed, rel=1e-6)
            assert found.impacts[0].time_s == pytest.approx(rise - speed / GRAVITY, abs=CLOSED_FORM)


@pytest.mark.parametrize("speed", [1e-14, 1e-17])
def test_a_pin_slower_than_round_off_is_not_waited_for(speed: float) -> None:
    # In a step it moves by less than the spacing of its coordinate, so that by its gaps it stands.
    start, end = [0.6 * CLEARANCE, 0.2 * CLEARANCE, 0.0], 1e-3
    found = run(disc(in_bearing(0.6)), start, [-speed, 0.0, 0.0], end, 100, compiled=True)
    close(found.q[-1], start, speed * end + ROUND_OFF * CLEARANCE, "place in m")
    assert found.steps <= 200


def test_a_pin_that_leaves_its_wall_without_speed_flies_to_where_the_parabola_meets_it() -> None:
    # The last of these leaves at a rate of a round-off. Where N = 0, at an angle a, v^2 = g c sin(a), and the
    # parabola from there is back on the circle after 4 v cos(a)/g. By g, which goes with the time's third
    # power, round-off hides 1e-7 s of it.
    mechanism, step = disc(in_bearing(0.0), GRAVITY), 1.4865178470685122e-06
    for speed in (*np.linspace(0.11, 0.15, 40), 0.14734494970783482):
        q, v = np.array([0.0, -CLEARANCE, 0.0]), np.array([speed, 0.0, 0.0])
        found = solve(mechanism, q, v, end_time_s=0.03, samples=1, step=step)
        sine = (speed**2 / (GRAVITY * CLEARANCE) - 2) / 3
        flight = 4 * np.sqrt(CLEARANCE / GRAVITY * sine * (1 - sine**2))
        left = next(change.time_s for change in found.mode_changes if not change.following)
        hit = next(impact.time_s for impact in found.impacts if impact.time_s > left)
        assert hit - left == pytest.approx(flight, rel=1e-6), f"started at {speed} m/s"


LONG = 0.05  # m: a clearance in which a pin slides like a pendulum
WIDE = 0.2  # m: its bearing


def pendulum(angle: float, rate: float, times: FloatArray) -> FloatArray:
    """Return angle from straight down and rate (n, 2) of a pendulum of length ``LONG``."""
    solution = solve_ivp(
        lambda _, y: [y[1], -GRAVITY / LONG * np.sin(y[0])],
        (0.0, times[-1]),
        [angle, rate],
        "DOP853",
        t_eval=times,
        rtol=1e-13,
        atol=1e-14,
    )
    return np.asarray(solution.y.T)


def test_a_pin_slides_along_its_wall_as_a_pendulum_at_order_four() -> None:
    angle, end, counts = 1.2, 1.0, [2000, 4000, 8000]
    truth = pendulum(angle, 0.0, np.linspace(0, end, 11))
    place = LONG * np.column_stack([np.sin(truth[:, 0]), -np.cos(truth[:, 0])])
    tension = MASS * (GRAVITY * np.cos(truth[:, 0]) + LONG * truth[:, 1] ** 2)
    force = -(tension / LONG)[:, None] * place
    errors: dict[str, list[float]] = {"place": [], "force": []}
    for count in counts:
        found = run(
            disc(in_bearing(0.5, 0.0, LONG, WIDE), GRAVITY),
            [*place[0], 0.0],
            [0.0] * 3,
            end,
            count,
            compiled=True,
        )
        assert found.closed.all()
        assert not found.impacts
        errors["place"].append(float(np.abs(found.q[:, :2] - place).max()))
        errors["force"].append(float(np.abs(found.joint_force_N[:, 0] - force).max()))
    for name, values in errors.items():
        order = -slope(counts, values)
        assert abs(order - 4) < ORDER_TOLERANCE, f"{name}: order {order:.3f} of {values}"


def test_a_pin_thrown_up_its_wall_leaves_where_the_closed_form_says_and_falls_back_on_a_parabola() -> None:
    # Without pressure m v^2/c + m g cos(theta) = 0 and v^2 = v0^2 - 2 g c (1 - cos(theta)).
    speed = np.sqrt(3.5 * GRAVITY * LONG)
    leaving = np.arccos((2 * GRAVITY * LONG - speed**2) / (3 * GRAVITY * LONG))
    times = np.linspace(0.0, 0.2, 2001)
    angles = pendulum(0.0, speed / LONG, times)[:, 0]
    reached = float(np.interp(leaving, angles, times))
    for _ in range(4):  # Newton's method on the independent pendulum
        angle, rate = pendulum(0.0, speed / LONG, np.array([0.0, reached]))[-1]
        reached -= (angle - leaving) / rate
    # From there a parabola, back to the circle: |d|^2 = c^2 is a quartic in time with a triple root at 0.
    sideways = np.sqrt(-GRAVITY * LONG * np.cos(leaving))
    fall = 4 * sideways * np.sin(leaving) / GRAVITY
    counts, errors = [150, 300, 600], []
    for count in counts:
        found = run(
            disc(in_bearing(0.5, 0.0, LONG, WIDE), GRAVITY),
            [0.0, -LONG, 0.0],
            [speed, 0.0, 0.0],
            0.3,
            count,
        )
        assert [c.following for c in found.mode_changes[:2]] == [(0,), ()]
        leave, back = found.mode_changes[1].time_s, found.impacts[0].time_s
        errors.append(abs(leave - reached))
        assert abs(back - reached - fall) < 20 * errors[-1] + CLOSED_FORM, (
            f"back {back - reached - fall:.1e} s late"
        )
    assert errors[-1] < 1e-8, f"leaves {errors[-1]:.1e} s off"  # measured 2e-11
    order = -slope(counts, errors)
    # The end of a cut step adds its own, irregular part to the error: order 4 is a bound here.
    assert order > 3.5, f"order {order:.2f} of {errors}"


@pytest.mark.parametrize(("friction", "sticks"), [(0.5, True), (0.01, False)])
def test_a_spinning_disc_gets_the_closed_form_tangential_impulse(friction: float, sticks: bool) -> None:
    e, speed, across, spin = 0.7, 0.3, 0.1, -4.0
    found = run(disc(in_bearing(e, friction)), [0.0] * 3, [speed, across, spin], CLEARANCE / speed * 1.3, 10)
    assert len(found.impacts) == 1
    impact = found.impacts[0]
    angle = np.arctan2(across, speed)
    arm, approach = RADIUS - CLEARANCE, np.hypot(speed, across)
    assert impact.approach_speed_m_s == pytest.approx(approach, rel=ROUND_OFF)
    normal = (1 + e) * MASS * approach
    sliding = spin * arm  # through the centre the pin hits head on: only its spin slides
    stick = -sliding / (1 / MASS + arm**2 / INERTIA)
    assert (abs(stick) <= friction * normal) == sticks
    tangential = stick if sticks else -friction * normal * np.sign(sliding)
    assert impact.normal_impulse_N_s == pytest.approx(normal, rel=ROUND_OFF)
    assert impact.tangential_impulse_N_s == pytest.approx(tangential, rel=ROUND_OFF)
    n = np.array([np.cos(angle), np.sin(angle)])
    t = np.array([-n[1], n[0]])
    after = -e * approach * n + tangential / MASS * t
    expected = [*after, spin + arm * tangential / INERTIA]
    close(found.v[-1], expected, ROUND_OFF * abs(spin), "velocities after")
    remaining = sliding + tangential * (1 / MASS + arm**2 / INERTIA)
    lost = (1 - e**2) / 2 * MASS * approach**2 - tangential * (sliding + remaining) / 2
    assert impact.energy_lost_J == pytest.approx(lost, rel=ROUND_OFF)
    close(
        energy_residual_J(found),
        0.0,
        ROUND_OFF * kinetic_energy_J(found.mechanism, found.v)[0],
        "ledger in J",
    )


def test_a_slow_approach_closes_without_rebound() -> None:
    joint = ClearanceJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0), CLEARANCE, RADIUS, RigidWall(0.9, 0.02))
    found = run(disc(joint, GRAVITY), [0.0, -0.99 * CLEARANCE, 0.0], [0.0] * 3, 0.1, 100)
    assert [i.kind for i in found.impacts] == ["closing"]
    assert found.closed[-1, 0]


def test_a_pin_outside_its_bearing_is_refused() -> None:
    with pytest.raises(InconsistentStart, match=r"contacts\[0\]: expected the pin inside its bearing"):
        run(disc(in_bearing(0.5)), [1.01 * CLEARANCE, 0.0, 0.0], [0.0] * 3, 1.0, 10)


@pytest.mark.parametrize(("field", "value"), [("radial_clearance_m", RADIUS), ("bearing_radius_m", -1.0)])
def test_a_malformed_joint_is_refused_by_field(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"ClearanceJoint.{field}"):
        replace(in_bearing(0.5), **{field: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(("field", "value"), [("restitution", 1.1), ("minimum_impact_speed_m_s", -1.0)])
def test_a_malformed_wall_is_refused_by_field(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"RigidWall.{field}"):
        RigidWall(**({"restitution": 0.5} | {field: value}))
