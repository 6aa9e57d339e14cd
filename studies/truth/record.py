"""A mechanism in numbers: one array of reals, one of whole numbers, and the parts of them by name.

A compiled function is passed the two, which costs nothing, and not the parts, of which every call would copy
hundreds of words.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from studies.truth.machine import allocating, within
from studies.truth.physics import Drive, Loads
from studies.truth.tables import Tables
from studies.truth.tree import Tree, Work

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: States in ``room``: the end of a step takes two.
ROOM = 9
END, REST, WEIGHTS, TRIAL, TRIAL_REST, SLOPE, ASIDE, OUT, TOLD = range(ROOM)
#: Sums of a joint in a state: of its normal force, and of what that and clipping and friction dissipate; and
#: what is told of one: the forces, and the sliding speed.
OF_JOINT, OF_TOLD = 4, 3
#: Where ``Packed.at`` has the order of coordinates, the independent ones, and those of them that move freely.
ORDER, INDEPENDENT, FREE = 15, 56, 58


class Mechanism(NamedTuple):
    """All that decides the motion but its start, and room for what is computed at one state.

    ``walls`` (k, 14) has the columns of ``physics``. ``joints`` (k, 3) has of each loose pin the first
    coordinate of its gap, and the angles of pin and bearing. ``masses`` (2 bodies,) are in kg, ``weights``
    (2 bodies,) in N, ``inertias`` (angles,) in kg m^2. ``driven`` is a coordinate whose motion is prescribed,
    or NONE, ``begin`` where it is at t = 0. ``kinks`` (g, 4) has of each table that goes by the state its
    number, the coordinate that it goes by, 1 if by the rate of that, and its place in the phases; ``beside``
    (g,) is what is added to the coordinate.

    ``Jz`` (rows, n) is J T of the rows that act; M (n, n), q and ``answer`` (n,), A (f, f) and a (f,) of
    those coordinates that are not driven, Q and ``row`` (m,) and ``room`` (9, state) are room.
    """

    tree: Tree
    work: Work
    walls: FloatArray
    joints: IntArray
    masses: FloatArray
    weights: FloatArray
    inertias: FloatArray
    drive: Drive
    driven: int
    begin: float
    loads: Loads
    tables: Tables
    kinks: IntArray
    beside: FloatArray
    Jz: FloatArray
    M: FloatArray
    q: FloatArray
    A: FloatArray
    a: FloatArray
    answer: FloatArray
    Q: FloatArray
    row: FloatArray
    swaps: IntArray
    room: FloatArray


class Watched(NamedTuple):
    """What of a mechanism says where its equations change: to be passed all would take long to compile."""

    walls: FloatArray
    joints: IntArray
    tables: Tables
    kinks: IntArray
    beside: FloatArray
    row: FloatArray
    room: FloatArray


class Packed(NamedTuple):
    """A mechanism as it is passed on: its parts are views of these, by ``parts``.

    ``at`` (parts, 4) has where each begins and ends, and its rows and columns; ``told`` and ``size`` are how
    many numbers are told, and how many coordinates there are.
    """

    reals: FloatArray
    wholes: IntArray
    at: IntArray
    told: int
    size: int


def numbers_in(part: Any) -> Iterator[NDArray[Any]]:
    """Yield all arrays and numbers of a tuple of tuples."""
    if isinstance(part, tuple):
        for each in part:
            yield from numbers_in(each)
    else:
        yield np.asarray(part)


def packed(m: Mechanism) -> Packed:
    """Return the numbers of a mechanism; its arrays are copied."""
    reals, wholes, at = list[Any](), list[Any](), list[tuple[int, ...]]()
    told = OF_TOLD * len(m.walls) + 1 + len(m.loads.what)
    for part in numbers_in(m):
        kept = reals if part.dtype == float else wholes
        at.append((len(kept), len(kept) + part.size, *part.shape, 1, 1)[:4])
        kept += part.ravel().tolist()
    return Packed(np.array(reals), np.array(wholes, np.int64), np.array(at, np.int64), told, len(m.row))


def views(p: Packed, like: Any) -> Any:
    """Return what ``parts`` does, as Python has it: tuples ``like`` those packed."""
    places, kinds = iter(p.at.tolist()), numbers_in(like)

    def view(part: Any) -> Any:
        if isinstance(part, tuple):
            return type(part)(*map(view, part))
        (begin, end, *_), kind = next(places), next(kinds)
        found = (p.reals if kind.dtype == float else p.wholes)[begin:end]
        return found.reshape(kind.shape) if kind.shape else found[0].item()

    return view(like)


@within
def parts(p: Packed) -> Mechanism:
    """Return the mechanism whose numbers are those of ``packed``, in its order.

    It counts no references, and is for functions that do not allocate.
    """
    r, i, (at, to, n, k) = p.reals, p.wholes, (p.at[:, 0], p.at[:, 1], p.at[:, 2], p.at[:, 3])
    tree = Tree(
        *(i[at[0]], i[at[1]], i[at[2]], i[at[3]], i[at[4]]),
        i[at[5] : to[5]].reshape((n[5], k[5])),
        r[at[6] : to[6]].reshape((n[6], k[6])),
        i[at[7] : to[7]].reshape((n[7], k[7])),
        *(r[at[8] : to[8]], r[at[9] : to[9]], r[at[10] : to[10]].reshape((n[10], k[10]))),
        i[at[11] : to[11]].reshape((n[11], k[11])),
        *(r[at[12] : to[12]].reshape((n[12], k[12])), r[at[13] : to[13]]),
        i[at[14] : to[14]],
    )
    work = Work(
        *(i[at[15] : to[15]], i[at[16] : to[16]]),
        *(r[at[17] : to[17]], r[at[18] : to[18]], r[at[19] : to[19]].reshape((n[19], k[19]))),
        *(r[at[20] : to[20]].reshape((n[20], k[20])), r[at[21] : to[21]], r[at[22] : to[22]]),
        *(r[at[23] : to[23]].reshape((n[23], k[23])), r[at[24] : to[24]].reshape((n[24], k[24]))),
        *(r[at[25] : to[25]], r[at[26] : to[26]].reshape((n[26], k[26]))),
        i[at[27] : to[27]],
        *(r[at[28] : to[28]], r[at[29] : to[29]].reshape((n[29], k[29]))),
        i[at[30] : to[30]],
    )
    drive = Drive(i[at[36]], i[at[37]], i[at[38]], i[at[39]], r[at[40]], r[at[41]], r[at[42]], r[at[43]])
    loads = Loads(
        i[at[46] : to[46]].reshape((n[46], k[46])), r[at[47] : to[47]].reshape((n[47], k[47])), r[at[48]]
    )
    tables = Tables(
        i[at[49] : to[49]].reshape((n[49], k[49])),
        r[at[50] : to[50]].reshape((n[50], k[50])),
        r[at[51] : to[51]].reshape((n[51], k[51])),
    )
    return Mechanism(
        tree,
        work,
        r[at[31] : to[31]].reshape((n[31], k[31])),
        i[at[32] : to[32]].reshape((n[32], k[32])),
        *(r[at[33] : to[33]], r[at[34] : to[34]], r[at[35] : to[35]]),
        drive,
        i[at[44]],
        r[at[45]],
        loads,
        tables,
        i[at[52] : to[52]].reshape((n[52], k[52])),
        *(r[at[53] : to[53]], r[at[54] : to[54]].reshape((n[54], k[54]))),
        *(r[at[55] : to[55]].reshape((n[55], k[55])), r[at[56] : to[56]]),
        *(r[at[57] : to[57]].reshape((n[57], k[57])), r[at[58] : to[58]], r[at[59] : to[59]]),
        *(r[at[60] : to[60]], r[at[61] : to[61]]),
        i[at[62] : to[62]],
        r[at[63] : to[63]].reshape((n[63], k[63])),
    )


@allocating
def moving(p: Packed) -> IntArray:
    """Return the coordinates that move on their own."""
    order, n, free = p.at[ORDER, 0], p.at[INDEPENDENT, 2], p.at[FREE, 2]
    return p.wholes[order + n - free : order + n]
