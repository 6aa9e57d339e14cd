"""The block kernel agrees with the readable equations, keeps order four, and its work grows linearly."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from reference_solver.block_plan import make_plan
from reference_solver.block_stepper import BlockStepper
from reference_solver.contact_laws import ContactLaw
from reference_solver.equations import Baumgarte, Equations
from reference_solver.errors import NonFiniteState, SingularConfiguration
from reference_solver.mechanism import (
    GROUND,
    Body,
    ClearanceJoint,
    Mechanism,
    PrescribedSpeed,
    RevoluteJoint,
    SpringDamper,
    StraightGuide,
)
from reference_solver.readable import ReadableStepper
from reference_solver.solver import LARGEST_COMPILED, Stabilisation, make_stepper, record, solve
from tests import test_reference_kernel as small
from tests.test_reference_mechanisms import (
    ORDER_TOLERANCE,
    PENDULUM,
    PENDULUM_ANGLES,
    PENDULUM_RATES,
    oscillator,
    pendulum_mechanism,
    pendulum_start,
    slope,
)

FloatArray = NDArray[np.float64]
Start = tuple[Mechanism, FloatArray, FloatArray, float]
#: The two faces sum in different orders. Measured: up to 8 units in the last place without Baumgarte's
#: feedback, 210 in the multipliers with it, where beta^2 multiplies the round-off of coordinates near 1 m.
ROUND_OFF = 500 * float(np.finfo(float).eps)


def chain(links: int) -> Mechanism:
    """A chain of rods of 0.1 m, hung from the frame."""
    length = 0.1
    first = RevoluteJoint(GROUND, (0.0, 0.0), 0, (-length / 2, 0.0))
    joints = [RevoluteJoint(k, (length / 2, 0.0), k + 1, (-length / 2, 0.0)) for k in range(links - 1)]
    return Mechanism((Body(0.1, 1e-4),) * links, (first, *joints), gravity_m_s2=9.81)


def chain_start(angles: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return q and v of a chain from its rods' angles and their rates."""
    halves = 0.05 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    turning = rates[:, None] * np.stack([-halves[:, 1], halves[:, 0]], axis=1)
    q, v = (2 * np.cumsum(vectors, axis=0) - vectors for vectors in (halves, turning))
    return np.column_stack([q, angles]).ravel(), np.column_stack([v, rates]).ravel()


def curled_chain_case() -> Start:
    """Return a chain of 40 links in a curl, every link turning at its own rate."""
    links = np.arange(40.0)
    return chain(40), *chain_start(0.3 * links + np.sin(links), 2 * np.cos(3 * links)), 1e-3


def ring_case() -> Start:
    """Return five rods in a ring, whose elimination fills in: thrown up, turning, driven, with a spring."""
    sides, speed = 5, 3.0
    turns = 2 * np.pi * np.arange(sides) / sides
    inner, half = 0.1, 0.1 * np.tan(np.pi / sides)
    joints = [RevoluteJoint(k, (half, 0.0), (k + 1) % sides, (-half, 0.0)) for k in range(sides)]
    mechanism = Mechanism(
        tuple(Body(0.1 + 0.05 * k, 1e-4 * (k + 1)) for k in range(sides)),
        (*joints, PrescribedSpeed(2, speed)),
        (SpringDamper(0, (0.01, 0.02), 3, (0.0, 0.01), 50.0, 0.2, 0.05),),
        gravity_m_s2=9.81,
    )
    centres = inner * np.column_stack([np.cos(turns), np.sin(turns)])
    rates = speed * np.column_stack([-centres[:, 1], centres[:, 0]]) + [0.3, 2.0]
    q = np.column_stack([centres, turns + np.pi / 2])
    return mechanism, q.ravel(), np.column_stack([rates, np.full(sides, speed)]).ravel(), 1e-3


CASES: dict[str, Callable[[], Start]] = {
    **small.CASES,
    "chain of 40": curled_chain_case,
    "ring": ring_case,
}


