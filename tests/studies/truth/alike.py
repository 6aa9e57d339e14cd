"""Whether two runs of a crank-slider are the same, in all that they tell."""

import numpy as np

from engine_models.engine import Trajectory
from engine_models.scene.scene import Scene
from studies.judges.impact_matching import impact_errors
from studies.judges.metrics import errors, signals

#: Places agree to this in m: 8e-12 m are measured at most, where two joints in turns magnify it.
PLACE_M, PLACES = 5e-11, ("slider_position", "clearance")
#: Contacts are stiff: they make 1e-7 of the force of 1e-12 m, and less of a torque, a work and a speed.
PART = 1e-6


def assert_alike(scene: Scene, run: Trajectory, other: Trajectory) -> None:
    """Assert that two runs agree in every signal, in works and losses, and in their impacts."""
    sizes = {name: float(np.abs(value).max()) for name, value in signals(scene, other)}
    for (name, size), error in zip(sizes.items(), errors(scene, run, other).values(), strict=True):
        allowed = PLACE_M if name.startswith(PLACES) else PART * size
        assert error.max() <= allowed, f"{name} off by {error.max():.1e} of {size:.1e}"
    largest_N = max(size for name, size in sizes.items() if name.endswith("force_N"))
    for guide, moment in other.guide_moment_N_m.items():
        lever_m = scene.crank.length_m
        assert np.abs(run.guide_moment_N_m[guide] - moment).max() <= PART * largest_N * lever_m
    works = [(run.driver_work_J, other.driver_work_J)]
    works += [(run.load_work_J[part], work) for part, work in other.load_work_J.items()]
    for joint, contact in other.contacts.items():
        own = run.contacts[joint]
        lines = ("normal_loss_J", "friction_loss_J", "clipped_loss_J", "elastic_energy_J")
        works += [(getattr(own, line), getattr(contact, line)) for line in lines]
        missed = impact_errors(own.impacts, contact.impacts, scene.end_time_s)
        assert missed.get("impact_speed_relative_error", 0.0) < PART
        if getattr(scene.clearance, joint).law != "rigid":  # there the last bounces end differently
            assert missed.get("impact_impulse_relative_error", 0.0) < PART
    energy = max(float(np.abs(work).max()) for _, work in works if work is not None)
    for mine, theirs in works:
        assert (mine is None) == (theirs is None)
        if mine is not None and theirs is not None:
            assert np.abs(mine - theirs).max() <= PART * energy
