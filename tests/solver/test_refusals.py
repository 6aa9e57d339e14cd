"""What a user of the solver gives wrongly is refused in one line that names it, before anything runs."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from math import inf, nan
from typing import Any

import numpy as np
import pytest

from reference_solver.equations import Baumgarte
from reference_solver.mechanism.contact_laws import ContactLaw, FrictionLaw, RigidWall
from reference_solver.mechanism.mechanism import GROUND, Body, Mechanism, RevoluteJoint, SameAngle
from reference_solver.mechanism.motions import Ramp
from reference_solver.mechanism.tables import PiecewiseCubic
from reference_solver.solver import ErrorControl, StepChoice, solve
from tests.solver.pins import bearing
from tests.solver.random_mechanisms import CONSTRAINTS, LOADS, part

BODY, STILL = Body(1.0, 1.0), np.zeros(3)
POSITIVE, NOT_NEGATIVE = "a finite number > 0", "a finite number >= 0"


def run(**changes: Any) -> object:
    """Run a pendulum at rest with something else than it should have."""
    pendulum = Mechanism((BODY,), (RevoluteJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0)),))
    asked: dict[str, Any] = {"q": STILL, "v": STILL, "end_time_s": 0.1, "samples": 2, "step": 0.01} | changes
    return solve(pendulum, asked.pop("q"), asked.pop("v"), **asked)


turned = partial(Mechanism, (BODY,))
#: Fields, what is expected of them, what is given, and in what call.
BAD: list[tuple[str, str, str, Callable[[], object]]] = [
    ("q", "3 finite numbers", "the shape (1, 3)", lambda: run(q=np.zeros((1, 3)))),
    ("v", "3 finite numbers", "others", lambda: run(v=[0.0, "fast", 0.0])),
    ("v[1]", "a finite number", "nan", lambda: run(v=[0.0, nan, 0.0])),
    ("end_time_s", POSITIVE, "inf", lambda: run(end_time_s=inf)),
    ("end_time_s", POSITIVE, '"1"', lambda: run(end_time_s="1")),
    ("samples", "an integer >= 1", "True", lambda: run(samples=True)),
    ("StepChoice.longest_s", POSITIVE, "None", lambda: run(step=None)),
    ("stabilisation", "none, projection or Baumgarte's gains", '"all"', lambda: run(stabilisation="all")),
    ("StepChoice.steps_per_contact", POSITIVE, "0.0", lambda: StepChoice(1e-5, 0.0)),
    ("ErrorControl.tolerance", "a finite number > 0 and < 1", "1.0", lambda: ErrorControl(1.0)),
    ("ErrorControl.longest_s", "a number > 0", "nan", lambda: ErrorControl(1e-9, nan)),
    ("Baumgarte.alpha_s", NOT_NEGATIVE, "-1.0", lambda: Baumgarte(-1.0, 1.0)),
    ("Body.mass_kg", POSITIVE, "0.0", lambda: Body(0.0, 1.0)),
    ("bodies", "at least one body", "none", lambda: Mechanism((), ())),
    ("SameAngle.body_j", "a body index from -1 to 0", "1", lambda: turned((SameAngle(GROUND, 1),))),
    ("PiecewiseCubic.rows", "5 numbers for each piece", "2", lambda: PiecewiseCubic((0.0, 1.0))),
    ("RigidWall.restitution", "a finite number >= 0 and <= 1", "nan", lambda: RigidWall(nan)),
    ("ContactLaw.exponent", "a finite number >= 1", "0.5", lambda: ContactLaw(1e9, 0.5)),
]


@pytest.mark.parametrize(("field", "wanted", "got", "call"), BAD, ids=[f"{row[0]}={row[2]}" for row in BAD])
def test_what_is_given_wrongly_is_refused_in_one_line(
    field: str, wanted: str, got: str, call: Callable[[], object]
) -> None:
    with pytest.raises(ValueError) as refusal:  # noqa: PT011  the whole line is compared
        call()
    assert str(refusal.value) == f"{field}: expected {wanted}, got {got}"


@pytest.mark.parametrize("kind", [*CONSTRAINTS, *LOADS], ids=lambda kind: kind.__name__)
def test_what_is_no_number_is_refused_by_the_field_that_it_is_in(kind: type) -> None:
    good = part(kind, np.random.default_rng(1), 2)

    def made(name: str) -> Mechanism:
        bad = (replace(good, **{name: nan}),)
        return Mechanism((BODY, BODY), bad) if kind in CONSTRAINTS else Mechanism((BODY, BODY), (), bad)

    for name in [field.name for field in fields(kind) if field.type is float]:
        with pytest.raises(ValueError, match=rf"^{kind.__name__}\.{name}: expected .*, got nan$"):
            made(name)


def test_numbers_that_do_not_go_together_are_refused() -> None:
    with pytest.raises(ValueError, match=r"^Ramp\.duration_s: expected a finite number > 0, got 0"):
        Ramp(0.0, 1.0, 0.0)
    with pytest.raises(ValueError, match=r"radial_clearance_m: expected a number < bearing_radius_m = 0.01"):
        bearing(RigidWall(0.5), clearance=0.02)
    with pytest.raises(
        ValueError, match=r"dead_band_speed_m_s: expected a number < regularisation_speed_m_s"
    ):
        FrictionLaw("ambrosio", 0.1, 1e-3, 1e-3)
    with pytest.raises(ValueError, match=r"rows\[5\]: expected a number > 1, where the piece before begins"):
        PiecewiseCubic((1.0,) * 10)


def test_integers_and_numbers_of_numpy_are_numbers() -> None:
    run(
        q=[0, 0, 0], samples=np.int64(2), step=np.float64(0.01), end_time_s=1, stabilisation=Baumgarte(0, 0.0)
    )
