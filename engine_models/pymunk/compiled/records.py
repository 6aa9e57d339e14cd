"""What the compiled loop, the contacts' functions and Python share: records of a run, its pins and its loads.

Bodies are rows of the loop's state; the last row, of zeros, is the ground's. Places are from their origins.
"""

import numpy as np

from engine_models.pymunk.compiled.chipmunk import IO

#: Where a pin is: in flight, in contact, through the wall of its bearing, or where numbers overflow.
FLIGHT, CONTACT, LOST, OVERFLOWN = range(4)


def _fields(names: str, kind: type) -> list[tuple[str, type]]:
    return [(name, kind) for name in names.split()]


#: A pin in its bearing. The rows of its two bodies; the places of bearing and pin, clearance and bearing's
#: radius in m, which is also the distance of the two centres beyond which the pin is lost; the constants of
#: its law (see ``LawNumbers``). Then its phase, whether a contact is ``fresh``, its approach
#: speed, and the geometry: d, n, what leads from the origins of both bodies to the centres of bearing and
#: pin, and from there along n to the contact point. ``kicks`` counts the kicks in contact that the log has,
#: and ``native`` tells a native contact.
PIN = np.dtype(
    [
        *_fields("bearing pin native phase fresh kicks", np.int64),
        *_fields("x_i y_i x_j y_j clearance radius", np.float64),
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

#: How the space has a body: its weight in N and the place of its centre of mass; what takes the space's
#: gravity back, in N, of one that is ``lifted``; the direction of one that ``runs`` along a line.
HELD = np.dtype(
    [
        *_fields("lifted runs", np.bool_),
        *_fields("weight_x weight_y centre_x centre_y lift_x lift_y u_x u_y", np.float64),
    ],
    align=True,
)

#: A curve: its first piece and how many there are, its period in x or 0, and whether it keeps its end values
#: beyond ``last``. Wherever a load names a curve by its number, -1 is none.
CURVE = np.dtype([*_fields("first count keeps", np.int64), *_fields("period last", np.float64)])
#: Forces along a line of row i, through a place and along (u_x, u_y) of its axes, on a place of row j: in N,
#: N s/m and N/m, with the way in m at which the spring is free; curves over a row's angle and over time. Here
#: and of torques a damper of the row's ``own`` feels the velocity before the kick, others one foreseen.
LINE = np.dtype(
    [
        *_fields("row_i row_j gas gas_row by_time own", np.int64),
        *_fields("x_i y_i u_x u_y x_j y_j force viscous spring free", np.float64),
    ]
)
#: Torques on a row, in N m and N m s; curves over time and over its speed.
TORQUE = np.dtype([*_fields("row by_time by_speed own", np.int64), *_fields("torque viscous", np.float64)])
#: A spring with a damper between places of two rows.
SPRING = np.dtype(
    [*_fields("row_i row_j", np.int64), *_fields("x_i y_i x_j y_j stiffness free damping", np.float64)]
)

#: A run. Its space, what its clock reads as it begins, and whether there is a kick 0. How many rows are
#: loaded in every step, how many are followed from step to step, and whether a load feels their velocities;
#: the row that is driven. The sweeps of a
#: step in flight and in contact, and how many pins touch natively. Number and time of the last kick, the last
#: kick of this block and of the run, and how many rows of results are written. Samples, kicks between two of
#: them, or 0 where steps vary, and kicks between two that are kept, or 0 for those of samples. Steps: the one
#: before the next kick, for how long loads acted in the last one, the longest in flight and in contact; the
#: time between two samples, the number of the one that comes next, and whether the step leads to it.
RUN = np.dtype(
    [
        ("io", IO),
        *_fields("clock_s", np.float64),
        *_fields(
            "half_kick_start loaded followed feels driven flight_sweeps contact_sweeps touching", np.int64
        ),
        *_fields("kick last end row samples per_sample every next_sample leads", np.int64),
        *_fields("time_s step_s kick_s flight_s contact_s interval_s", np.float64),
    ]
)

#: A kick whose state is read: its number and time, the step before it, how long loads act in it, whether it
#: is kept and whether it is a sample.
ROW = np.dtype(
    [("kick", np.int64), *_fields("time_s step_s kick_s", np.float64), *_fields("kept sample", np.bool_)]
)
