"""What every member of a sweep has in common, and the scene of one."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from engine_models.engine import Engine, RunSettings
from engine_models.engines import make_engine
from engine_models.reference.watch import Watch
from engine_models.scene.parts import AnyScene

#: Output intervals in a turn, and of a whole run at most: of what lies between them an engine that is run
#: member by member tells nothing but its impacts.
TURN_SAMPLES, MOST_SAMPLES = 1000, 100_000


@dataclass(frozen=True)
class Task:
    """A scene whose fields are to change, the engine at its settings, and what is gathered.

    ``step_s`` is the longest step, None where it is the whole run.
    """

    scene: AnyScene
    engine_name: str
    settings: Mapping[str, object]
    step_s: float | None
    watch: Watch = field(default_factory=Watch)

    @cached_property
    def engine(self) -> Engine:
        """The engine."""
        return make_engine(self.engine_name, **self.settings)

    def member(self, values: Mapping[str, float]) -> AnyScene:
        """Return the scene of a member (see ``Watch.member``)."""
        return self.watch.member(self.scene, values)

    def run_settings(self, scene: AnyScene) -> RunSettings:
        """Return step and samples of a member's run; a whole number of samples makes a whole turn.

        Where a tolerance chooses the steps, those of other mechanisms than plain ones are no longer than from
        sample to sample: within a long step of a stiff contact an interpolant is far off.
        """
        a_turn = max(1, min(TURN_SAMPLES, math.floor(MOST_SAMPLES / self.watch.turns)))
        samples, end_s = max(1, round(a_turn * self.watch.turns)), scene.end_time_s
        longest_s = end_s if scene.is_plain else end_s / samples
        return RunSettings(min(self.step_s or longest_s, end_s), samples)
