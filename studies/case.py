"""One run of a study: the scene, the engine at its settings, and a key that tells runs apart."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Protocol

from engine_models.engine import FloatArray, RunSettings
from engine_models.scene import Scene

Value = str | int | float | bool | None
#: One flat row of results: units are in the column names, failures have ``status`` and ``reason``.
Row = dict[str, Value]
Curves = dict[str, FloatArray]


@dataclass(frozen=True)
class Case:
    """A run to be made. ``arm`` names the engine's settings in tables and figures."""

    study: str
    scene: Scene
    engine: str
    arm: str
    run: RunSettings
    settings: Mapping[str, Value] = field(default_factory=dict)

    def key(self, fingerprint: str) -> str:
        """Return what identifies this run together with the code and the libraries it is made with."""
        run = [self.engine, self.arm, asdict(self.run), dict(self.settings)]
        text = json.dumps([fingerprint, self.study, self.scene.model_dump(), *run], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def head(self) -> Row:
        """Return the columns that say what was run."""
        return {
            "study": self.study,
            "scene": self.scene.name,
            "engine": self.engine,
            "arm": self.arm,
            "end_time_s": self.scene.end_time_s,
            "samples": self.run.samples,
            "step_s": self.run.step_used_s(self.scene.end_time_s),
            **{f"setting_{name}": value for name, value in self.settings.items()},
        }


class Study(Protocol):
    """What a study's module provides."""

    def cases(self, full: bool) -> list[Case]:
        """Return the runs to make; the full set contains the quick one."""
        ...

    def measure(self, case: Case) -> tuple[Row, Curves]:
        """Make one run and return its measured columns and its curves over time."""
        ...
