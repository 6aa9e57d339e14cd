"""Contact laws: constants as they are printed, elastic forces from a potential, losses never negative."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine_models.minimal.equations import friction_share
from engine_models.minimal.model import damping_of, wall_of
from engine_models.scene.format import Clearance, Friction
from reference_solver.mechanism.contact_laws import DAMPING_FACTORS

#: a(e) of each law at e = 0.5 and 0.9: Hunt and Crossley 1975, Lankarani and Nikravesh 1990, Gonthier et al.
#: 2004, Zhiying and Qishao 2006, Flores et al. 2011, Hu and Guo 2015, Carvalho and Martins 2019.
PRINTED = {
    "hunt-crossley": (0.75, 0.15),
    "lankarani-nikravesh": (0.5625, 0.1425),
    "gonthier": (1.5, 0.2111111111),
    "zhiying-qishao": (1.5290335285, 0.1740498931),
    "flores": (1.6, 0.1777777778),
    "hu-guo": (1.5, 0.1666666667),
    "carvalho-martins": (1.4318181818, 0.1664835165),
}
DIGITS = 1e-9
deterministic = settings(max_examples=60, deadline=None, derandomize=True)
depths = st.floats(1e-7, 1e-3)
rates = st.floats(-2.0, 2.0)
stiffnesses = st.floats(1e5, 1e11)
restitutions = st.floats(0.05, 1.0)


@pytest.mark.parametrize("law", PRINTED)
def test_damping_factors_are_those_printed_in_both_codes(law: str) -> None:
    for e, printed in zip((0.5, 0.9), PRINTED[law], strict=True):
        for found in (DAMPING_FACTORS[law](e), damping_of(law, e)):
            assert found == pytest.approx(printed, rel=DIGITS)


def clearance(law: str, **fields: float) -> Clearance:
    data = {"radial_clearance_m": 1e-4, "bearing_radius_m": 0.01, "law": law, **fields}
    return Clearance.model_validate(data)


@pytest.mark.parametrize("kind", ["saturated-linear", "ambrosio", "tanh"])
@given(st.floats(-0.012, 0.012) | st.floats(-5.0, 5.0), st.floats(-10.0, 1e4), st.floats(0.01, 0.5))
@deterministic
def test_friction_opposes_sliding_and_is_no_more_than_coulombs(
    kind: str, sliding: float, normal: float, coefficient: float
) -> None:
    dead = {"dead_band_speed_m_s": 0.003} if kind == "ambrosio" else {}
    of = {"law": kind, "coefficient": coefficient, "regularisation_speed_m_s": 0.01, **dead}
    room = clearance("hertz", stiffness=1e8).model_copy(update={"friction": Friction.model_validate(of)})
    row = np.array([*[0.0] * 6, *wall_of(room.data(), damping_of)])
    most = coefficient * max(normal, 0.0)
    force = -most * friction_share(row, sliding)
    assert force * sliding <= 0
    assert force == 0.0 or abs(sliding) > dead.get("dead_band_speed_m_s", 0.0)
    assert abs(force) <= most
    if abs(sliding) >= 0.2 and normal > 0:  # twenty times the speed at which all of it acts
        assert math.isclose(abs(force), coefficient * normal, rel_tol=1e-9)
