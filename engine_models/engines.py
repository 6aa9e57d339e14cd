"""The engines by name, each imported only when asked for. A new engine is a new file and a line here."""

from importlib import import_module
from typing import Any

from pydantic import ValidationError

from engine_models.engine import Engine
from engine_models.scene.plain_words import meant, one_of, refusal, shown

_CLASSES = {
    "reference": ("engine_models.reference.engine", "ReferenceEngine"),
    "exudyn": ("engine_models.exudyn.engine", "ExudynEngine"),
    "pymunk": ("engine_models.pymunk.engine", "PymunkEngine"),
    "scipy": ("engine_models.scipy_ivp.engine", "ScipyEngine"),
}

ENGINES = tuple(_CLASSES)


def engine_module(name: str) -> str:
    """Return the import path of the module that an engine's class is in; nothing is imported.

    Raises:
        ValueError: no engine has this name.
    """
    return _place(name)[0]


def engine_class(name: str) -> Any:
    """Return the settings class of an engine.

    Raises:
        ValueError: no engine has this name.
    """
    module, cls = _place(name)
    return getattr(import_module(module), cls)


def make_engine(name: str, **settings: object) -> Engine:
    """Return an engine with the given settings, the rest at their defaults.

    Raises:
        ValueError: no engine has this name, or the engine no such setting or not of this value.
    """
    kind = engine_class(name)
    try:
        engine: Engine = kind(**settings)
    except ValidationError as error:
        raise ValueError(refusal(error, kind)) from None
    return engine


def _place(name: str) -> tuple[str, str]:
    """Return the module and the name of an engine's class."""
    if name not in _CLASSES:
        raise ValueError(f"engine: expected {one_of(list(ENGINES))}, got {shown(name)}{meant(name, ENGINES)}")
    return _CLASSES[name]
