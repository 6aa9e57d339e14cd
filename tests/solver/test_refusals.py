"""What a user of the solver gives wrongly is refused in one line that names it, before anything runs."""

from collections.abc import Callable
from functools import partial
from math import inf, nan
from typing import Any

import numpy as np
import pytest

from reference_solver.equations import Baumgarte
from reference_solver.mechanism.contact_laws import ContactLaw, FrictionLaw, RigidWall
from reference_solver.mechanism.mechanism import (
    GROUND,
    Body,
    ClearanceJoint,
    ConstantForce,
    GasForce,
    MasslessLink,
    Mechanism,
    MotorTorque,
    PrescribedMotion,
    PrescribedSpeed,
    RevoluteJoint,
    SameAngle,
    Slot,
    SpringDamper,
    Torque,
    TorqueByTime,
)
from reference_solver.mechanism.motions import Fluctuation, Ramp
from reference_solver.mechanism.tables import PiecewiseCubic
from reference_solver.solver import ErrorControl, Solver, StepChoice, solve

BODY, AT = Body(1.0, 1.0), (0.0, 0.0)
PENDULUM = Mechanism((BODY,), (RevoluteJoint(GROUND, AT, 0, AT),), gravity_m_s2=9.81)
STILL = np.zeros(3)
FINITE, POSITIVE, NOT_NEGATIVE = "a finite number", "a finite number > 0", "a finite number >= 0"
PART, FLIGHT = "a finite number > 0 and < 1", "a finite number >= 2 or None"
GAINS, INDEX = "none, projection or Baumgarte's gains", "a body index from -1 to 0"
BODY_INDEX = "a body index from 0 to 0"
NAMES = "as many as there are constraints (1) or none"
PIECES, RISING = "5 numbers for each piece", "a number > 1, where the piece before begins"
INSIDE, SLOWER = "a number < bearing_radius_m = 0.01", "a number < regularisation_speed_m_s = 0.001"
KINDS = "saturated-linear or ambrosio or tanh"


def run(**changes: Any) -> object:
    """Run a pendulum at rest with something else than it should have; as Python numbers, to be quick."""
    asked: dict[str, Any] = {"q": STILL, "v": STILL, "end_time_s": 0.1, "samples": 2, "step": 0.01} | changes
    return solve(PENDULUM, asked.pop("q"), asked.pop("v"), **asked)


def joint(**changes: Any) -> ClearanceJoint:
    given: dict[str, Any] = {"radial_clearance_m": 1e-3, "bearing_radius_m": 0.01, "law": RigidWall(0.5)}
    return ClearanceJoint(GROUND, AT, 0, AT, **given | changes)


law = partial(ContactLaw, 1e9)
TABLE, LINE = PiecewiseCubic((0.0, 1.0, 0.0, 0.0, 0.0), 1.0), (GROUND, AT, 0, AT)


def made(*constraints: Any, loads: tuple[Any, ...] = (), **more: Any) -> Mechanism:
    return Mechanism((BODY,), constraints, loads, **more)


def kept(step: StepChoice) -> Solver:
    return Solver(PENDULUM, STILL, step)


