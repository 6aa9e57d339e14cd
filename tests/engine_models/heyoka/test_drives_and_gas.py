"""heyoka's drives by formula and by table, and gas by the crank's angle, against the reference."""

import numpy as np
import pytest

from engine_models.engine import RunSettings
from engine_models.heyoka.engine import HeyokaEngine
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from tests.helpers.arrays import joint_forces

pytest.importorskip("heyoka", reason="heyoka is not installed")

SAMPLES = 20
#: By what the reference's tolerance of 1e-12 leaves: 6e-13 m, and 2e-8 of the largest force, are measured.
POSITION_M, FORCE = 1e-10, 1e-6


def driven(kind: str, **drive: object) -> Scene:
    """Return set R with 0.1 mm at B, driven in another way for the time of a few impacts."""
    scene = SCENES["clearance-driven-0.1mm"]().model_copy(update={"end_time_s": 0.004})
    return scene.replace("drive", {"kind": kind, **drive})


def by_table(**of: object) -> Scene:
    """Return the same by a table of the angle, at times that no step of its own would hit."""
    times = np.linspace(0.0, 0.005, 8)
    speed = SCENES["ideal-driven"]().start.crank_speed_rad_s
    angles = speed * times + 0.1 * np.sin(900 * times) ** 2
    return driven("table", time_s=times.tolist(), angle_rad=angles.tolist(), **of)


def gas(interpolation: str, scene: str) -> Scene:
    """Return a compressor, whose gas goes along straight lines or a spline; backwards it turns, too."""
    made = SCENES[scene]().replace("load.slider.gas.interpolation", interpolation)
    return made.model_copy(update={"end_time_s": 0.02})


def backwards() -> Scene:
    """Return the ideal compressor turning against its table."""
    scene = SCENES["ideal-compressor"]().model_copy(update={"end_time_s": 0.02})
    return scene.replace("start.crank_speed_rad_s", -157.0).replace("drive", {"kind": "free"})


RUNS = {
    "ramp": driven("ramp", final_speed_rad_s=300.0, ramp_time_s=0.002),
    "ramp-begun": driven("ramp", final_speed_rad_s=300.0, ramp_time_s=0.002).replace("start.time_s", 0.0007),
    "fluctuating": driven("fluctuating", amplitude_rad_s=80.0, frequency_Hz=300.0, phase_rad=0.4),
    "table": by_table(),
    "table-with-slopes": by_table(end_slopes=[523.0, 523.0]),
    "gas": gas("spline", "ideal-compressor"),
    "gas-by-lines": gas("linear", "ideal-compressor"),
    "gas-backwards": backwards(),
    "gas-and-clearance": gas("spline", "clearance-compressor"),
}


@pytest.mark.parametrize("name", RUNS)
def test_motion_forces_and_works_are_the_references(name: str) -> None:
    scene, settings = RUNS[name], RunSettings(1.0, SAMPLES)
    own = HeyokaEngine(step_tolerance=1e-14).simulate(scene, settings)
    other = ReferenceEngine(method="dop853", step_tolerance=1e-12).simulate(scene, settings)
    off = np.abs(own.position - other.position).max()
    assert off < POSITION_M, f"{off:.1e} m or rad"
    force = np.abs(joint_forces(other)).max()
    np.testing.assert_allclose(joint_forces(own), joint_forces(other), rtol=0, atol=FORCE * force)
    work = np.abs(other.work_J).max()
    np.testing.assert_allclose(own.work_J, other.work_J, rtol=0, atol=1e-8 * work)


@pytest.mark.parametrize("name", ["table", "gas-by-lines"])
def test_no_step_crosses_a_knot(name: str) -> None:
    """Where one does, the error falls with the knots' jump and no longer with the tolerance."""
    scene, settings = RUNS[name], RunSettings(1.0, SAMPLES)
    coarse, fine = (HeyokaEngine(step_tolerance=t).simulate(scene, settings) for t in (1e-10, 1e-14))
    off = np.abs(coarse.position - fine.position).max()
    assert off < 1e-8, f"{off:.1e} m or rad"
