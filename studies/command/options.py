"""The options of ``crankslider simulate``: strings of the command line, checked before anything runs."""

import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import Field, InstanceOf, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from engine_models.engine import MOST_SAMPLES, SETTINGS_CONFIG, Engine
from engine_models.engines import engine_class
from engine_models.scene.data import Duration, Positive
from engine_models.scene.file import SceneError, load, sources
from engine_models.scene.library.mechanisms import ALL_SCENES
from engine_models.scene.parts import AnyScene
from engine_models.scene.plain_words import expect, fields, meant, no_numbers, one_of, refusal, shown, typed
from studies.failures import BadInput

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

T = TypeVar("T")

#: A number of equal output intervals.
Samples = Annotated[int, Field(ge=1, le=MOST_SAMPLES)]
#: A scene as users may give one.
SomeScene = Annotated[
    InstanceOf[AnyScene] | str | Path, expect(f"{one_of(list(ALL_SCENES))}, or a TOML file")
]
#: Endings of the files of figures and of animations.
PICTURES, FILMS = (".png", ".svg", ".pdf"), (".html", ".gif", ".mp4")
#: What runs in all engines, in truths and in studies.
DEFAULT_STEP_S = 1e-5
#: A step below this part of the end time is lost to the rounding of time.
SHORTEST_STEP_PART = 1e-12


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class SimulateOptions:
    """The numeric options of ``simulate``: times in s, tolerance in m of slider position."""

    step: Positive | None = None
    tolerance: Positive | None = None
    end: Duration | None = None
    samples: Samples = 200


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class FilmOptions:
    """The factor by which an animation enlarges clearances."""

    exaggerate: Positive = 1.0


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class RunOptions:
    """The numeric options of ``run``."""

    jobs: Annotated[int, Field(ge=1, le=1000)]


@contextmanager
def as_arguments(**names: str) -> Iterator[None]:
    """Make refusals in the block name the arguments of a function instead of the options of the command line.

    ``names`` maps an option to its argument where the two names differ.
    """
    try:
        yield
    except BadInput as error:
        said = str(error).replace("SCENE:", "scene:", 1)
        raise BadInput(re.sub(r"--(?:set )?(\w+)", lambda it: names.get(it[1], it[1]), said)) from None


def checked(kind: type[T], prefix: str, values: Mapping[str, object]) -> T:
    """Return ``kind`` made from the values that are not None: strings, or values that can be typed as one.

    The prefix turns the name of a field into what the user typed.

    Raises:
        BadInput: a field is unknown or its value is refused.
    """
    adapter: TypeAdapter[T] = TypeAdapter(kind)
    known = fields(kind)
    given = {key: value for key, value in values.items() if value is not None or key not in known}
    if reason := no_numbers(given, kind, prefix):
        raise BadInput(reason)
    try:
        return adapter.validate_strings({key: typed(value) for key, value in given.items()})
    except ValidationError as error:
        raise BadInput(refusal(error, kind, prefix)) from None


def read_scene(
    scene: str | Path | AnyScene, assignments: Sequence[str] = (), end_s: float | None = None
) -> AnyScene:
    """Return a library scene by its name, the scene in a TOML file, or a scene itself, with changes.

    Changes are assignments ``FIELD=VALUE``, with values as in TOML, and another end time. A scene is checked
    once, after all changes.

    Raises:
        BadInput: there is no such scene, an assignment has another form, or the scene is refused.
    """
    fields = _fields(assignments)
    changes = fields if end_s is None else {**fields, "end_time_s": end_s}
    own: AnyScene
    if isinstance(scene, AnyScene):
        own = scene
    elif (name := str(scene)) in ALL_SCENES:
        own = ALL_SCENES[name]()
    else:
        return load(_scene_file(name), changes, "--with")
    try:
        return own.replace(changes) if changes else own
    except SceneError as error:
        raise BadInput(f"--with {error}" if fields else str(error)) from None


