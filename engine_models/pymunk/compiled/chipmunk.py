"""Chipmunk's C functions for compiled code: by the addresses that Pymunk publishes, and checked before use.

A body's state is read, and its loads are set, by the iterators that ``pymunk.batch`` hands to Chipmunk, one
body at a time. They take pointers and numbers alone, no structure by value, and write to a NumPy array. Of
the layouts that this needs cffi knows those of the buffers and of a set of contact points; those of bodies,
spaces and constraints are nobody's business.
"""

import numpy as np
from llvmlite import binding
from numba import types
from numba.extending import intrinsic, register_jitable
from pymunk._chipmunk_cffi import ffi, lib

#: Of everything that is compiled here.
OPTIONS = {"error_model": "numpy"}
INNER = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

#: A pointer to whatever.
POINTER = types.uintp
#: The functions and their types in C.
FUNCTIONS = {
    "pmSpaceBodyGetIteratorFuncBatched": "void(*)(struct cpBody *, void *)",
    "pmSpaceBodySetIteratorFuncBatched": "void(*)(struct cpBody *, void *)",
    "pmSpaceArbiterIteratorFuncBatched": "void(*)(struct cpArbiter *, void *)",
    "cpSpaceStep": "void(*)(struct cpSpace *, double)",
    "cpSpaceSetIterations": "void(*)(struct cpSpace *, int)",
    "cpArbiterSetContactPointSet": "void(*)(struct cpArbiter *, struct cpContactPointSet *)",
    "cpArbiterSetProcessCollision": "void(*)(struct cpArbiter *, unsigned char)",
    "cpArbiterSetRestitution": "void(*)(struct cpArbiter *, double)",
}
#: The buffer of a batch: where its data are for the iterators, and where they count what they have done.
BUFFER = np.dtype([("data", np.uintp), ("count", np.uintp)])
#: A space and what goes in and out of its bodies.
IO = np.dtype([("space", np.uintp), ("state", BUFFER), ("loads", BUFFER), ("turn", BUFFER)])
COUNT = np.dtype([("number", np.intc)])
#: What is read of a body, in m, rad and s, and what is set as loads on it, in N and N m.
BODY = np.dtype([(name, np.float64) for name in ("x", "y", "phi", "v_x", "v_y", "spin")])
LOAD = np.dtype([(name, np.float64) for name in ("x", "y", "torque")])
#: A set of contact points with one point, as far as it is written, where its fields are and how long it is.
POINTS_AT, POINTS_SIZE = [0, 8, 16, 24, 32, 40, 48], 104
POINTS = np.dtype(
    {
        "names": ["count", "normal_x", "normal_y", "bearing_x", "bearing_y", "pin_x", "pin_y"],
        "formats": [np.intc, *[np.float64] * 6],
        "offsets": POINTS_AT,
        "itemsize": POINTS_SIZE,
    }
)


def _symbol(name):
    return f"crankslider_{name}"


def _external(name, *arguments):
    return types.ExternalFunction(_symbol(name), types.void(*arguments))


for _name in FUNCTIONS:
    if hasattr(lib, _name):
        binding.add_symbol(_symbol(_name), int(ffi.cast("uintptr_t", ffi.addressof(lib, _name))))

get_state = _external("pmSpaceBodyGetIteratorFuncBatched", POINTER, POINTER)
set_body = _external("pmSpaceBodySetIteratorFuncBatched", POINTER, POINTER)
get_impulse = _external("pmSpaceArbiterIteratorFuncBatched", POINTER, POINTER)
space_step = _external("cpSpaceStep", POINTER, types.float64)
set_sweeps = _external("cpSpaceSetIterations", POINTER, types.intc)
set_contact_points = _external("cpArbiterSetContactPointSet", POINTER, POINTER)
set_process_collision = _external("cpArbiterSetProcessCollision", POINTER, types.uint8)
set_restitution = _external("cpArbiterSetRestitution", POINTER, types.float64)


def _record_at(_typing, _address, kind):
    record = kind.dtype

    def code(context, builder, _signature, arguments):
        return builder.inttoptr(arguments[0], context.get_value_type(record))

    return record(POINTER, kind), code


#: Takes an address and a NumPy type, in compiled code, and returns the record that is there.
record_at = intrinsic(_record_at)


@register_jitable(**INNER)
def rewound(buffer):
    """Return a buffer's data with the iterators set to its begin."""
    record_at(buffer.count, COUNT).number = 0
    return buffer.data


@register_jitable(**INNER)
def read(bodies, buffer):
    """Read the states of bodies (n,) into a buffer, one behind the other."""
    data = rewound(buffer)
    for body in bodies:
        get_state(body, data)


@register_jitable(**INNER)
def write(bodies, buffer):
    """Set of bodies (n,) what a buffer has for each."""
    data = rewound(buffer)
    for body in bodies:
        set_body(body, data)
