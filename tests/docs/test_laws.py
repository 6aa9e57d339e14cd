"""The page of laws has every law that the code has, and its formulas give the code's numbers."""

import math
import re
from collections.abc import Callable
from typing import Any, get_args

import numpy as np
import pytest
from scipy.special import lambertw

from engine_models.scene.format import LAWS
from engine_models.scene.format import FrictionLaw as FrictionName
from engine_models.scene.library import clearance
from reference_solver.mechanism.contacts import DAMPING_FACTORS, FRICTION_LAWS, stiffness_of
from reference_solver.mechanism.data import FrictionLaw
from tests.docs.pages import table

PAGE = "docs/laws.md"
FAMILY = {row["law"].strip("`"): row for row in table(PAGE, "law")}
FRICTION = {row["friction"].strip("`"): row for row in table(PAGE, "friction")}
WITH_FACTOR = [law for law, row in FAMILY.items() if row.get("damping factor", "$0$") != "$0$"]
#: Formulas are of a few operations on numbers near one.
ROUND_OFF = 1e-14
#: Printed numbers have four places.
PRINTED = 0.5e-4
#: Speeds in m/s for which the page's numbers of friction are.
SLIDING, FULL, DEAD = 0.006, 0.01, 0.002
#: What formulas call.
FUNCTIONS: dict[str, Callable[..., float]] = {"exp": math.exp, "max": max, "min": min, "tanh": math.tanh}


def value(formula: str, **names: float) -> float:
    """Return what a formula in the page's LaTeX is, computed as it is printed."""
    text = formula.strip("$").replace("^", "**").replace(r"\cdot", "*")
    for name in FUNCTIONS:
        text = text.replace(f"\\{name}", name.upper())  # a capital is no e to be multiplied
    text = re.sub(r"(?<=[\de)])(?=[(e])", "*", text)
    functions = {name.upper(): function for name, function in FUNCTIONS.items()}
    return float(eval(text, {**functions, **names}))  # the page is ours


def test_every_law_and_every_damping_factor_of_the_code_is_on_the_page() -> None:
    assert {*LAWS} == FAMILY.keys()
    assert set(get_args(FrictionName)) == FRICTION_LAWS.keys() == FRICTION.keys()
    assert set(WITH_FACTOR) == DAMPING_FACTORS.keys()


@pytest.mark.parametrize("law", WITH_FACTOR)
def test_a_printed_damping_factor_is_the_codes_and_so_is_the_restitution_that_a_bounce_shows(
    law: str,
) -> None:
    for e in (0.3, 0.5, 0.9):
        a = value(FAMILY[law]["damping factor"], e=e)
        assert DAMPING_FACTORS[law](e) == pytest.approx(a, rel=ROUND_OFF)
        if printed := FAMILY[law].get(f"at e = {e:g}"):
            shown = (1 + lambertw(-(1 + a) * math.exp(-(1 + a))).real) / a
            assert float(printed) == pytest.approx(shown, abs=PRINTED)


@pytest.mark.parametrize("law", FRICTION)
def test_printed_friction_is_the_codes(law: Any) -> None:
    dead = DEAD if law == "ambrosio" else 0.0
    data = FrictionLaw(law, 0.1, FULL, dead)
    formula = FRICTION[law]["part f(v) for v > 0"].replace("v_r", "r").replace("v_d", "d")
    of_code = float(FRICTION_LAWS[law](data, np.float64(SLIDING)))
    assert of_code == pytest.approx(value(formula, v=SLIDING, r=FULL, d=DEAD), rel=ROUND_OFF)
    assert float(FRICTION[law]["at v = 0.006 m/s"]) == pytest.approx(of_code, abs=PRINTED)


def test_the_printed_stiffness_of_steel_is_the_codes() -> None:
    steel = clearance(5e-4)
    assert stiffness_of(steel) == pytest.approx(6.610e10, rel=1e-4)  # four printed digits