def block_stepper(
    mechanism: Mechanism, q: FloatArray, h: float, stabilisation: Stabilisation
) -> BlockStepper:
    baumgarte = stabilisation if isinstance(stabilisation, Baumgarte) else None
    return BlockStepper(mechanism, q, h, baumgarte, stabilisation == "projection")


@pytest.mark.parametrize("stabilisation", small.VARIANTS, ids=["none", "projection", "baumgarte"])
@pytest.mark.parametrize("case", CASES)
def test_a_block_step_agrees_with_the_readable_one_to_round_off(
    case: str, stabilisation: Stabilisation
) -> None:
    mechanism, q, v, h = CASES[case]()
    readable = make_stepper(mechanism, q, h, stabilisation, compiled=False)
    assert isinstance(readable, ReadableStepper)
    found = []
    for stepper in (block_stepper(mechanism, q, h, stabilisation), readable):
        after_q, after_v = q.copy(), v.copy()
        work = stepper.advance(after_q, after_v, 3, 1)
        found.append((after_q, after_v, stepper.multipliers(0.0, q, v), np.array([work])))
    for name, one, other in zip(("q", "v", "multipliers", "work"), *found, strict=True):
        scale, difference = np.abs(other).max(), np.abs(one - other).max()
        assert difference <= ROUND_OFF * scale, f"{name}: {difference:.2e} of {scale:.2e}"
    moved = np.abs(found[0][0] - q).max()
    assert moved > 1e-5, f"the step moved nothing by more than {moved:.1e}"


def test_a_mechanism_too_large_for_straight_line_code_takes_the_block_kernel() -> None:
    for links, block in ((6, False), (LARGEST_COMPILED + 1, True)):
        q, v = chain_start(np.linspace(0, 1, links), np.linspace(1, -1, links))
        stepper = make_stepper(chain(links), q, 1e-3, "none", compiled=True)
        assert isinstance(stepper, BlockStepper) == block
        found = stepper.multipliers(0.0, q, v)
        expected = block_stepper(chain(links), q, 1e-3, "none").multipliers(0.0, q, v)
        assert np.abs(found - expected).max() <= ROUND_OFF * np.abs(expected).max()


def test_a_triple_pendulum_in_blocks_converges_at_order_four() -> None:
    end, samples, counts = 0.5, 10, [40, 80, 160]
    states = PENDULUM.motion(PENDULUM_ANGLES, PENDULUM_RATES, np.linspace(0, end, samples + 1))
    centres = np.array([PENDULUM.centres(s[:3]) for s in states])
    errors = []
    for count in counts:
        q, v = pendulum_start()
        stepper = block_stepper(pendulum_mechanism(), q, end / samples / count, "projection")
        run = record(stepper, q, v, end_time_s=end, samples=samples, steps_per_sample=count)
        errors.append(np.abs(run.q.reshape(-1, 3, 3)[:, :, :2] - centres).max())
    order = slope([end / samples / count for count in counts], errors)
    assert abs(order - 4) < ORDER_TOLERANCE, f"order {order:.3f} from errors {errors}"


@pytest.mark.parametrize("stabilisation", ["none", "projection"])
def test_a_chain_of_thirty_links_converges_at_order_four(stabilisation: Stabilisation) -> None:
    end, counts = 0.1, [200, 400, 800, 1600]
    q, v = chain_start(0.1 * np.arange(30) / 30, np.zeros(30))
    ends = [
        solve(
            chain(30),
            q,
            v,
            end_time_s=end,
            samples=1,
            steps_per_sample=count,
            stabilisation=stabilisation,
        ).q[-1]
        for count in counts
    ]
    # Differences of successive halvings fall as the error of the coarser one does.
    errors = [float(np.abs(ends[k] - ends[k + 1]).max()) for k in range(3)]
    order = slope([end / count for count in counts[:3]], errors)
    assert abs(order - 4) < ORDER_TOLERANCE, f"order {order:.3f} from differences {errors}"


