"""The compiled loop of contacts, one for all mechanisms."""

from pathlib import Path
from types import ModuleType

from reference_solver.kernel_store import load_kernel

LOOP = Path(__file__).with_name("contact_loop.py")


def load_driver() -> ModuleType:
    """Return ``contact_loop``, its machine code kept beside that of the kernels that it calls."""
    return load_kernel(LOOP.read_text(encoding="utf-8"))
