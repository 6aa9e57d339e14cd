"""What a user of the solver gives wrongly is refused in one line that names it, before anything runs."""

from collections.abc import Callable
from dataclasses import replace
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


def run(**changes: Any) -> object:
    """Run a pendulum at rest with something else than it should have; as Python numbers, to be quick."""
    asked: dict[str, Any] = {"q": STILL, "v": STILL, "end_time_s": 0.1, "samples": 2, "step": 0.01} | changes
    return solve(PENDULUM, asked.pop("q"), asked.pop("v"), compiled=False, **asked)


def with_part(part: Any) -> Mechanism:
    return replace(PENDULUM, loads=(part,))


def joint(**changes: Any) -> ClearanceJoint:
    given: dict[str, Any] = {"radial_clearance_m": 1e-3, "bearing_radius_m": 0.01, "law": RigidWall(0.5)}
    return ClearanceJoint(GROUND, AT, 0, AT, **given | changes)


BAD: list[tuple[Callable[[], object], str]] = [
    (lambda: run(q=np.zeros(4)), "q: expected 3 finite numbers, got the shape (4,)"),
    (lambda: run(q=np.zeros((1, 3))), "q: expected 3 finite numbers, got the shape (1, 3)"),
    (lambda: run(v=[0.0, "fast", 0.0]), "v: expected 3 finite numbers, got others"),
    (lambda: run(v=[0.0, nan, 0.0]), f"v[1]: expected {FINITE}, got nan"),
    (lambda: run(end_time_s=0.0), f"end_time_s: expected {POSITIVE}, got 0.0"),
    (lambda: run(end_time_s=inf), f"end_time_s: expected {POSITIVE}, got inf"),
    (lambda: run(end_time_s="1"), f'end_time_s: expected {POSITIVE}, got "1"'),
    (lambda: run(samples=0), "samples: expected an integer >= 1, got 0"),
    (lambda: run(samples=2.0), "samples: expected an integer >= 1, got 2.0"),
    (lambda: run(samples=True), "samples: expected an integer >= 1, got True"),
    (lambda: run(step=0.0), f"StepChoice.longest_s: expected {POSITIVE}, got 0.0"),
    (lambda: run(step=-1e-5), f"StepChoice.longest_s: expected {POSITIVE}, got -1e-05"),
    (lambda: run(step=None), f"StepChoice.longest_s: expected {POSITIVE}, got None"),
    (
        lambda: run(stabilisation="baumgarte"),
        'stabilisation: expected none, projection or Baumgarte\'s gains, got "baumgarte"',
    ),
    (
        lambda: Solver(PENDULUM, np.zeros(2), StepChoice(0.1), compiled=False),
        "q_start: expected 3 finite numbers, got the shape (2,)",
    ),
    (
        lambda: Solver(PENDULUM, STILL, StepChoice(0.1), compiled=False).run(STILL, STILL, -1.0, 1),
        f"end_time_s: expected {POSITIVE}, got -1.0",
    ),
    (lambda: StepChoice(1e-5, 0.0), f"StepChoice.steps_per_contact: expected {POSITIVE}, got 0.0"),
    (
        lambda: StepChoice(1e-5, lowest_flight=1.0),
        "StepChoice.lowest_flight: expected a finite number >= 2 or None, got 1.0",
    ),
    (
        lambda: ErrorControl(1e-9, lowest_flight=nan),
        "ErrorControl.lowest_flight: expected a finite number >= 2 or None, got nan",
    ),
    (
        lambda: StepChoice(1e-5, closing_flight_fraction=-1.0),
        f"StepChoice.closing_flight_fraction: expected {POSITIVE}, got -1.0",
    ),
    (lambda: ErrorControl(0.0), "ErrorControl.tolerance: expected a finite number > 0 and < 1, got 0.0"),
    (lambda: ErrorControl(1.0), "ErrorControl.tolerance: expected a finite number > 0 and < 1, got 1.0"),
    (lambda: ErrorControl(nan), "ErrorControl.tolerance: expected a finite number > 0 and < 1, got nan"),
    (lambda: ErrorControl(1e-9, 0.0), "ErrorControl.longest_s: expected a number > 0, got 0.0"),
    (lambda: ErrorControl(1e-9, nan), "ErrorControl.longest_s: expected a number > 0, got nan"),
    (lambda: Baumgarte(-1.0, 1.0), f"Baumgarte.alpha_s: expected {NOT_NEGATIVE}, got -1.0"),
    (lambda: Baumgarte(1.0, nan), f"Baumgarte.beta_s: expected {NOT_NEGATIVE}, got nan"),
    (lambda: Body(0.0, 1.0), f"Body.mass_kg: expected {POSITIVE}, got 0.0"),
    (lambda: Body(1.0, -1.0), f"Body.inertia_kg_m2: expected {POSITIVE}, got -1.0"),
    (lambda: Body("1", 1.0), f'Body.mass_kg: expected {POSITIVE}, got "1"'),  # type: ignore[arg-type]
    (lambda: Mechanism((), ()), "bodies: expected at least one body, got none"),
    (lambda: Mechanism((BODY,), (), gravity_m_s2=nan), f"gravity_m_s2: expected {FINITE}, got nan"),
    (
        lambda: Mechanism((BODY,), (RevoluteJoint(GROUND, (0.0, inf), 0, AT),)),
        f"RevoluteJoint.point_i[1]: expected {FINITE}, got inf",
    ),
    (
        lambda: Mechanism((BODY,), (RevoluteJoint(GROUND, AT, 0, (0.0,)),)),  # type: ignore[arg-type]
        "RevoluteJoint.point_j: expected two finite numbers, got (0.0,)",
    ),
    (
        lambda: Mechanism((BODY,), (RevoluteJoint(GROUND, AT, 1, AT),)),
        "RevoluteJoint.body_j: expected a body index from -1 to 0, got 1",
    ),
    (
        lambda: Mechanism((BODY,), (SameAngle(GROUND, 1),)),
        "SameAngle.body_j: expected a body index from -1 to 0, got 1",
    ),
    (
        lambda: Mechanism((BODY,), (Slot(GROUND, AT, 0, AT, nan),)),
        f"Slot.angle_rad: expected {FINITE}, got nan",
    ),
    (
        lambda: Mechanism((BODY,), (PrescribedSpeed(0, inf),)),
        f"PrescribedSpeed.speed_rad_s: expected {FINITE}, got inf",
    ),
    (
        lambda: Mechanism((BODY,), (PrescribedMotion(0, Ramp(nan, 1.0, 1.0)),)),
        f"PrescribedMotion.motion.first: expected {FINITE}, got nan",
    ),
    (lambda: Ramp(0.0, 1.0, 0.0), f"Ramp.duration_s: expected {POSITIVE}, got 0.0"),
    (lambda: Fluctuation(0.0, 1.0, 0.0), f"Fluctuation.frequency_rad_s: expected {POSITIVE}, got 0.0"),
    (lambda: with_part(Torque(0, nan)), f"Torque.torque_N_m: expected {FINITE}, got nan"),
    (
        lambda: with_part(Torque(0.5, 1.0)),  # type: ignore[arg-type]
        "Torque.body: expected a body index from 0 to 0, got 0.5",
    ),
    (
        lambda: MotorTorque(0, 1.0, 0.0),
        "MotorTorque.no_load_speed_rad_s: expected a finite number other than 0, got 0.0",
    ),
    (
        lambda: with_part(ConstantForce(GROUND, AT, 0, AT, 0.0, -inf)),
        f"ConstantForce.force_N: expected {FINITE}, got -inf",
    ),
    (
        lambda: with_part(SpringDamper(GROUND, AT, 0, AT, nan, 0.0, 0.0)),
        f"SpringDamper.stiffness_N_m: expected {FINITE}, got nan",
    ),
    (
        lambda: with_part(
            GasForce(GROUND, AT, 0, AT, 0.0, 3, PiecewiseCubic((0.0, 1.0, 0.0, 0.0, 0.0), 1.0))
        ),
        "GasForce.crank: expected a body index from 0 to 0, got 3",
    ),
    (
        lambda: TorqueByTime(0, PiecewiseCubic((0.0, 1.0, 0.0, 0.0, 0.0), 1.0)),
        "TorqueByTime.torque_N_m.period: expected 0, got 1.0",
    ),
    (
        lambda: Mechanism((BODY,), (SameAngle(GROUND, 0),), names=("O", "A")),
        "names: expected as many as there are constraints (1) or none, got 2",
    ),
    (lambda: PiecewiseCubic(()), "PiecewiseCubic.rows: expected 5 numbers for each piece, got 0"),
    (lambda: PiecewiseCubic((0.0, 1.0)), "PiecewiseCubic.rows: expected 5 numbers for each piece, got 2"),
    (
        lambda: PiecewiseCubic((1.0, 0.0, 0.0, 0.0, 0.0) * 2),
        "PiecewiseCubic.rows[5]: expected a number > 1, where the piece before begins, got 1.0",
    ),
    (lambda: joint(bearing_radius_m=0.0), f"ClearanceJoint.bearing_radius_m: expected {POSITIVE}, got 0.0"),
    (
        lambda: joint(radial_clearance_m=0.02),
        "ClearanceJoint.radial_clearance_m: expected a number < bearing_radius_m = 0.01, got 0.02",
    ),
    (
        lambda: RigidWall(nan),
        "RigidWall.restitution: expected a finite number >= 0 and <= 1, got nan",
    ),
    (lambda: ContactLaw(0.0), f"ContactLaw.stiffness: expected {POSITIVE}, got 0.0"),
    (lambda: ContactLaw(1e9, 0.5), "ContactLaw.exponent: expected a finite number >= 1, got 0.5"),
    (
        lambda: ContactLaw(1e9, damping_factor=-1.0),
        f"ContactLaw.damping_factor: expected {NOT_NEGATIVE}, got -1.0",
    ),
    (
        lambda: ContactLaw(1e9, minimum_impact_speed_m_s=-1.0),
        f"ContactLaw.minimum_impact_speed_m_s: expected {NOT_NEGATIVE}, got -1.0",
    ),
    (
        lambda: ContactLaw(1e9, kind="elastic"),
        'ContactLaw.kind: expected dissipative or kuwabara-kono, got "elastic"',
    ),
    (
        lambda: FrictionLaw("sticky", 0.1, 1e-3),  # type: ignore[arg-type]
        'FrictionLaw.kind: expected saturated-linear or ambrosio or tanh, got "sticky"',
    ),
    (lambda: FrictionLaw("tanh", -0.1, 1e-3), f"FrictionLaw.coefficient: expected {NOT_NEGATIVE}, got -0.1"),
    (
        lambda: FrictionLaw("ambrosio", 0.1, 1e-3, 1e-3),
        "FrictionLaw.dead_band_speed_m_s: expected a number < regularisation_speed_m_s = 0.001, got 0.001",
    ),
]


@pytest.mark.parametrize(("call", "line"), BAD, ids=[line.split(",")[0] for _, line in BAD])
def test_what_is_given_wrongly_is_refused_in_one_line(call: Callable[[], object], line: str) -> None:
    with pytest.raises(ValueError) as refusal:  # noqa: PT011  the whole line is compared
        call()
    assert str(refusal.value) == line


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
