"""The descriptions of engines, scenes and commands in the code, as Markdown."""

from collections.abc import Iterable, Mapping, Sequence
from inspect import cleandoc
from typing import Any, cast, get_args

from typer.main import get_command

from crankslider.command import app
from engine_models.engine import UnsupportedScene
from engine_models.engines import engine_class, make_engine
from engine_models.scene import format as parts
from engine_models.scene import scene, short
from engine_models.scene.format import Drive, SceneData
from engine_models.scene.library import ALL_SCENES
from engine_models.scene.plain_words import expectation, fields, shown


def _kind(drive: type[SceneData]) -> str:
    """Return the name of a drive in a scene file."""
    return str(get_args(drive.model_fields["kind"].annotation)[0])


#: The sections of a scene file, in their usual order.
SECTIONS: Sequence[tuple[str, type[SceneData]]] = (
    ("The top of the file", short.CrankSlider),
    ("[crank] and [rod]", short.Link),
    ("[slider]", short.Slider),
    ("[start]", short.Start),
    ("[start.crank], [start.rod] and [start.slider]", parts.BodyState),
    *((f'[drive] with kind = "{_kind(drive)}"', drive) for drive in get_args(get_args(Drive)[0])),
    ("[load.crank], [load.rod] and [load.slider]", short.CrankLoad),
    ("[load.crank.gas], and of the others", parts.CrankGas),
    ("[clearance.O], [clearance.A] and [clearance.B], or of any pin", parts.Clearance),
    ("[clearance.B.friction], and of the others", parts.Friction),
    ("The top of a file of any mechanism", scene.Scene),
    ("[ground]", parts.Ground),
    ("[body.NAME]", parts.Body),
    ("[guide.NAME]", parts.Guide),
    ("[spring.NAME], in both forms", parts.Spring),
    ("[load.NAME]", parts.Load),
    ("[load.NAME.gas]", parts.Gas),
    ("[load.NAME.by_time], and of the slider", parts.ByTime),
    ("[start] of any mechanism", parts.PlacedStart),
    ("[start.NAME] of every body", parts.BodyState),
)


def engine(name: str) -> str:
    """Return the documentation of an engine, its settings, and the library scenes that it refuses."""
    kind = engine_class(name)
    said = "\n\n".join(cleandoc(each.__doc__ or "") for each in kind.__mro__ if each is not object)
    settings = _table(("setting", "default", "allowed values"), _rows(kind))
    refusals: dict[str, list[str]] = {}
    for scene_name, make in ALL_SCENES.items():
        try:
            make_engine(name).check(make())
        except UnsupportedScene as reason:
            refusals.setdefault(str(reason), []).append(f"`{scene_name}`")
    count = len(ALL_SCENES) - sum(map(len, refusals.values()))
    refused = _table(("reason", "scenes"), ((reason, ", ".join(them)) for reason, them in refusals.items()))
    runs = f"With its defaults it runs {count} of the {len(ALL_SCENES)} library scenes."
    what = f"{runs} It refuses the others:\n\n{refused}" if refusals else runs
    return f"## Model\n\n{said}\n\n## Settings\n\n{settings}\n\n## Refused scenes\n\n{what}\n"


def scenes() -> str:
    """Return a row for each scene of the library."""
    rows = []
    for name, make in ALL_SCENES.items():
        made, what = make(), (make.__doc__ or "").partition("\n")[0]
        loose = ", ".join(made.joints_with_clearance)
        rows.append((f"`{name}`", made.drive.kind, loose, f"{made.end_time_s:g}", what))
    return _table(("scene", "drive", "clearance", "end time in s", "description"), rows)


def scene_sections() -> str:
    """Return every section of a scene file with the allowed values of its fields."""
    parts = []
    for heading, kind in SECTIONS:
        rows = _table(("field", "default", "allowed values"), _rows(kind))
        parts.append(f"## {heading}\n\n{cleandoc(kind.__doc__ or '')}\n\n{rows}")
    return "\n\n".join(parts)


def commands() -> str:
    """Return the description, the arguments and the options of every command."""
    parts, group = [], cast(Any, get_command(app))
    for name, of in group.commands.items():
        rows = [(f"`{_usage(each)}`", each.help) for each in of.params if getattr(each, "help", None)]
        parts.append(f"## crankslider {name}\n\n{cleandoc(of.help)}\n\n{_table(('', ''), rows)}")
    return "\n\n".join(parts)


def _usage(parameter: Any) -> str:
    """Return an argument or an option as it is typed."""
    metavar = parameter.metavar or ""
    return metavar if parameter.param_type_name == "argument" else f"{parameter.opts[0]} {metavar}".strip()


def _rows(kind: type) -> Iterable[tuple[str, str, str]]:
    """Return name, default and expectation of every field that is a value."""
    for name, field in fields(kind).items():
        takes = expectation(field)
        if "$ref" not in str(field) and "discriminator" not in field:
            yield f"`{name}`", _default(field), takes


def _default(field: Mapping[str, Any]) -> str:
    if "default" not in field:
        return ""
    return "nothing" if field["default"] is None else f"`{shown(field['default'])}`"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown, nothing without rows."""
    lines = [" | ".join(cell.replace("|", "\\|") for cell in row) for row in rows]
    between = " | ".join("---" for _ in head)
    return "\n".join(f"| {line} |" for line in (" | ".join(head), between, *lines)) if lines else ""
