"""What ``crankslider simulate`` is asked for: strings of a command line, checked before anything runs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from engine_models.engine import MOST_SAMPLES, SETTINGS_CONFIG, Engine
from engine_models.engines import ENGINES, engine_class
from engine_models.scene.data import Positive
from engine_models.scene.file import SceneError, load, sources
from engine_models.scene.library import SCENES
from engine_models.scene.plain_words import no_numbers, one_of, refusal, shown
from engine_models.scene.scene import Scene
from studies.failures import BadInput

T = TypeVar("T")

DEFAULT_STEP_S = 1e-5
#: A step below this part of the end time would be lost in the rounding of time itself.
SHORTEST_STEP_PART = 1e-12


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class SimulateOptions:
    """The numeric options of ``simulate``: times in s, tolerance in m of slider position."""

    step: Positive | None = None
    tolerance: Positive | None = None
    end: Positive | None = None
    samples: Annotated[int, Field(ge=1, le=MOST_SAMPLES)] = 200


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class RunOptions:
    """The numeric options of ``run``."""

    jobs: Annotated[int, Field(ge=1, le=1000)]


def checked(kind: type[T], prefix: str, strings: dict[str, str | None]) -> T:
    """Return ``kind`` made from the strings that were given; the prefix makes a field what the user typed.

    Raises:
        BadInput: a field is unknown or its value is refused.
    """
    adapter: TypeAdapter[T] = TypeAdapter(kind)
    given = {key: value for key, value in strings.items() if value is not None}
    if reason := no_numbers(given, kind, prefix):
        raise BadInput(reason)
    try:
        return adapter.validate_strings(given)
    except ValidationError as error:
        raise BadInput(refusal(error, kind, prefix)) from None


def read_scene(name: str, end_s: float | None = None) -> Scene:
    """Return a library scene by its name, or the scene in a TOML file; if given, with another end.

    Raises:
        BadInput: there is no such scene, or it was refused.
    """
    if name not in SCENES and not Path(name).exists():
        raise BadInput(f"SCENE: expected {one_of(list(SCENES))}, or a TOML file, got {shown(name)}")
    try:
        scene = SCENES[name]() if name in SCENES else load(Path(name))
        return scene if end_s is None else scene.model_copy(update={"end_time_s": end_s})
    except SceneError as error:
        raise BadInput(str(error)) from None


def is_source(file: Path, scene: str) -> bool:
    """Return whether a file is one that a scene was read from."""
    if scene in SCENES or not Path(scene).is_file():
        return False
    try:
        return any(file.samefile(source) for source in sources(Path(scene)))
    except OSError:  # what is not there yet is none
        return False


def read_engine(name: str, assignments: Sequence[str], to_tolerance: bool = False) -> Engine:
    """Return the engine of this name with settings given as ``KEY=VALUE``, the rest at their defaults.

    To keep a tolerance, an engine that can control its error does, unless ``method`` is among the settings.

    Raises:
        BadInput: the engine or a setting is unknown, or a value is refused.
    """
    if name not in ENGINES:
        raise BadInput(f"--engine: expected {one_of(list(ENGINES))}, got {shown(name)}")
    settings: dict[str, str | None] = {}
    for assignment in assignments:
        key, equals, value = assignment.partition("=")
        if not (key and equals):
            raise BadInput(f"--set: expected KEY=VALUE, got {shown(assignment)}")
        if key in settings:
            raise BadInput(f"--set {key}: expected one value, got {settings[key]} and {value}")
        settings[key] = value
    engine: Engine = checked(engine_class(name), "--set ", settings)
    if to_tolerance and hasattr(engine, "controlling_error") and "method" not in settings:
        engine = engine.controlling_error()
    return engine


def longest_step_s(options: SimulateOptions, end_time_s: float, engine: Engine) -> float:
    """Return the step asked for or the default, which is the whole run for an engine that controls its error.

    Raises:
        BadInput: there is a tolerance beside the step, or the step does not fit the end time.
    """
    if options.step is not None and options.tolerance is not None:
        raise BadInput(f"--tolerance: expected nothing beside --step, got {options.tolerance:g}")
    default = end_time_s if getattr(engine, "controls_error", False) else min(DEFAULT_STEP_S, end_time_s)
    step = options.step or default
    shortest = SHORTEST_STEP_PART * end_time_s
    if options.tolerance is None and not shortest <= step <= end_time_s:
        expected = f"a number from {shortest:g} to the end time {end_time_s:g}"
        raise BadInput(f"--step: expected {expected}, got {step:g}")
    return step
