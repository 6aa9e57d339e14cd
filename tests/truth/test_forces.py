"""Forces and reactions in any states, for the engines that have none of their own."""

import numpy as np
import pytest

from engine_models.engine import RunSettings
from engine_models.mechanics.forces import accelerations, contact_states, reactions
from engine_models.mechanics.impacts import instants_in
from engine_models.minimal.engine import SharpSolver
from engine_models.scene.library import ALL_SCENES

SCENES = ("ideal-compressor", "clearance-driven-damped", "scotch-yoke", "andrews-squeezer", "quick-return")


@pytest.mark.parametrize("name", SCENES)
def test_reactions_from_motion_are_the_multipliers_of_the_solver(name: str) -> None:
    scene = ALL_SCENES[name]()
    run = SharpSolver().simulate(scene, RunSettings(scene.end_time_s, 7))
    motion = run.position, run.velocity, accelerations(scene, run)
    told = reactions(scene.mechanism, run.time_s, *motion, run.contacts)
    for field in ("joint_force_N", "guide_force_N", "guide_moment_N_m"):
        for joint, force in getattr(run, field).items():
            largest = max(np.abs(each).max() for each in run.joint_force_N.values())
            assert getattr(told, field)[joint] == pytest.approx(force, abs=1e-10 * largest), joint
    if run.driver_torque_N_m is not None:
        size = np.abs(run.driver_torque_N_m).max()
        assert told.driver_torque_N_m == pytest.approx(run.driver_torque_N_m, abs=1e-10 * size)


def test_a_law_has_the_same_force_by_states_alone_as_in_the_solver() -> None:
    """A pin's force follows from its latest touch, and from nothing else that was before."""
    may_pull = {f"clearance.{joint}.may_pull": True for joint in "OAB"}
    scene = ALL_SCENES["clearance-free-OAB"]().replace({"end_time_s": 0.01, **may_pull})
    contacts = SharpSolver().simulate(scene, RunSettings(scene.end_time_s, 1)).contacts
    all_impacts = [contact.impacts for contact in contacts.values()]
    within = [
        instants_in(begin, begin + lasted, 5)
        for of_joint in all_impacts
        for begin, lasted in zip(of_joint.time_s, of_joint.duration_s, strict=True)
    ]
    settings = RunSettings(scene.end_time_s, 1, tuple(np.concatenate(within).tolist()))
    run = SharpSolver().simulate(scene, settings)
    for pin in scene.mechanism.loose:
        contact = run.contacts[pin.name]
        touches = np.searchsorted(contact.impacts.time_s, run.time_s) - 1
        pressed = (contact.penetration_m > 0) & (run.time_s < contact.impacts.time_s[-1])
        assert pressed.sum() > 20
        approach = contact.impacts.approach_speed_m_s[touches[pressed]]
        acting = contact_states(pin, run.position[pressed], run.velocity[pressed], approach)
        largest = contact.normal_force_N.max()
        assert acting.normal_force_N == pytest.approx(contact.normal_force_N[pressed], abs=1e-9 * largest)
        if contact.friction_force_N is not None:
            rub = contact.friction_force_N[pressed]
            assert acting.friction_force_N == pytest.approx(rub, abs=1e-9 * largest)
