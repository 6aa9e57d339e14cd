"""Members of a sweep or an ensemble by the reference solver: many runs of one scene with changed numbers.

Each equals its own run by ``ReferenceEngine.simulate`` bit for bit; what is gathered of it is gathered on the
way (see ``observer``), and no more is kept.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from threading import Event, Lock
from typing import cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from engine_models.engine import FloatArray, RunSettings, SimulationFailed, UnsupportedScene
from engine_models.pace import Pace
from engine_models.reference.batch import Begin, Done, Group, Judge
from engine_models.reference.building import Builder
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.run import LOOK_UP_STEPS, TURN_OF_STEP_RAD, taken
from engine_models.reference.watch import Watch
from engine_models.scene.data import SceneError
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene
from reference_solver.compiled.kernel import Topology
from reference_solver.failures import SolverError

#: Members of a batch.
BATCH = 32
#: Numbers of a crank-slider's row, NaN in one that failed; and lists, empty there.
NUMBERS = (
    "impacts_per_revolution",
    "flight_part",
    "impact_speed_m_s",
    "impulse_N_s",
    "impulse_per_revolution_N_s",
    "largest_contact_force_N",
    "dissipated_energy_per_revolution_J",
    "slider_deviation_m",
    "rms_slider_deviation_m",
    "exponent_1_s",
)
LISTS = ("strobe_m", "impact_phase_rad")

Row = dict[str, object]
#: Positions and velocities of the bodies at the end of a run, each (bodies, 3).
End = tuple[FloatArray, FloatArray]


def subject_of(scene: AnyScene) -> str:
    """Return what the columns call that whose deviation they have: the slider, or what the scene observes."""
    return "slider" if isinstance(scene, Scene) and scene.is_crank_slider else "observed"


def numbers_of(scene: AnyScene) -> tuple[str, ...]:
    """Return the numbers of a scene's row."""
    return tuple(name.replace("slider", subject_of(scene)) for name in NUMBERS)


def supports(engine: ReferenceEngine, scene: Scene, fields: Sequence[str]) -> bool:
    """Return whether members that differ in these fields can be run together.

    They are plain crank-sliders with clearance in compliant joints, by a compiled kernel with located events.
    """
    laws = {clearance.law for clearance in scene.clearances.values()}
    numeric = all(isinstance(_field(scene, path), float) for path in fields)
    moves_guide = any(path.startswith("slider.guide_") for path in fields)
    compliant = bool(laws) and "rigid" not in laws
    return (
        numeric
        and compliant
        and scene.is_plain
        and not moves_guide
        and scene.is_crank_slider
        and engine.kernel == "compiled"
        and engine.locate_events
    )


def run_members(
    engine: ReferenceEngine,
    scene: Scene,
    changes: Mapping[str, NDArray[np.float64]],
    watch: Watch,
    threads: int = 1,
    step_s: float | None = None,
) -> pd.DataFrame:
    """Return a row for each of n members, in order: what it did after the transient, or why it failed.

    ``changes`` has the values (n,) of each field that changes, by its path. A step of RK4 is no longer than
    ``step_s``, or than a turn's 1200th.
    """
    task = Members(
        engine, scene, {name: np.asarray(values).tolist() for name, values in changes.items()}, watch, step_s
    )
    numbers = range(len(next(iter(task.changes.values()))))
    batches = [numbers[begin : begin + BATCH] for begin in range(0, len(numbers), BATCH)]
    with ThreadPoolExecutor(threads) as pool:
        try:
            rows = [row for batch in pool.map(task.rows, batches) for row in batch]
        finally:
            task.ended.set()
    return pd.DataFrame(rows, columns=["status", "reason", *NUMBERS, *LISTS])


