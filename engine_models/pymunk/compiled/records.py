"""What the compiled loop, the contacts' functions and Python share: records of a run and its pins."""

import numpy as np

from engine_models.pymunk.compiled.chipmunk import IO

#: Where a pin is: in flight, in contact, through the wall of its bearing, or where numbers overflow.
FLIGHT, CONTACT, LOST, OVERFLOWN = range(4)


def _fields(names: str, kind: type) -> list[tuple[str, type]]:
    return [(name, kind) for name in names.split()]


#: A pin in its bearing. The rows of its two bodies in the state; the places of bearing and pin on the x axes
#: of their bodies, clearance and bearing's radius in m, and the distance of the two centres beyond which the
#: pin is lost, infinite without guards; the constants of its law (see ``LawNumbers``). Then its phase,
#: whether a contact is ``fresh``, its approach speed, and the geometry: d, n, what leads from the origins
#: of both bodies to the centres of bearing and pin, and from there along n to the contact point. ``kicks``
#: counts the kicks in contact that the log has, and ``native`` tells a native contact.
PIN = np.dtype(
    [
        *_fields("bearing pin native phase fresh kicks", np.int64),
        *_fields("bearing_x pin_x clearance radius reach", np.float64),
        *_fields("stiffness exponent factor damping floor coefficient full dead", np.float64),
        *_fields("clips smooth", np.bool_),
        *_fields("approach depth d_x d_y n_x n_y a_x a_y b_x b_y bearing_lever pin_lever", np.float64),
    ],
    align=True,
)

#: A kick in contact: its step and time; impulses in N s on the pin, inward and along t; speeds in m/s. These
#: are that of the penetration before the kick, and the means of before and after: an impulse times the mean
#: speed is its work, exactly. ``spring_N_s`` is the elastic part of the normal impulse. Of a compliant
#: contact there are the penetration and for how long loads act.
KICK = np.dtype(
    _fields(
        "step time_s normal_N_s friction_N_s rate_before mean_rate mean_sliding spring_N_s clipped "
        "depth_m kick_s",
        np.float64,
    )
)

#: A run. Its space, the constant torque on the crank and force on the slider, and whether there is a kick 0.
#: The sweeps of a step in flight and in contact, and how many pins touch natively. Number and time of the
#: last kick, the last kick of this block and of the run, and how many rows are written. Samples, kicks
#: between two of them, or 0 where steps vary, and kicks between two rows that are kept, or 0 for those of
#: samples. Steps: the one before the next kick, the longest in flight and the longest in contact; the time
#: between two samples, the number of the one that comes next, and whether the step leads to it.
RUN = np.dtype(
    [
        ("io", IO),
        *_fields("torque_N_m force_N", np.float64),
        *_fields("half_kick_start flight_sweeps contact_sweeps touching", np.int64),
        *_fields("kick last end row samples per_sample every next_sample leads", np.int64),
        *_fields("time_s step_s flight_s contact_s interval_s", np.float64),
    ]
)

#: A kick whose state is read: its number and time, the step before it, how long loads act in it, whether it
#: is kept and whether it is a sample.
ROW = np.dtype(
    [("kick", np.int64), *_fields("time_s step_s kick_s", np.float64), *_fields("kept sample", np.bool_)]
)
