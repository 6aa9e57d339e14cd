"""The text of ``crankslider scenes`` and ``crankslider engines``."""

import re
from collections.abc import Sequence
from inspect import cleandoc
from textwrap import indent, shorten

from engine_models.engine import UnsupportedScene
from engine_models.engines import ENGINES, engine_class, make_engine
from engine_models.scene.library.mechanisms import ALL_SCENES
from engine_models.scene.plain_words import expectation, fields, meant, one_of, shown
from studies.failures import BadInput

#: Longest text of the values of a setting, and of its description, in characters.
LONGEST_CHOICE, LONGEST_CLAUSE = 60, 100


def scene_listing() -> str:
    """Return a line for each library scene: name, drive, joints with clearance, end time, description."""
    rows = [("scene", "drive", "clearance", "end time", "")]
    for name, make in ALL_SCENES.items():
        scene = make()
        joints = ", ".join(scene.joints_with_clearance) or "none"
        rows.append((name, scene.driven_by.kind, joints, f"{scene.end_time_s:g} s", _summary(make)))
    return _aligned(rows)


def engine_listing() -> str:
    """Return each engine with its settings, a line on each, and the library scenes it can run."""
    return "\n\n".join(
        f"{name}: {_summary(engine_class(name))}\n{_settings(name)}\n{_support(name)}" for name in ENGINES
    )


def engine_in_full(name: str) -> str:
    """Return the description of one engine: its documentation, its settings and the scenes that it runs.

    Raises:
        BadInput: there is no such engine.
    """
    if name not in ENGINES:
        raise BadInput(f"NAME: expected {one_of(list(ENGINES))}, got {shown(name)}{meant(name, ENGINES)}")
    cls = engine_class(name)
    settings = [
        (f"  {key}", shown(field["default"]), expectation(field)) for key, field in fields(cls).items()
    ]
    return f"{name}\n{indent(_documentation(cls), '  ')}\n\n{_aligned(settings)}\n{_support(name)}"


def _settings(engine: str) -> str:
    """Return a line for each setting: name, default, allowed values, description."""
    cls = engine_class(engine)
    rows = []
    for key, field in fields(cls).items():
        allowed = shorten(expectation(field), LONGEST_CHOICE, placeholder=" ...")
        rows.append((f"  {key}", shown(field["default"]), allowed, _explained(key, _documentation(cls))))
    return _aligned(rows)


def _documentation(cls: type) -> str:
    """Return the docstring of an engine, and those of its base classes."""
    ours = (kind for kind in cls.__mro__ if kind is not object)
    return "\n\n".join(cleandoc(kind.__doc__ or "") for kind in ours)


def _explained(setting: str, documentation: str) -> str:
    """Return the first clause of a documentation that names the setting, as one line."""
    clauses = re.split(r"(?<=[.:;]) (?=[A-Z`])", " ".join(documentation.split()))
    named = re.compile(rf"``{setting}( = [^`]*)?``")
    clause = next((clause for clause in clauses if named.search(clause)), "")
    return shorten(clause.replace("``", "").rstrip(".:;"), LONGEST_CLAUSE, placeholder=" ...")


def _support(engine: str) -> str:
    """Return the library scenes that an engine runs at its defaults, and those that it refuses, by reason."""
    runs, refused = list[str](), dict[str, list[str]]()
    for name, make in ALL_SCENES.items():
        try:
            make_engine(engine).check(make())
            runs.append(name)
        except UnsupportedScene as reason:
            refused.setdefault(str(reason), []).append(name)
    lines = [f"  runs {', '.join(runs) or 'no scene'}"]
    if not runs and len(refused) == 1:
        return f"{lines[0]}: {next(iter(refused))}"
    return "\n".join(lines + [f"  not {', '.join(names)}: {reason}" for reason, names in refused.items()])


def _summary(documented: object) -> str:
    """Return the first line of a docstring."""
    return (documented.__doc__ or "").partition("\n")[0]


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    """Return rows as lines of aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "\n".join(lines)
