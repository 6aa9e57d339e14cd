"""The compiled face of ``contact_loop``, one for all mechanisms: it calls their kernels by address.

Compiling it takes twice as long as a kernel with contacts, so it is not a part of each. The price is a call
by address in every step (5 % of one), and 40 us a function in every call from Python.
"""

import inspect
from types import ModuleType

from reference_solver import contact_events, contact_loop, contact_samples
from reference_solver.compiled import load_kernel
from reference_solver.contact_events import CLIPPED, CONTACT, FLIGHT, PROBE
from reference_solver.kernel import ENTRY, HEADER, INNER

TYPES = f"""from __future__ import annotations

import numpy as np
from numba.types import FunctionType, Tuple, boolean, float64, int64

ARRAY, TABLE = float64[::1], float64[:, ::1]
STEP = FunctionType(boolean(*(ARRAY,) * 4, float64, float64, *(ARRAY,) * 3, TABLE))
GAP_ACCELERATIONS = FunctionType(boolean(ARRAY, ARRAY, float64, *(ARRAY,) * 3))
SLOPES = FunctionType(boolean(ARRAY, ARRAY, float64, *(ARRAY,) * 5))
ADVANCE = Tuple((float64, int64, int64, int64, int64))(
    STEP, GAP_ACCELERATIONS, SLOPES, ARRAY, ARRAY, TABLE, TABLE, ARRAY, ARRAY, TABLE, ARRAY,
    float64, float64, ARRAY, TABLE, ARRAY, TABLE, int64,
)  # fmt: skip

FLIGHT, CONTACT, CLIPPED, PROBE = {FLIGHT}, {CONTACT}, {CLIPPED}, {PROBE}
INSIDE = {contact_samples.INSIDE!r}
"""


def load_driver() -> ModuleType:
    """Return a module with ``advance`` of ``contact_loop``."""
    texts = [inspect.getsource(module) for module in (contact_events, contact_samples, contact_loop)]
    text = "".join(text[text.index("\n\n\ndef ") :] for text in texts)
    text = compiled(text, "advance").replace("(**ENTRY)\ndef advance", "(ADVANCE, **ENTRY)\ndef advance")
    return load_kernel(TYPES + HEADER + text)


def compiled(text: str, entry: str) -> str:
    """Return the text of functions, each compiled, with ``entry`` for Python to call."""
    text = text.replace("\ndef ", f"\n@njit({INNER})\ndef ")
    return text.replace(f"\n@njit({INNER})\ndef {entry}(", f"\n@njit({ENTRY})\ndef {entry}(")