#: Fields, what is expected of them, what is given, and in what call.
BAD: list[tuple[str, str, str, Callable[[], object]]] = [
    ("q", "3 finite numbers", "the shape (4,)", lambda: run(q=np.zeros(4))),
    ("q", "3 finite numbers", "the shape (1, 3)", lambda: run(q=np.zeros((1, 3)))),
    ("v", "3 finite numbers", "others", lambda: run(v=[0.0, "fast", 0.0])),
    ("v[1]", FINITE, "nan", lambda: run(v=[0.0, nan, 0.0])),
    ("end_time_s", POSITIVE, "0.0", lambda: run(end_time_s=0.0)),
    ("end_time_s", POSITIVE, "inf", lambda: run(end_time_s=inf)),
    ("end_time_s", POSITIVE, '"1"', lambda: run(end_time_s="1")),
    ("end_time_s", POSITIVE, "-1.0", lambda: kept(StepChoice(0.1)).run(STILL, STILL, -1.0, 1)),
    ("samples", "an integer >= 1", "0", lambda: run(samples=0)),
    ("samples", "an integer >= 1", "2.0", lambda: run(samples=2.0)),
    ("samples", "an integer >= 1", "True", lambda: run(samples=True)),
    ("StepChoice.longest_s", POSITIVE, "0.0", lambda: run(step=0.0)),
    ("StepChoice.longest_s", POSITIVE, "-1e-05", lambda: run(step=-1e-5)),
    ("StepChoice.longest_s", POSITIVE, "None", lambda: run(step=None)),
    ("stabilisation", GAINS, '"baumgarte"', lambda: run(stabilisation="baumgarte")),
    ("q_start", "3 finite numbers", "the shape (2,)", lambda: Solver(PENDULUM, np.zeros(2), StepChoice(0.1))),
    ("StepChoice.steps_per_contact", POSITIVE, "0.0", lambda: StepChoice(1e-5, 0.0)),
    ("StepChoice.lowest_flight", FLIGHT, "1.0", lambda: StepChoice(1e-5, lowest_flight=1.0)),
    ("StepChoice.closing_flight_fraction", POSITIVE, "-1.0", lambda: StepChoice(1e-5, 400, True, -1.0)),
    ("ErrorControl.lowest_flight", FLIGHT, "nan", lambda: ErrorControl(1e-9, lowest_flight=nan)),
    ("ErrorControl.tolerance", PART, "0.0", lambda: ErrorControl(0.0)),
    ("ErrorControl.tolerance", PART, "1.0", lambda: ErrorControl(1.0)),
    ("ErrorControl.tolerance", PART, "nan", lambda: ErrorControl(nan)),
    ("ErrorControl.longest_s", "a number > 0", "0.0", lambda: ErrorControl(1e-9, 0.0)),
    ("ErrorControl.longest_s", "a number > 0", "nan", lambda: ErrorControl(1e-9, nan)),
    ("Baumgarte.alpha_s", NOT_NEGATIVE, "-1.0", lambda: Baumgarte(-1.0, 1.0)),
    ("Baumgarte.beta_s", NOT_NEGATIVE, "nan", lambda: Baumgarte(1.0, nan)),
    ("Body.mass_kg", POSITIVE, "0.0", lambda: Body(0.0, 1.0)),
    ("Body.inertia_kg_m2", POSITIVE, "-1.0", lambda: Body(1.0, -1.0)),
    ("Body.mass_kg", POSITIVE, '"1"', lambda: Body("1", 1.0)),  # type: ignore[arg-type]
    ("bodies", "at least one body", "none", lambda: Mechanism((), ())),
    ("gravity_m_s2", FINITE, "nan", lambda: made(gravity_m_s2=nan)),
    ("RevoluteJoint.point_i[1]", FINITE, "inf", lambda: made(RevoluteJoint(GROUND, (0.0, inf), 0, AT))),
    ("Slot.point_j", "two finite numbers", "()", lambda: made(Slot(GROUND, AT, 0, (), 1.0))),  # type: ignore[arg-type]
    ("RevoluteJoint.body_j", INDEX, "1", lambda: made(RevoluteJoint(GROUND, AT, 1, AT))),
    ("SameAngle.body_j", INDEX, "1", lambda: made(SameAngle(GROUND, 1))),
    ("Slot.angle_rad", FINITE, "nan", lambda: made(Slot(*LINE, nan))),
    ("MasslessLink.length_m", POSITIVE, "0.0", lambda: MasslessLink(*LINE, 0.0)),
    ("PrescribedSpeed.speed_rad_s", FINITE, "inf", lambda: made(PrescribedSpeed(0, inf))),
    ("PrescribedMotion.motion.first", FINITE, "nan", lambda: made(PrescribedMotion(0, Ramp(nan, 1.0, 1.0)))),
    ("Ramp.duration_s", POSITIVE, "0.0", lambda: Ramp(0.0, 1.0, 0.0)),
    ("Fluctuation.frequency_rad_s", POSITIVE, "0.0", lambda: Fluctuation(0.0, 1.0, 0.0)),
    ("Torque.torque_N_m", FINITE, "nan", lambda: made(loads=(Torque(0, nan),))),
    ("Torque.body", BODY_INDEX, "0.5", lambda: made(loads=(Torque(0.5, 1.0),))),  # type: ignore[arg-type]
    ("MotorTorque.no_load_speed_rad_s", f"{FINITE} other than 0", "0.0", lambda: MotorTorque(0, 1.0, 0.0)),
    ("ConstantForce.force_N", FINITE, "-inf", lambda: made(loads=(ConstantForce(*LINE, 0.0, -inf),))),
    ("SpringDamper.stiffness_N_m", FINITE, "nan", lambda: made(loads=(SpringDamper(*LINE, nan, 0.0, 0.0),))),
    ("GasForce.crank", BODY_INDEX, "3", lambda: made(loads=(GasForce(*LINE, 0.0, 3, TABLE),))),
    ("TorqueByTime.torque_N_m.period", "0", "1.0", lambda: TorqueByTime(0, TABLE)),
    ("names", NAMES, "2", lambda: made(SameAngle(GROUND, 0), names=("O", "A"))),
    ("PiecewiseCubic.rows", PIECES, "0", lambda: PiecewiseCubic(())),
    ("PiecewiseCubic.rows", PIECES, "2", lambda: PiecewiseCubic((0.0, 1.0))),
    ("PiecewiseCubic.rows[5]", RISING, "1.0", lambda: PiecewiseCubic((1.0, 0.0, 0.0, 0.0, 0.0) * 2)),
    ("ClearanceJoint.bearing_radius_m", POSITIVE, "0.0", lambda: joint(bearing_radius_m=0.0)),
    ("ClearanceJoint.radial_clearance_m", INSIDE, "0.02", lambda: joint(radial_clearance_m=0.02)),
    ("RigidWall.restitution", "a finite number >= 0 and <= 1", "nan", lambda: RigidWall(nan)),
    ("RigidWall.minimum_impact_speed_m_s", NOT_NEGATIVE, "-1.0", lambda: RigidWall(0.5, -1.0)),
    ("ContactLaw.stiffness", POSITIVE, "0.0", lambda: ContactLaw(0.0)),
    ("ContactLaw.exponent", "a finite number >= 1", "0.5", lambda: ContactLaw(1e9, 0.5)),
    ("ContactLaw.damping_factor", NOT_NEGATIVE, "-1.0", lambda: ContactLaw(1e9, damping_factor=-1.0)),
    ("ContactLaw.minimum_impact_speed_m_s", NOT_NEGATIVE, "-1.0", lambda: law(minimum_impact_speed_m_s=-1.0)),
    ("ContactLaw.kind", "dissipative or kuwabara-kono", '"elastic"', lambda: ContactLaw(1e9, kind="elastic")),
    ("FrictionLaw.kind", KINDS, '"sticky"', lambda: FrictionLaw("sticky", 0.1, 1e-3)),  # type: ignore[arg-type]
    ("FrictionLaw.coefficient", NOT_NEGATIVE, "-0.1", lambda: FrictionLaw("tanh", -0.1, 1e-3)),
    ("FrictionLaw.regularisation_speed_m_s", POSITIVE, "0.0", lambda: FrictionLaw("tanh", 0.1, 0.0)),
    ("FrictionLaw.dead_band_speed_m_s", SLOWER, "0.001", lambda: FrictionLaw("ambrosio", 0.1, 1e-3, 1e-3)),
]


@pytest.mark.parametrize(("field", "wanted", "got", "call"), BAD, ids=[f"{row[0]}={row[2]}" for row in BAD])
def test_what_is_given_wrongly_is_refused_in_one_line(
    field: str, wanted: str, got: str, call: Callable[[], object]
) -> None:
    with pytest.raises(ValueError) as refusal:  # noqa: PT011  the whole line is compared
        call()
    assert str(refusal.value) == f"{field}: expected {wanted}, got {got}"


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"q": [0, 0, 0], "samples": np.int64(2), "step": np.float64(0.01), "end_time_s": 1},
        {"step": ErrorControl(1e-6)},
        {"stabilisation": Baumgarte(0, 0.0)},
    ],
)
def test_what_is_given_rightly_runs(changes: dict[str, Any]) -> None:
    run(**changes)
