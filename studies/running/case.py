"""One run of a study: the scene, the engine at its settings, and a key that tells runs apart."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Protocol

from engine_models.arms import Arm, Setting
from engine_models.engine import FloatArray, RunSettings
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene
from studies.running.execution import Limits

Value = str | int | float | bool | None
#: One flat row of results: units are in the column names, failures have ``status`` and ``reason``.
Row = dict[str, Value]
Curves = dict[str, FloatArray]


@dataclass(frozen=True)
class Case:
    """A run to be made: an arm on a scene, with ``added`` settings beyond the arm's own.

    A ``timed`` case runs with nothing beside it, after all others of its study, in the order given. One with
    ``limits`` of its own asks what can be done within them: they are part of its row and of its key. All
    others have ``ROOMY`` ones. Cases with ``limits`` or ``timed`` run on this machine, whatever runs
    the others. ``columns`` are the study's own in the row's head, where they tell runs apart.
    """

    study: str
    scene: AnyScene
    arm: Arm
    run: RunSettings
    added: Mapping[str, Setting] = field(default_factory=dict)
    timed: bool = False
    limits: Limits | None = None
    columns: Mapping[str, Value] = field(default_factory=dict)

    @property
    def plain_scene(self) -> Scene:
        """The scene, in a study of crank-sliders and pendulums alone."""
        assert isinstance(self.scene, Scene)
        return self.scene

    @property
    def engine(self) -> str:
        """The engine's name."""
        return self.arm.engine

    @property
    def settings(self) -> dict[str, Setting]:
        """The engine's settings, the arm's and the added ones."""
        return {**self.arm.settings, **self.added}

    def key(self, fingerprint: str) -> str:
        """Return what identifies this run together with the code and the libraries it is made with."""
        parts = [fingerprint, self.head(), self.scene.model_dump(), asdict(self.run)]
        text = json.dumps(parts, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def head(self) -> Row:
        """Return the columns that say what was run."""
        return {
            "study": self.study,
            "scene": self.scene.name,
            "engine": self.engine,
            "arm": self.arm.name,
            "label": self.arm.label,
            "end_time_s": self.scene.end_time_s,
            "samples": self.run.samples,
            "step_s": self.run.step_used_s(self.scene.end_time_s),
            **({"timed": True} if self.timed else {}),
            **(asdict(self.limits) if self.limits else {}),
            **{f"setting_{name}": value for name, value in self.settings.items()},
            **self.columns,
        }


class Study(Protocol):
    """What a study's module provides."""

    def cases(self, full: bool) -> list[Case]:
        """Return the runs to make; the full set contains the quick one."""
        ...

    def measure(self, case: Case) -> tuple[Row, Curves]:
        """Make one run and return its measured columns and its curves over time."""
        ...
