"""Starts with a pin in its wall, whose touch nobody has seen."""

import numpy as np
import pytest

from engine_models.engine import ImpossibleStart, RunSettings
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import SCENES

PENDULUM = SCENES["clearance-pendulum"]()
CLEARANCE_M = PENDULUM.clearances["O"].radial_clearance_m


def steps(depth: float, rate_m_s: float, changes: dict[str, object]) -> int:
    """Return the steps of a hanging pendulum's run, with its pin in the wall by a part of the clearance."""
    reach = PENDULUM.short.crank.centre_of_mass_m
    body = {"x_m": 0.0, "y_m": -(1 + depth) * CLEARANCE_M - reach, "angle_rad": -np.pi / 2}
    body |= {"velocity_x_m_s": 0.0, "velocity_y_m_s": -rate_m_s, "angular_velocity_rad_s": 0.0}
    begun = {f"start.crank.{name}": value for name, value in body.items()}
    of = PENDULUM.replace({**begun, "end_time_s": 0.05, **changes})
    engine = ReferenceEngine(method="dop853", step_tolerance=1e-6)
    return engine.simulate(of, RunSettings(of.end_time_s, 1)).steps


def test_a_pin_that_leaves_a_wall_at_the_start_is_refused_as_its_touch_is_not_known() -> None:
    with pytest.raises(ImpossibleStart, match=r"pin O .* m in the wall and leaving at 0\.015 m/s"):
        steps(0.02, -0.015, {})


@pytest.mark.parametrize(
    ("depth", "rate_m_s", "changes"),
    [
        (0.02, 0.015, {}),
        (-0.02, -0.015, {}),
        (0.02, -0.015, {"clearance.O.law": "hertz", "clearance.O.restitution": None}),
        (0.02, -0.015, {"clearance.O.minimum_impact_speed_m_s": 0.01}),
    ],
    ids=["entering", "before the wall", "law without damping", "floor of the impact speed as stated"],
)
def test_a_pin_whose_touch_is_known_or_has_no_part_in_the_force_starts_and_bounces(
    depth: float, rate_m_s: float, changes: dict[str, object]
) -> None:
    assert steps(depth, rate_m_s, changes) < 10_000