def _scene_file(name: str) -> Path:
    if not os.path.exists(name):  # pathlib's raises for a name that is too long
        if "/" in name or name.endswith(".toml"):
            raise BadInput(f"SCENE: expected a TOML file that is there, got {shown(name)} (no such file)")
        expected = f"{one_of(list(ALL_SCENES))}, or a TOML file"
        raise BadInput(f"SCENE: expected {expected}, got {shown(name)}{meant(name, ALL_SCENES)}")
    return Path(name)


def _fields(assignments: Sequence[str]) -> dict[str, object]:
    return {field: _value(text) for field, text in assigned("--with", "FIELD=VALUE", assignments).items()}


def _value(text: str) -> object:
    """Return the TOML value of a text, or the text itself if it is none."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


def assigned(option: str, form: str, assignments: Sequence[str]) -> dict[str, str]:
    """Return the values of assignments, each of a ``form`` such as ``KEY=VALUE``, by their keys.

    Raises:
        BadInput: one has another form, or a key has two values.
    """
    values: dict[str, str] = {}
    for assignment in assignments:
        key, equals, value = assignment.partition("=")
        if not (key and equals):
            raise BadInput(f"{option}: expected {form}, got {shown(assignment)}")
        if key in values:
            raise BadInput(f"{option} {key}: expected one value, got {values[key]} and {value}")
        values[key] = value
    return values


def is_source(file: Path, scene: str, assignments: Sequence[str] = ()) -> bool:
    """Return whether a file is one that a scene was read from, with some changes."""
    if scene in ALL_SCENES or not Path(scene).is_file():
        return False
    try:
        return any(file.samefile(source) for source in sources(Path(scene), _fields(assignments)))
    except OSError:  # a file that is not there yet is no source
        return False


def ending_of(option: str, path: Path, known: Iterable[str]) -> str:
    """Return the ending of a file's name in lower case.

    Raises:
        BadInput: it is not among ``known``.
    """
    ending = path.suffix.lower()
    if ending not in known:
        expected = f"a file that ends in {one_of([each for each in known if each])}"
        raise BadInput(f"{option}: expected {expected}, got {shown(str(path))}")
    return ending


def film_ending(path: Path) -> str:
    """Return the ending of an animation's file.

    Raises:
        BadInput: it is not one of an animation, or it is .mp4 without ffmpeg.
    """
    from reports.run.film import can_write

    ending = ending_of("--animate", path, FILMS)
    if not can_write(ending):
        expected = "a file that ends in .html or .gif where ffmpeg is not installed"
        raise BadInput(f"--animate: expected {expected}, got {shown(str(path))}")
    return ending


def read_engine(name: str, settings: Mapping[str, object], to_tolerance: bool = False) -> Engine:
    """Return the engine of this name with the settings given, the rest at their defaults.

    For a tolerance, an engine that can control its error does so, unless ``method`` is among the settings. If
    ``step_tolerance`` is among them, it starts with that.

    Raises:
        BadInput: the engine or a setting is unknown, or a value is refused.
    """
    try:
        kind = engine_class(name)
    except ValueError as reason:
        raise BadInput(f"--{reason}") from None
    engine: Engine = checked(kind, "--set ", settings)
    if to_tolerance and "method" not in settings:
        given = {"step_tolerance": vars(engine)["step_tolerance"]} if "step_tolerance" in settings else {}
        engine = engine.controlling_error(**given)
    return engine


def longest_step_s(options: SimulateOptions, end_time_s: float, engine: Engine) -> float:
    """Return the step asked for, or the default: the whole run for an engine that controls its error.

    Raises:
        BadInput: there are both a tolerance and a step, or the step does not fit the end time.
    """
    if options.step is not None and options.tolerance is not None:
        raise BadInput(f"--tolerance: expected nothing beside --step, got {options.tolerance:g}")
    default = end_time_s if engine.controls_error else min(DEFAULT_STEP_S, end_time_s)
    step = options.step or default
    shortest = SHORTEST_STEP_PART * end_time_s
    if options.tolerance is None and not shortest <= step <= end_time_s:
        expected = f"a number from {shortest:g} to the end time {end_time_s:g}"
        came = f"{step:g}" if options.step else f"none, which is {step:g}"
        raise BadInput(f"--step: expected {expected}, got {came}")
    return step
