"""What a run with rigid joints records: samples, impacts and the energy ledger."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reference_solver.equations import Equations
from reference_solver.mechanism import Mechanism, RevoluteJoint, SpringDamper, Torque

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class RigidImpact:
    """An impulse in a joint.

    ``kind``: an "impact" with the joint's restitution; a "closing" without rebound, after which the pin
    follows the wall; a "support", passed on by a pin that followed its wall when another hit. The approach
    speed and the impulse along n are positive, the latter pushing the pin inward; the tangential one is on
    the pin along t (see ``rigid_joint``). ``energy_lost_J`` is this joint's part, friction's included.
    """

    time_s: float
    joint: int
    kind: Literal["impact", "closing", "support"]
    approach_speed_m_s: float
    normal_impulse_N_s: float
    tangential_impulse_N_s: float
    energy_lost_J: float
    effective_mass_kg: float


@dataclass(frozen=True)
class ModeChange:
    """From this time on these joints follow their walls, and the others fly."""

    time_s: float
    following: tuple[int, ...]


@dataclass(frozen=True)
class RigidSolution:
    """The motion of n coordinates, m ideal rows and J rigid joints at s equally spaced times.

    ``time_s`` (s,), ``q`` and ``v`` (s, n), ``multipliers`` (s, m) of the ideal rows, ``following`` (s, J)
    tells which pins follow their walls (the others fly), ``joint_force_N`` (s, J, 2) is the bearing's force
    on the pin, without impulses. The ledger (s,): kinetic and potential energy, the drivers' work, that of
    impulses included, and the losses up to then in impacts and in closings, those of pins kept on their
    walls when another hits included, which are in the ledger only.
    """

    time_s: FloatArray
    q: FloatArray
    v: FloatArray
    multipliers: FloatArray
    following: NDArray[np.bool_]
    joint_force_N: FloatArray
    impacts: tuple[RigidImpact, ...]
    mode_changes: tuple[ModeChange, ...]
    kinetic_energy_J: FloatArray
    potential_energy_J: FloatArray
    constraint_work_J: FloatArray
    impact_loss_J: FloatArray
    closing_loss_J: FloatArray

    @property
    def energy_residual_J(self) -> FloatArray:
        """Return what the ledger leaves over (s,): the error of the steps, and what dampers took."""
        energy = self.kinetic_energy_J + self.potential_energy_J
        lost = self.impact_loss_J + self.closing_loss_J
        return np.asarray(energy - energy[0] - self.constraint_work_J + lost)


class Energy:
    """Kinetic energy, and the potential one of gravity, constant torques and springs."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._masses = np.array([[b.mass_kg, b.mass_kg, b.inertia_kg_m2] for b in mechanism.bodies]).ravel()
        self._slope = np.zeros(len(self._masses))
        self._slope[1::3] = self._masses[1::3] * mechanism.gravity_m_s2
        for load in mechanism.loads:
            if isinstance(load, Torque):
                self._slope[3 * load.body + 2] -= load.torque_N_m
        springs = [load for load in mechanism.loads if isinstance(load, SpringDamper)]
        open_joints = tuple(RevoluteJoint(s.body_i, s.point_i, s.body_j, s.point_j) for s in springs)
        self._ends = Equations(Mechanism(mechanism.bodies, open_joints), np.zeros(len(self._masses)))
        self._stiffness = np.array([s.stiffness_N_m for s in springs])
        self._free_length = np.array([s.free_length_m for s in springs])

    def __call__(self, q: FloatArray, v: FloatArray) -> tuple[float, float]:
        """Return the kinetic and the potential energy in J at coordinates and velocities (n,)."""
        length = np.linalg.norm(self._ends.violation(0.0, q).reshape(-1, 2), axis=1)
        elastic = self._stiffness @ (length - self._free_length) ** 2 / 2
        return float(self._masses @ v**2 / 2), float(self._slope @ q + elastic)
