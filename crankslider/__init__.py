"""Planar mechanisms with joint clearance, from Python; the commands of the same names are these functions.

    import crankslider as cs

    run = cs.simulate("clearance-driven-0.5mm", end=0.012, tolerance=1e-8)
    run.frame["slider_position_m"]      # pandas, over time_s
    run.plot_orbit("B")

Bad input raises ``BadInput``, work that breaks down ``Failed``.
"""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from crankslider.library import __version__ as __version__
    from crankslider.library import compare, load, scenes, simulate, sweep, truth
    from crankslider.run import Run
    from engine_models.scene.scene import Scene
    from studies.failures import BadInput, Failed

__all__ = ["BadInput", "Failed", "Run", "Scene", "compare", "load", "scenes", "simulate", "sweep", "truth"]

for _name in ("reference_solver", "engine_models", "studies", "reports"):
    _spec = find_spec(_name)
    if _spec is None or Path(__file__).parents[1] not in Path(str(_spec.origin)).parents:
        _place = _spec and (_spec.origin or [*(_spec.submodule_search_locations or ())])
        raise ImportError(f"{_name}: expected crankslider's own, got {_place}: rename what is there")


def __getattr__(name: str) -> Any:
    """Return what is in ``library``, loaded when it is first asked for: the command's help needs nothing."""
    if name in {*__all__, "__version__"}:
        return getattr(import_module("crankslider.library"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
