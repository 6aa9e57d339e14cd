"""Contact laws: what is not elastic takes energy out, friction opposes sliding."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine_models.minimal.equations import friction_share
from engine_models.minimal.model import damping_of, wall_of
from engine_models.scene.format import Clearance, Friction

deterministic = settings(max_examples=60, deadline=None, derandomize=True)
depths = st.floats(1e-7, 1e-3)
rates = st.floats(-2.0, 2.0)
stiffnesses = st.floats(1e5, 1e11)
restitutions = st.floats(0.05, 1.0)


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
