"""The engines by name, each imported only when asked for. A new engine is a new file and a line here."""

from importlib import import_module
from typing import Any

from engine_models.engine import Engine

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
        KeyError: no engine has this name.
    """
    return _CLASSES[name][0]


def engine_class(name: str) -> Any:
    """Return the settings class of an engine.

    Raises:
        KeyError: no engine has this name.
    """
    module, cls = _CLASSES[name]
    return getattr(import_module(module), cls)


def make_engine(name: str, **settings: object) -> Engine:
    """Return an engine with the given settings, the rest at their defaults."""
    engine: Engine = engine_class(name)(**settings)
    return engine
