"""What an extreme case is: a scene, what theory says an exact solver would do with it, and a check."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from engine_models.engine import Trajectory
from engine_models.scene.scene import Scene

#: Relative errors of a run by what was judged: {"slider position": 1e-6}. The scene is the engine's own
#: (``Engine.twin``), so that an engine is judged by the law that it solves.
Check = Callable[[Scene, Trajectory], Mapping[str, float]]

#: What is asked of an engine: the motion; the motion, or word that step or numbers are none to run with; a
#: refusal, for there is no motion; a stop at ``stop_s``, where the motion is determined no more, or a smooth
#: way on.
Wanted = Literal["answer", "answer or word", "refusal", "stop"]


@dataclass(frozen=True)
class Extreme:
    """A case of the gallery; its name is its scene's.

    ``theory`` is one sentence, ``check`` compares a run with an independent truth. ``step_s`` is the longest
    step of every engine that does not choose its own, and of all where it is ``for_all``. Harmless cases come
    ``first``, without limits, since they compile the kernels that all others use. ``long`` ones are the full
    set's.
    """

    group: str
    scene: Scene
    theory: str
    check: Check
    step_s: float
    samples: int = 100
    for_all: bool = False
    wanted: Wanted = "answer"
    stop_s: float | None = None
    first: bool = False
    long: bool = False
