"""The scene's law of a compliant contact as a pair of forces, compiled.

A step moves the positions first and then kicks, so the force is that of the positions to which the step will
move the bodies, and as far as it depends on speeds, of the velocities of half a step before. Positions that
Chipmunk corrects besides, in a native contact of the same body, are not foreseen.
"""

import math

from numba.extending import register_jitable

from engine_models.mechanics import contact_law
from engine_models.pymunk.compiled.chipmunk import INNER
from engine_models.pymunk.compiled.loads import push_at
from engine_models.pymunk.compiled.pin import speeds
from engine_models.pymunk.compiled.records import OVERFLOWN

normal_force = register_jitable(**INNER)(contact_law.normal_force)
friction_force = register_jitable(**INNER)(contact_law.friction_force)


@register_jitable(**INNER)
def push(pin, state, loads, kick_s, kick):
    """Add the force of a located pin in contact to the loads, and enter the kick, in which it acts."""
    pin.bearing_lever = pin.radius + pin.depth / 2
    pin.pin_lever = pin.radius - pin.clearance - pin.depth / 2
    rate, sliding = speeds(pin, state[pin.bearing], state[pin.pin])
    if pin.fresh:
        pin.approach = rate
    normal, spring, clipped = normal_force(pin, pin.depth, rate, pin.approach)
    friction = friction_force(pin, normal, sliding)
    if not math.isfinite(normal + friction):
        pin.phase = OVERFLOWN
        return
    n_x, n_y = pin.n_x, pin.n_y
    f_x, f_y = -normal * n_x - friction * n_y, -normal * n_y + friction * n_x
    push_at(loads[pin.pin], pin.b_x + pin.pin_lever * n_x, pin.b_y + pin.pin_lever * n_y, f_x, f_y)
    arm_x, arm_y = pin.a_x + pin.bearing_lever * n_x, pin.a_y + pin.bearing_lever * n_y
    push_at(loads[pin.bearing], arm_x, arm_y, -f_x, -f_y)
    kick.normal_N_s, kick.friction_N_s, kick.spring_N_s = normal * kick_s, friction * kick_s, spring * kick_s
    kick.rate_before, kick.mean_rate, kick.mean_sliding = rate, rate, sliding
    kick.clipped, kick.depth_m, kick.kick_s = clipped, pin.depth, kick_s
