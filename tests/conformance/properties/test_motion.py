"""What holds for every ideal crank-slider: its mirror image moves as that, and forces change momenta."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from engine_models.engine import RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.scene.drives import FreeDrive, TorqueDrive
from engine_models.scene.scene import Link, Scene, Slider, Start
from tests.helpers.arrays import joint_forces

SAMPLES, STEPS_PER_SAMPLE = 20, 10
#: What is compared with itself is at round-off.
ROUND_OFF = 1e-11
#: Simpson's error of forces over two of a hundred samples, each 0.03 rad, with a rod of 2.5 cranks.
SIMPSON, MANY = 1e-3, 100
few = settings(max_examples=12, deadline=None, derandomize=True)


def between(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False).map(lambda x: float(f"{x:.4g}"))


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """Draw a crank-slider that turns over, free or under a torque, for about half a turn."""
    crank_m, ratio, speed = draw(between(0.03, 0.1)), draw(between(2.5, 5.0)), draw(between(20.0, 100.0))
    links = []
    for length_m in (crank_m, ratio * crank_m):
        mass_kg, part, inertia = draw(between(0.1, 1.0)), draw(between(0.2, 0.8)), draw(between(0.05, 0.3))
        inertia_kg_m2 = inertia * mass_kg * length_m**2
        links.append(
            Link(
                length_m=length_m,
                mass_kg=mass_kg,
                inertia_kg_m2=inertia_kg_m2,
                centre_of_mass_m=part * length_m,
            )
        )
    torque_N_m = draw(st.sampled_from([None, -0.1, 0.2]))
    free, driven = FreeDrive(kind="free"), TorqueDrive(kind="torque", torque_N_m=torque_N_m or 0.0)
    return Scene(
        name="drawn",
        end_time_s=3.0 / speed,
        gravity_m_s2=draw(st.sampled_from([0.0, 9.81])),
        crank=links[0],
        rod=links[1],
        slider=Slider(mass_kg=draw(between(0.05, 0.5)), inertia_kg_m2=1e-4),
        start=Start(crank_angle_rad=draw(between(-3.0, 3.0)), crank_speed_rad_s=speed),
        drive=free if torque_N_m is None else driven,
    )


def run(scene: Scene, samples: int = SAMPLES) -> Trajectory:
    step_s = scene.end_time_s / (samples * STEPS_PER_SAMPLE)
    return make_engine("reference").simulate(scene, RunSettings(step_s, samples))


def same(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=ROUND_OFF * np.abs(expected).max())


@given(scenes())
@few
def test_the_mirror_image_of_a_mechanism_moves_as_its_mirror_image(drawn: Scene) -> None:
    scene = drawn.model_copy(update={"gravity_m_s2": 0.0})  # which points down in both
    start = Start(
        crank_angle_rad=-scene.start.crank_angle_rad, crank_speed_rad_s=-scene.start.crank_speed_rad_s
    )
    drive = scene.drive
    if isinstance(drive, TorqueDrive):
        drive = TorqueDrive(kind="torque", torque_N_m=-drive.constant_N_m)
    own, mirrored = run(scene), run(scene.model_copy(update={"start": start, "drive": drive}))
    sides = np.array([1.0, -1.0, -1.0])
    same(mirrored.position * sides, own.position)
    same(mirrored.velocity * sides, own.velocity)
    same(joint_forces(mirrored) * sides[:2], joint_forces(own))


@given(scenes())
@few
def test_forces_are_the_rates_of_the_momenta_they_change(scene: Scene) -> None:
    found = run(scene, samples=MANY)
    masses = np.array([body.mass_kg for body in scene.bodies])
    momentum = np.einsum("b,nbi->ni", masses, found.velocity[:, :, :2])
    # O's force on the crank and the guide's on the slider are all that act from outside, but for weight.
    outside = found.joint_force_N["O"].copy()
    outside[:, 1] += found.guide_force_N["guide"] - scene.weight_m_s2 * masses.sum()
    h = found.time_s[1]
    gained = momentum[2:] - momentum[:-2]
    impulse = h / 3 * (outside[:-2] + 4 * outside[1:-1] + outside[2:])
    scale = max(np.abs(momentum).max(), np.abs(outside).max() * h)
    assert np.abs(gained - impulse).max() <= SIMPSON * scale