@dataclass(frozen=True)
class Members:
    """What members have in common, and the groups of those of one topology, which all threads share."""

    engine: ReferenceEngine
    scene: Scene
    changes: Mapping[str, list[float]]
    watch: Watch
    step_s: float | None
    groups: dict[Topology, Group] = field(default_factory=dict)
    lock: Lock = field(default_factory=Lock)
    ended: Event = field(default_factory=Event)

    @cached_property
    def builder(self) -> Builder:
        """Who builds them."""
        return Builder.of(self.engine, self.changes)

    def values(self, number: int) -> dict[str, float]:
        """Return the values of the fields that change, by their paths, of a member."""
        return {path: values[number] for path, values in self.changes.items()}

    def member(self, number: int) -> Scene:
        """Return the scene of a member (see ``Watch.member``)."""
        return self.watch.member(self.scene, self.values(number))

    def settings(self, scene: Scene) -> RunSettings:
        """Return the settings with which a member's scene is run alone."""
        turn_s = scene.end_time_s / self.watch.turns
        longest = turn_s * TURN_OF_STEP_RAD / (2 * math.pi) if self.engine.method == "rk4" else math.inf
        return RunSettings(min(self.step_s or longest, scene.end_time_s), 1)

    def begin(self, number: int) -> Begin:
        """Return how a member begins.

        Raises:
            SceneError: with its values it is no scene.
            SimulationFailed, SolverError: it cannot.
        """
        scene = self.member(number)
        settings, values = self.settings(scene), self.values(number)
        choice = taken(self.engine.step_choice(scene, settings), scene, settings)
        built, start = self.builder.mechanism(scene, values), self.builder.start(scene, values)
        end, watch = scene.end_time_s, self.watch
        turn_s = end / watch.turns
        once = turn_s * (watch.transient + np.arange(math.floor(watch.revolutions) + 1))
        times = np.array([0.0, *np.minimum(once, end), end])
        crank, rod, _ = scene.crank_slider()
        lengths = crank.length_m, rod.length_m
        return Begin(*built, *start, choice, times, float(times[1]), lengths)

    def rows(self, numbers: Sequence[int]) -> list[Row]:
        """Return the rows of some members."""
        with np.errstate(all="ignore"):  # what is not finite is a failure
            begins, rows = self.begun(numbers)
            for own, done in self.run(begins):
                rows |= {number: self._row(number, done, k) for k, number in enumerate(own)}
        return [rows[number] for number in numbers]

    def followed(self, values: Mapping[str, float]) -> tuple[Row, End | None]:
        """Return the row of one member with these values, and where it ended; nothing of one that failed."""
        alone = replace(self, changes={path: [value] for path, value in values.items()})
        end = None
        with np.errstate(all="ignore"):
            begins, rows = alone.begun([0])
            for _, done in alone.run(begins):
                rows[0] = alone._row(0, done, 0)
                if rows[0]["status"] == "ok":
                    q, v = done.members.y[0, :18].reshape(2, 3, 3)
                    end = q, v
        return rows[0], end

    def begun(self, numbers: Sequence[int]) -> tuple[dict[int, Begin], dict[int, Row]]:
        """Return how members begin, by their numbers, and the rows of those that cannot."""
        begins, rows = dict[int, Begin](), dict[int, Row]()
        for number in numbers:
            try:
                begins[number] = self.begin(number)
            except (SceneError, SimulationFailed, UnsupportedScene, SolverError) as failure:
                rows[number] = failed(str(failure))
            except OverflowError:  # Python's own numbers raise where NumPy's become infinite
                rows[number] = failed(self._reason(number))
        return begins, rows

    def run(self, begins: Mapping[int, Begin]) -> Iterator[tuple[list[int], Done]]:
        """Run members, those of one topology together; yield their numbers and what is left of them."""
        alike = dict[Topology, list[int]]()
        for number, begin in begins.items():
            alike.setdefault(begin.marked, []).append(number)
        for marked, numbers in alike.items():
            own = [begins[number] for number in numbers]
            yield numbers, self._group(marked, own[0]).run(own, self._judge_of(numbers), self.watch.exponent)

    def _group(self, marked: Topology, begin: Begin) -> Group:
        with self.lock:
            if marked not in self.groups:
                self.groups[marked] = Group(self.builder.topology(begin.mechanism), begin.q)
            return self.groups[marked]

    def _judge_of(self, numbers: Sequence[int]) -> Judge:
        """Return what ends a batch of members, or one whose steps have collapsed, as its own run does."""
        paces = dict[int, Pace]()

        def judge(k: int, time_s: float, steps: int) -> bool:
            if self.ended.is_set():
                raise CancelledError
            if steps >= LOOK_UP_STEPS and k not in paces:
                paces[k] = Pace(self.member(numbers[k]), LOOK_UP_STEPS, self.engine.max_steps)
            try:
                if k in paces:
                    paces[k].judge(time_s, steps)
            except SimulationFailed:
                return False
            return True

        return judge

    def _row(self, number: int, done: Done, k: int) -> Row:
        """Return the row of a member of a batch."""
        if done.failed[k]:
            return failed(self._reason(number))
        try:
            run = done.solution(k)
        except SolverError as failure:
            return failed(str(failure))
        notes, turns, lost = done.members.notes[k], self.watch.revolutions, run.losses_J()
        impulse = np.sum([run.sums[f"normal{c}"] for c in range(len(run.mechanism.contacts))], axis=0)
        watched_s = notes["time"] - notes["from_s"]
        growth = done.members.growth[k]
        r, length, angle = notes["crank_m"], notes["rod_m"], run.q[2:-1, 2]
        ideal = r * np.cos(angle) + np.sqrt(length**2 - (r * np.sin(angle)) ** 2)
        found = {
            "impacts_per_revolution": notes["touches"] / turns,
            "flight_part": notes["flight_s"] / watched_s,
            "impact_speed_m_s": notes["speed"] / notes["touches"] if notes["touches"] else math.nan,
            "impulse_N_s": notes["impulse"] / notes["over"] if notes["over"] else math.nan,
            "impulse_per_revolution_N_s": (impulse[-1] - impulse[1]) / turns,
            "largest_contact_force_N": notes["force"],
            "dissipated_energy_per_revolution_J": (lost[-1] - lost[1]) / turns,
            "slider_deviation_m": notes["far"],
            "rms_slider_deviation_m": math.sqrt(notes["square"] / watched_s),
            "exponent_1_s": growth["total"] / growth["followed_s"] if growth["followed_s"] else math.nan,
            "strobe_m": (run.q[2:-1, 6] - ideal).tolist(),
            "impact_phase_rad": done.touches_rad[k].tolist(),
        }
        return {"status": "ok", "reason": "", **found}

    def _reason(self, number: int) -> str:
        """Return why a member fails, in the words of its own run."""
        scene = self.member(number)
        try:
            self.engine.simulate(scene, self.settings(scene))
        except (SimulationFailed, UnsupportedScene) as failure:
            return str(failure)
        return "not all numbers are finite: shorten the step, or sharpen the tolerance"


def _field(scene: Scene, path: str) -> object:
    """Return what a field of a scene has now, None where there is no such thing."""
    return reduce(lambda part, name: getattr(part, name, None), path.split("."), cast(object, scene))


def failed(reason: str, numbers: Sequence[str] = NUMBERS) -> Row:
    """Return the row of a member that failed."""
    row: Row = {"status": "failed", "reason": reason}
    return row | dict.fromkeys(numbers, math.nan) | {name: [] for name in LISTS}
