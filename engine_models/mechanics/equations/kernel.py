"""Kernels whose states are minimal coordinates and their rates; forces and contacts are the reference's."""

import math
from dataclasses import dataclass, replace

from engine_models.mechanics.equations.partition import Partition
from engine_models.mechanics.equations.posture import Posture
from engine_models.mechanics.equations.structure import Structure
from engine_models.mechanics.equations.tree import Tree
from reference_solver.compiled.kernel import Draft, Kernel, Topology
from reference_solver.tape import Scalar, array, both, choose


@dataclass(frozen=True)
class Plan:
    """A mechanism's structure, and which of its coordinates are independent."""

    structure: Structure
    partition: Partition

    @property
    def carried(self) -> tuple[int, ...]:
        """Coordinates that are integrated, the driven one with them."""
        driven = self.structure.driven
        return self.structure.carried + (() if driven is None else (driven,))

    @property
    def rated(self) -> tuple[int, ...]:
        """Coordinates whose rates are integrated: the independent ones, and the driven one."""
        driven = self.structure.driven
        return self.partition.independent + (() if driven is None else (driven,))

    def posture(
        self, tree: Tree, u: list[Scalar], rates: list[Scalar], driver_acceleration: Scalar = 0.0
    ) -> Posture:
        """Return the posture at coordinates that are ``carried`` and the rates of those ``rated``."""
        driven = None if self.structure.driven is None else (rates[-1], driver_acceleration)
        independent = self.partition.independent
        known = dict(zip(self.carried, u, strict=True))
        return Posture(tree, self.partition, known, dict(zip(independent, rates, strict=False)), driven)


class MinimalKernel(Kernel):
    """Functions of states (u, u') under construction: q and q' of their drafts follow from these.

    u are the coordinates of a plan that are ``carried``, u' the rates of those that are ``rated``: a driven
    one is integrated, too, with its acceleration given.
    """

    def __init__(self, topology: Topology, plan: Plan) -> None:
        super().__init__(topology)
        self._plan = plan
        self._state = [f"q{k}" for k in plan.carried]
        self._state += [f"v{k}" for k in plan.rated]

    def begin(self) -> Draft:
        """Return a new function."""
        draft = super().begin()
        posture = self._posture(draft)
        return replace(draft, q=array(posture.q), v=array(posture.v))

    def rates(self, draft: Draft) -> tuple[list[Scalar], dict[str, Scalar], Scalar]:
        """Return u' and z'' of a draft, the powers by name, and whether no loop is at a singular position.

        There z'' is infinite.
        """
        posture, plan, ok = self._posture(draft), self._plan, True
        F, powers, _ = draft.equations.forces(draft.t, draft.q, draft.v, draft.phases)
        found, torque = posture.accelerations(F)
        for k in plan.partition.watched:
            ok = both(ok, self.determinant(draft, k) > 0.0)
        if plan.structure.driven is not None:
            *_, found[plan.structure.driven] = self._tree(draft).driven(draft.t)
            torque = torque * posture.rates[plan.structure.driven]
        first, *others = (found[k] for k in plan.rated)
        own = [posture.rates[k] for k in plan.carried]
        return (
            [*own, first if ok is True else choose(ok, first, math.inf), *others],
            powers | {"drivers": torque},
            ok,
        )

    def determinant(self, draft: Draft, step: int) -> Scalar:
        """Return a step's determinant, positive where its partition was chosen."""
        return self._plan.partition.steps[step].sign * self._posture(draft).loops.determinants[step]

    def _tree(self, draft: Draft) -> Tree:
        return Tree(self._plan.structure, draft.equations.mechanism, draft.equations.q_start)

    def _posture(self, draft: Draft) -> Posture:
        tape, plan, tree, acceleration = draft.tape, self._plan, self._tree(draft), 0.0
        u = [tape.input(f"q{k}") for k in plan.carried]
        rates = [tape.input(f"v{k}") for k in plan.rated]
        if plan.structure.driven is not None:
            *_, acceleration = tree.driven(draft.t)
        return plan.posture(tree, u, rates, acceleration)
