"""The engines that can be asked for a scene: those that support it."""

from engine_models.engine import Engine, UnsupportedScene
from engine_models.engines import ENGINES, make_engine
from engine_models.scene.scene import Scene


def supports(engine: Engine, scene: Scene) -> bool:
    """Return whether an engine, at its settings, runs a scene."""
    try:
        engine.check(scene)
    except UnsupportedScene:
        return False
    return True


def supporting(scene: Scene) -> list[str]:
    """Return the names of the engines that run a scene as they come."""
    return [name for name in ENGINES if supports(make_engine(name), scene)]
