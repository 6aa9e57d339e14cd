"""What a scene's motor, spring and viscous friction are in Pymunk: springs and dampers of its own.

Pymunk's dampers take part in the sweeps over the joints, and with enough of them damp the velocity after the
kick: implicit, and of order 1 beside the leap-frog, whose velocity at the kick's own time is the mean of
before and after. With m Delta v = J - c dt (v + Delta v / 2), where v + Delta v is the velocity after, a body
that is lighter by c dt/2 does exactly that under the same damper. The weight it loses is nowhere missed: the
guide carries the slider's, and an inertia has none.
"""

import math

import pymunk

from engine_models.engine import SimulationFailed
from engine_models.pymunk.model import Bodies
from engine_models.scene.drives import MotorDrive
from engine_models.scene.scene import Scene
from reference_solver.mechanism.motor import motor_damping


def add_loads(scene: Scene, space: pymunk.Space, bodies: Bodies, centred_step_s: float | None) -> None:
    """Add a scene's motor, and the spring and the viscous friction of its slider, to a space of its bodies.

    A motor is a damper between the crank and a body that turns at the no-load speed. The slider's spring and
    damper reach along the guide, to a place far outside its reach. What they damp is the velocity after the
    kick, or with a ``centred_step_s`` the mean of before and after in steps so long.

    Raises:
        SimulationFailed: a damper is too strong to be centred at this step.
    """
    drive, load = scene.drive, scene.load.slider
    if isinstance(drive, MotorDrive):
        crank, damping = bodies[0], motor_damping(drive.line)
        if centred_step_s is not None:
            crank.moment, damping = _centred("motor", crank.moment, damping, centred_step_s)
        ahead = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        ahead.angular_velocity = drive.line.no_load_speed_rad_s
        space.add(ahead, pymunk.DampedRotarySpring(ahead, crank, 0.0, 0.0, damping))
    if load is not None and (load.spring_N_m or load.viscous_N_s_m):
        slider, damping, free = bodies[2], load.viscous_N_s_m or 0.0, load.free_position_m or 0.0
        if damping and centred_step_s is not None:
            slider.mass, damping = _centred("viscous friction", slider.mass, damping, centred_step_s)
        crank_link, rod_link, _ = scene.crank_slider()
        away = 2 * (crank_link.length_m + rod_link.length_m) + abs(free)
        ends = space.static_body, slider, (-away, 0.0), (0.0, 0.0)
        space.add(pymunk.DampedSpring(*ends, free + away, load.spring_N_m or 0.0, damping))


def needs_one_step(scene: Scene) -> list[str]:
    """Return what of a scene is made for steps of one length: native contacts, changing speeds, springs."""
    load, drive = scene.load.slider, scene.drive.kind
    joints = scene.clearances.items()
    return [
        *(f"clearance.{name}.law = rigid" for name, clearance in joints if clearance.law == "rigid"),
        *([] if drive in ("free", "torque", "constant-speed") else [f"drive.kind = {drive}"]),
        *(f"load.slider.{name}" for name in ("spring_N_m", "viscous_N_s_m") if load and getattr(load, name)),
    ]


def _centred(what: str, inertia: float, damping: float, step_s: float) -> tuple[float, float]:
    """Return inertia and damping of a body and a damper of Pymunk's, for the mean velocity to be damped.

    A damper's impulse is the inertia times exp(damping dt/inertia) - 1 times the velocity that the sweeps end
    with, which is to be c dt times it.
    """
    lighter = inertia - damping * step_s / 2
    if not lighter > 0:
        limit = 2 * inertia / damping
        raise SimulationFailed(
            f"{what} too strong at t = 0 s with step {step_s:.3g} s: shorten it below {limit:.3g} s"
        )
    return lighter, lighter / step_s * math.log1p(damping * step_s / lighter)
