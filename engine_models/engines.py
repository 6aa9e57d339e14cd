"""The engines by name, each imported only when asked for. A new engine is a new file and a line here.

An engine from outside needs no line: it is named by where its class is, ``my_module:MyEngine``, or by an
entry point of the group ``crankslider.engines``.
"""

import os
import sys
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from pydantic import ValidationError

from engine_models.engine import Engine
from engine_models.scene.plain_words import BadInput, fields, one_of, refusal, unknown

#: The group of entry points by which installed packages bring engines.
GROUP = "crankslider.engines"
#: What an engine's class has to have.
METHODS = ("check", "simulate")

_CLASSES = {
    "reference": ("engine_models.reference.engine", "ReferenceEngine"),
    "exudyn": ("engine_models.exudyn.engine", "ExudynEngine"),
    "pymunk": ("engine_models.pymunk.engine", "PymunkEngine"),
    "scipy": ("engine_models.minimal.engine", "ScipyEngine"),
}
_CLASSES |= {it.name: (it.module, it.attr) for it in entry_points(group=GROUP) if it.name not in _CLASSES}

#: The names of all engines that take part in studies; one that joins is among them.
ENGINES = _CLASSES.keys()


def join(name: str) -> None:
    """Let the engine ``my_module:MyEngine`` take part in this process's studies; a known name does already.

    Raises:
        BadInput: there is no such engine, or it is none.
    """
    engine_class(name)
    _CLASSES[name] = _place(name)


def engine_module(name: str) -> str:
    """Return the import path of the module that an engine's class is in; nothing is imported.

    Raises:
        BadInput: no engine has this name.
    """
    return _place(name)[0]


def engine_class(name: str) -> Any:
    """Return the settings class of an engine; one from outside need not name its base class.

    Raises:
        BadInput: no engine has this name, or what has it cannot be imported, or is no engine.
    """
    module, attribute = _place(name)
    if ":" in name and os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())  # last: nothing there hides what is installed
    try:
        kind = getattr(import_module(module), attribute)
    except Exception as error:
        if name not in _CLASSES or isinstance(error, ModuleNotFoundError | AttributeError):
            raise BadInput(f"engine {name}: expected a class that can be imported, got '{error}'") from error
        raise
    lacking = [method for method in METHODS if not callable(getattr(kind, method, None))]
    if lacking:
        raise BadInput(f"engine {name}: expected the methods {', '.join(METHODS)}, got no {lacking[0]}")
    if issubclass(kind, Engine):
        return kind
    return type(kind.__name__, (kind, Engine), {"__doc__": kind.__doc__, "__module__": kind.__module__})


def make_engine(name: str, **settings: object) -> Engine:
    """Return an engine with the given settings, the rest at their defaults.

    Raises:
        BadInput: no engine has this name, or the engine no such setting or not of this value.
    """
    kind = engine_class(name)
    try:
        engine: Engine = kind(**settings)
    except ValidationError as error:
        raise BadInput(refusal(error, fields(kind))) from None
    return engine


def _place(name: str) -> tuple[str, str]:
    """Return the module and the name of an engine's class."""
    module, colon, attribute = name.partition(":")
    if name not in _CLASSES and not (module and colon and attribute.isidentifier()):
        expected = one_of([*ENGINES, "my_module:MyEngine"])
        raise BadInput(unknown("engine", name, ENGINES, expected))
    return _CLASSES.get(name, (module, attribute))
