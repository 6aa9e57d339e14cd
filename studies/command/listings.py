"""What there is: the text of ``crankslider scenes`` and ``crankslider engines``."""

from collections.abc import Sequence

from engine_models.engine import UnsupportedScene
from engine_models.engines import ENGINES, engine_class, make_engine
from engine_models.scene.library import SCENES
from engine_models.scene.plain_words import expectation, fields, shown


def scene_listing() -> str:
    """Return a line for each library scene: name, drive, joints with clearance, end time, description."""
    rows = [("scene", "drive", "clearance", "end time", "")]
    for name, make in SCENES.items():
        scene = make()
        joints = ", ".join(scene.joints_with_clearance) or "none"
        rows.append((name, scene.drive.kind, joints, f"{scene.end_time_s:g} s", _summary(make)))
    return _aligned(rows)


def engine_listing() -> str:
    """Return each engine with its settings (default, allowed values) and the library scenes it can run."""
    return "\n\n".join(_engine(name) for name in ENGINES)


def _engine(name: str) -> str:
    cls = engine_class(name)
    settings = [
        (f"  {key}", shown(field["default"]), expectation(field)) for key, field in fields(cls).items()
    ]
    return f"{name}: {_summary(cls)}\n{_aligned(settings)}\n{_support(name)}"


def _support(engine: str) -> str:
    """Return the library scenes that an engine at its defaults runs, and those it refuses with the reason."""
    runs, refused = [], []
    for name, make in SCENES.items():
        try:
            make_engine(engine).check(make())
            runs.append(name)
        except UnsupportedScene as reason:
            refused.append(f"\n  not {name}: {reason}")
    return f"  runs {', '.join(runs)}" + "".join(refused)


def _summary(documented: object) -> str:
    """Return the first line of a docstring."""
    return (documented.__doc__ or "").partition("\n")[0]


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    """Return rows as lines with every column as wide as its widest cell."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "\n".join(lines)
