"""The study of motions: its curves against the converged impact, and against the law's own mechanics."""

import numpy as np
import pytest

from studies import motions
from studies.case import Case, run_case

#: Converged by an independent solver to the digits given: the first touch of set R in s, its peak in N.
TOUCH_S, PEAK_N = 0.000227285, 45870.0
#: Hertz's stiffness of steel on steel, 10 mm in 9.5 mm, in N/m^1.5, to the digits given.
HERTZ = 6.610e10


def case(view: str, engine: str, scene: str) -> Case:
    """Return the full set's case of a view."""
    found = [c for c in motions.cases(full=True) if c.columns["view"] == view and c.engine == engine]
    return next(c for c in found if c.scene.name == scene)


def test_one_impact_touches_when_and_presses_as_hard_as_the_converged_one() -> None:
    _, curves = run_case(case("impact", "scipy", "clearance-driven-0.5mm-first-impact"))
    time, depth = curves["time_s"], curves["contact_B_penetration_m"]
    after = int(np.argmax(depth >= 0))
    assert time[after - 1] < TOUCH_S * (1 + 1e-6)
    assert time[after] > TOUCH_S * (1 - 1e-6)
    # A sample lies within 0.25 us of the peak of a contact of 52 us: within 0.01 % of it.
    assert curves["contact_B_normal_force_N"].max() == pytest.approx(PEAK_N, rel=2e-4)
    assert curves["true_contact_B_normal_force_N"].max() == pytest.approx(PEAK_N, rel=2e-4)


@pytest.mark.parametrize("law", ["hertz", "flores"])
def test_the_area_of_a_laws_loop_is_the_energy_that_the_ledger_has_lost(law: str) -> None:
    row, curves = run_case(case("law", "reference", f"clearance-driven-0.5mm-{law}"))
    depth, force = curves["contact_B_penetration_m"], curves["contact_B_normal_force_N"]
    inside = depth >= 0
    area = np.trapezoid(force[inside], depth[inside])
    deepest = float(depth.max())
    stored = HERTZ * deepest**2.5 / 2.5
    assert isinstance(row["dissipated_energy_J"], float)
    # A loop of 100 samples, both ends cut by less than one: a hundredth of what is stored at most.
    assert area == pytest.approx(row["dissipated_energy_J"], abs=0.01 * stored)
    if law == "hertz":
        away = HERTZ * np.maximum(depth, 0) ** 1.5 - force
        assert np.abs(away).max() < 1e-3 * force.max()  # the stiffness has four digits
    else:
        assert area > 0.5 * stored  # at restitution 0.5 more than half of it is lost
