"""How members are built: what those that are alike have in common is built once."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from engine_models.engine import FloatArray
from engine_models.mechanics.equations import mechanism_of
from engine_models.mechanics.start_check import checked_start, unchecked_start
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.watch import SPEED
from engine_models.scene.scene import Scene
from reference_solver.compiled.kernel import Topology
from reference_solver.equations import Baumgarte
from reference_solver.mechanism.lifting import flat, tables_in
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.methods import RK4
from reference_solver.solver import METHODS

T = TypeVar("T")
#: A mechanism, its marked topology and its numbers (see ``Topology``).
Built = tuple[Mechanism, Topology, tuple[list[float], list[float]]]
#: Coordinates and velocities, each (n,).
Start = tuple[FloatArray, FloatArray]

#: Of how many values of the fields that matter what was built is kept.
KEPT = 256
#: Fields of the start that a mechanism depends on, by its driver, and parts that a start does not depend on.
OF_DRIVER, BESIDE_START = (SPEED, "start.time_s"), ("clearance.", "load.", "slider.", "gravity_m_s2")
#: Up to these lengths what the assembly puts together holds to round-off, a ten-thousandth of what is
#: allowed at a start, and is not looked at.
LONGEST_M = 100.0


@dataclass(frozen=True)
class Builder:
    """Builds the mechanisms and the starts of members, which threads share."""

    engine: ReferenceEngine
    mechanisms: "Remembered[Built]"
    starts: "Remembered[Start]"
    marked: dict[tuple[object, ...], Topology] = field(default_factory=dict)

    @classmethod
    def of(cls, engine: ReferenceEngine, paths: Iterable[str]) -> "Builder":
        """Return who builds members that differ in the fields with these paths."""
        of_mechanism = [path for path in paths if not path.startswith("start.") or path in OF_DRIVER]
        of_start = [path for path in paths if not path.startswith(BESIDE_START)]
        return cls(engine, Remembered(of_mechanism), Remembered(of_start))

    def mechanism(self, scene: Scene, values: Mapping[str, float]) -> Built:
        """Return the mechanism of a member with these values in its fields, its topology and its numbers."""
        return self.mechanisms.of(values, lambda: self._built(mechanism_of(scene)))

    def start(self, scene: Scene, values: Mapping[str, float]) -> Start:
        """Return the start of a member with these values in its fields.

        Raises:
            SimulationFailed: see ``checked_start``.
        """
        return self.starts.of(values, lambda: _start(scene))

    def topology(self, mechanism: Mechanism) -> Topology:
        """Return what the kernel of a mechanism is written for."""
        stabiliser, method = self.engine.stabiliser, self.engine.method
        baumgarte = stabiliser if isinstance(stabiliser, Baumgarte) else None
        projected = stabiliser == "projection"
        return Topology(mechanism, baumgarte, projected, method=RK4 if method == "rk4" else METHODS[method]())

    def _built(self, mechanism: Mechanism) -> Built:
        topology = self.topology(mechanism)
        if tables_in(mechanism):
            return mechanism, topology.marked(), topology.numbers()
        numbers, structure = flat((mechanism, topology.baumgarte))
        if structure not in self.marked:
            self.marked[structure] = topology.marked()
        return mechanism, self.marked[structure], (numbers, [])


@dataclass(frozen=True)
class Remembered(Generic[T]):
    """What was made for some values of the fields that matter to it."""

    paths: Sequence[str]
    kept: dict[tuple[float, ...], T] = field(default_factory=dict)

    def of(self, values: Mapping[str, float], make: Callable[[], T]) -> T:
        """Return what ``make`` makes, or made for a member whose values were the same."""
        key = tuple(values[path] for path in self.paths)
        found = self.kept.get(key)
        if found is None:
            if len(self.kept) >= KEPT:
                self.kept.clear()
            found = self.kept[key] = make()
        return found


def _start(scene: Scene) -> Start:
    crank, rod, _ = scene.crank_slider()
    lengths = crank.length_m, rod.length_m, abs(crank.centre_of_mass_m), abs(rod.centre_of_mass_m)
    # What the solver checks of a start this has checked: its pins are in no rigid bearing.
    start = checked_start if scene.start.states or max(lengths) > LONGEST_M else unchecked_start
    q, v = (part.ravel() for part in start(scene))
    return q, v
