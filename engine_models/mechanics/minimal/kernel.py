"""Kernels whose states are minimal coordinates and their rates; forces and contacts are the reference's."""

from dataclasses import replace

from engine_models.mechanics.minimal.tree import THETA, Posture, Tree
from reference_solver.compiled.kernel import Draft, Kernel, Topology
from reference_solver.mechanism.mechanism import PrescribedMotion, PrescribedSpeed
from reference_solver.tape import Scalar, array


class MinimalKernel(Kernel):
    """Functions of states (z, z') under construction: q and q' of their drafts follow from these."""

    def __init__(self, topology: Topology) -> None:
        super().__init__(topology)
        self.n = len(Tree(topology.mechanism).coordinates)
        self._state = [f"{letter}{c}" for letter in "qv" for c in range(self.n)]

    def begin(self) -> Draft:
        """Return a new function."""
        draft = super().begin()
        posture = self._posture(draft)
        return replace(draft, q=array(posture.q), v=array(posture.v))

    def accelerations(self, draft: Draft) -> tuple[list[Scalar], list[Scalar], dict[str, Scalar]]:
        """Return z' and z'' of a draft, (n,) each, and the powers by name."""
        F, powers, _ = draft.equations.forces(draft.t, draft.q, draft.v, draft.phases)
        driven = None
        if any(
            isinstance(c, PrescribedSpeed | PrescribedMotion) for c in draft.equations.mechanism.constraints
        ):
            driven = draft.equations.system(draft.t, draft.q, draft.v).C_dot[-1]  # the driver's row is last
        accelerations, torque = self._posture(draft).accelerations(F, driven)
        rates = [*draft.tape.inputs("v", self.n)]
        return rates, accelerations, powers | {"drivers": torque * draft.v[THETA]}

    def _posture(self, draft: Draft) -> Posture:
        tape = draft.tape
        tree = Tree(draft.equations.mechanism)
        return Posture(tree, tape.inputs("q", self.n), tape.inputs("v", self.n))
