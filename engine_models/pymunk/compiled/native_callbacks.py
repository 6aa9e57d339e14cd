"""What the two circles of a native contact do in a step's collision (see ``native_contact``), compiled."""

import numpy as np

from engine_models.pymunk.compiled.chipmunk import (
    BODY,
    BUFFER,
    POINTS,
    get_impulse,
    get_state,
    record_at,
    rewound,
    set_contact_points,
    set_process_collision,
    set_restitution,
    set_sweeps,
)
from engine_models.pymunk.compiled.pin import enter_means, locate, speeds
from engine_models.pymunk.compiled.records import CONTACT, KICK, PIN, RUN

#: What a collision's functions find: the records of run and pin, and where the pin's kicks are entered; the
#: bodies of bearing and pin and the buffer of their states; a set of contact points; the buffer of an
#: impulse and where it is; and the approach speed in m/s below which nothing bounces.
NATIVE = np.dtype(
    [
        *((name, np.uintp) for name in ("run", "pin", "kicks", "bearing_body", "pin_body", "at", "points")),
        ("state", BUFFER),
        ("impulse", BUFFER),
        ("impulse_at", np.uintp),
        ("closing_speed", np.float64),
    ]
)
IMPULSE = np.dtype([("x", np.float64), ("y", np.float64)])
KICK_SIZE, BODY_SIZE = np.uintp(KICK.itemsize), np.uintp(BODY.itemsize)


def rewrite(arbiter, space, data):
    """Make of the two circles' overlap the contact of a pin in a bearing, if there is one."""
    native = record_at(data, NATIVE)
    contact, run = record_at(native.pin, PIN), record_at(native.run, RUN)
    into = rewound(native.state)
    get_state(native.bearing_body, into)
    get_state(native.pin_body, into)
    bearing, of_pin = record_at(native.at, BODY), record_at(native.at + BODY_SIZE, BODY)
    touched = contact.phase == CONTACT
    touches = locate(contact, bearing, of_pin)
    set_process_collision(arbiter, touches)
    if touches != touched:
        run.touching += 1 if touches else -1
        set_sweeps(space, run.contact_sweeps if run.touching > 0 else run.flight_sweeps)
    if not touches:
        return
    # Each wall has its own point: Pymunk takes the penetration from their distance.
    contact.bearing_lever, contact.pin_lever = contact.radius, contact.radius - contact.clearance
    n_x, n_y = contact.n_x, contact.n_y
    points = record_at(native.points, POINTS)
    points.count = 1
    points.normal_x, points.normal_y = -n_x, -n_y
    points.bearing_x = bearing.x + contact.a_x + contact.bearing_lever * n_x
    points.bearing_y = bearing.y + contact.a_y + contact.bearing_lever * n_y
    points.pin_x = of_pin.x + contact.b_x + contact.pin_lever * n_x
    points.pin_y = of_pin.y + contact.b_y + contact.pin_lever * n_y
    set_contact_points(arbiter, native.points)
    entry = record_at(native.kicks + np.uintp(contact.kicks) * KICK_SIZE, KICK)
    rate, sliding = speeds(contact, bearing, of_pin)
    entry.rate_before, entry.mean_rate, entry.mean_sliding = rate, rate, sliding
    if rate < native.closing_speed:
        set_restitution(arbiter, 0.0)


def record(arbiter, _space, data):
    """Enter the kick's impulse, if there is one; Pymunk tells the one on the bearing."""
    native = record_at(data, NATIVE)
    contact, run = record_at(native.pin, PIN), record_at(native.run, RUN)
    if contact.phase != CONTACT:  # the pin is lost, which ends the run after this step
        return
    get_impulse(arbiter, rewound(native.impulse))
    impulse = record_at(native.impulse_at, IMPULSE)
    normal = impulse.x * contact.n_x + impulse.y * contact.n_y
    if not normal > 0.0:
        return
    into = rewound(native.state)
    get_state(native.bearing_body, into)
    get_state(native.pin_body, into)
    entry = record_at(native.kicks + np.uintp(contact.kicks) * KICK_SIZE, KICK)
    entry.step, entry.time_s, entry.normal_N_s = run.kick, run.time_s, normal
    entry.friction_N_s = impulse.x * contact.n_y - impulse.y * contact.n_x
    entry.spring_N_s, entry.clipped = 0.0, 0.0
    enter_means(contact, record_at(native.at, BODY), record_at(native.at + BODY_SIZE, BODY), entry)
    contact.kicks += 1