def test_redundant_constraints_name_the_rank_in_blocks() -> None:
    mechanism = chain(20)
    redundant = Mechanism(mechanism.bodies, (*mechanism.constraints, mechanism.constraints[7]))
    q, v = chain_start(np.linspace(0, 1, 20), np.zeros(20))
    with pytest.raises(SingularConfiguration, match="rank 40 of 42 rows at t = 0 s") as caught:
        block_stepper(redundant, q, 1e-3, "none").multipliers(0.0, q, v)
    assert (caught.value.rank, caught.value.rows) == (40, 42)
    with pytest.raises(SingularConfiguration, match=r"rank 40 of 42 rows at t = 0\.003 s"):
        block_stepper(redundant, q, 1e-3, "projection").advance(q, v, 3, 5)


def test_a_driver_twice_on_a_body_names_the_rank_in_blocks() -> None:
    pinned = RevoluteJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0))
    wheel = Mechanism((Body(1.0, 0.5),), (pinned, PrescribedSpeed(0, 1.0), PrescribedSpeed(0, 1.0)))
    with pytest.raises(SingularConfiguration, match="rank 3 of 4"):
        block_stepper(wheel, np.zeros(3), 1e-3, "none").advance(np.zeros(3), np.array([0, 0, 1.0]), 0, 1)


def test_an_unstable_step_in_blocks_ends_in_an_error_that_says_when() -> None:
    # omega h = 10 * 0.5 is past RK4's limit of 2.8284, so the state grows until it overflows.
    q = 0.65 * np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0])
    with pytest.raises(NonFiniteState, match=r"t = .* s with step 0\.5 s"):
        block_stepper(oscillator(0.0), q, 0.5, "none").advance(q, np.zeros(3), 0, 1000)


def test_a_contact_is_refused_in_blocks() -> None:
    contact = ClearanceJoint(0, (0.0, 0.0), 1, (0.0, 0.0), 1e-4, 1e-2, ContactLaw(1e9))
    mechanism = Mechanism(chain(2).bodies, chain(2).constraints, contacts=(contact,))
    with pytest.raises(ValueError, match="contacts: expected none in the block kernel"):
        make_plan(mechanism, np.zeros(6), None)


def guided_chain(links: int) -> Mechanism:
    """A chain with a driven first rod and a block on a guide at its end, as in a crank-slider."""
    hung = chain(links)
    end = StraightGuide(links - 1, (0.0, 0.0), 0.0)
    return Mechanism(hung.bodies, (PrescribedSpeed(0, 1.0), end, *hung.constraints))


def ring(links: int) -> Mechanism:
    joints = tuple(RevoluteJoint(k, (0.1, 0.0), (k + 1) % links, (-0.1, 0.0)) for k in range(links))
    return Mechanism((Body(0.1, 1e-4),) * links, joints)


def comb(links: int) -> Mechanism:
    """A chain with one more rod hung from every link."""
    spine = chain(links)
    teeth = tuple(RevoluteJoint(k, (0.0, 0.0), links + k, (-0.05, 0.0)) for k in range(links))
    return Mechanism(spine.bodies * 2, spine.constraints + teeth)


@pytest.mark.parametrize("build", [chain, guided_chain, ring, comb])
def test_the_work_of_a_step_grows_linearly_to_200_links(build: Callable[[int], Mechanism]) -> None:
    work = []
    for links in (50, 100, 150, 200):
        mechanism = build(links)
        plan = make_plan(mechanism, np.zeros(3 * len(mechanism.bodies)), None)
        work.append([len(records) for records in (plan.ends, plan.pairs, plan.blocks, plan.updates)])
    growth = np.diff(work, axis=0)
    assert (growth == growth[0]).all(), f"ends, pairs, blocks and eliminations of 50 to 200 links: {work}"
    assert growth[0].max() <= 50 * 10, f"by 50 links more: {growth[0]}"


def test_the_elimination_of_a_chain_fills_nothing_in() -> None:
    plan = make_plan(chain(200), np.zeros(600), None)
    assert (len(plan.blocks), len(plan.updates)) == (200 + 199, 199)
    assert len(Equations(chain(200), np.zeros(600)).C) == 400
