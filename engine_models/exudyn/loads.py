"""What acts on crank and slider by their state or by time, as one object of generalised forces in Exudyn.

It has no mass of its own and stands on the nodes of the bodies. Motor, friction of the guide and spring are
its constant, damping and stiffness matrices. What is not linear is a function that Exudyn evaluates by itself
(see ``symbolic``): the gas, of the crank's true angle, and the torque that changes a flywheel's speed.
"""

import math
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from engine_models.engine import FloatArray
from engine_models.exudyn.drive import FLYWHEEL_KG_M2, acceleration
from engine_models.exudyn.motion import Part
from engine_models.exudyn.symbolic import piecewise, symbolic, user_function
from engine_models.mechanics.joints import CRANK, SLIDER
from engine_models.mechanics.loads import parts_of
from engine_models.scene.loads import Gas, SliderLoad
from engine_models.scene.scene import Scene
from reference_solver.mechanism.motor import motor_damping, motor_torque

items: Any = itemInterface  # its constructors carry no types


def add_loads(
    mbs: exu.MainSystem, scene: Scene, parts: tuple[Part, ...], start: FloatArray, flywheel: bool
) -> None:
    """Add the loads of a scene that starts at positions (bodies, 3), if it has any.

    ``flywheel``: the crank has one and no constraint, so that a changing speed takes a torque here.
    """
    load = scene.load.slider or SliderLoad(force_N=0.0)
    spins_up = flywheel and scene.speed_is_prescribed and scene.drive.kind != "constant-speed"
    bodies = {SLIDER} if parts_of(scene) else set()
    if spins_up or scene.drive.kind == "motor" or load.gas is not None:
        bodies.add(CRANK)
    # No node that is not needed: implicit solvers difference these forces by every coordinate.
    parts = tuple(part for part in parts if bodies & {part.body, *(link.body for link in part.links)})
    if not parts:
        return
    crank, slider = _coordinates(parts, CRANK), _coordinates(parts, SLIDER)
    stiffness, free = load.spring_N_m or 0.0, load.free_position_m or 0.0
    constant = ((load.force_N or 0.0) - stiffness * (start[-1, 0] - free)) * slider
    damping = (load.viscous_N_s_m or 0.0) * np.outer(slider, slider)
    if scene.drive.kind == "motor":
        constant += motor_torque(scene.drive.line, 0.0) * crank
        damping += motor_damping(scene.drive.line) * np.outer(crank, crank)
    t, number = symbolic.Real("t", 0.0), symbolic.Real("itemNumber", 0)
    q, rates = (symbolic.Vector(name, [0.0] * len(crank)) for name in ("q", "q_t"))
    forces = [symbolic.Real(0.0)] * len(crank)
    if load.gas is not None:
        angle = start[CRANK, 2] + sum(q[k] for k in _places(crank))
        for k in _places(slider):
            forces[k] = forces[k] + gas_force(load.gas, angle)
    if spins_up:
        for k in _places(crank):
            forces[k] = forces[k] + FLYWHEEL_KG_M2 * acceleration(scene, t)
    what: dict[str, Any] = {
        "massMatrix": np.zeros_like(damping),
        "stiffnessMatrix": stiffness * np.outer(slider, slider),
        "dampingMatrix": damping,
        "forceVector": constant,
    }
    if spins_up or load.gas is not None:
        value, arguments = symbolic.Vector(forces), [t, number, q, rates]
        function = user_function(mbs, "ObjectGenericODE2", "forceUserFunction", arguments, value)
        what["forceUserFunction"] = function
    mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=[part.node for part in parts], **what))


def gas_force(gas: Gas, angle: Any) -> Any:
    """Return the force in N on the slider as an expression of the crank's angle in rad."""
    turn, first = 2 * math.pi, gas.crank_angle_rad[0]
    return piecewise(angle - turn * symbolic.floor((angle - first) / turn), gas.spline())


def _places(coordinates: FloatArray) -> list[int]:
    """Return where ones are among coordinates (n,)."""
    return [int(k) for k in np.flatnonzero(coordinates)]


def _coordinates(parts: tuple[Part, ...], body: int) -> FloatArray:
    """Return which of all parts' coordinates, ones among zeros (n,), add up to a body's own.

    That is the crank's angle, or the slider's place along its guide.
    """
    of_parts = []
    for part in parts:
        own = np.zeros(len(part.start))
        if part.body == body:
            own[2 if body == CRANK else 0] = 1.0
        for k, link in enumerate(part.links):
            if link.body == body:
                kind, up = "turn" if body == CRANK else "x", k
                while up >= 0:
                    own[up] = part.links[up].joint == kind
                    up = part.links[up].parent
        of_parts.append(own)
    return np.concatenate(of_parts)
