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


class Ledger:
    """What has added up since t = 0: the drivers' work, and (J,) impulses and losses of every joint.

    ``constraint_work_J`` includes the work of impulses. ``normal_impulse_N_s`` is the integral of the normal
    force while pins follow, and the impulses of impacts. ``impact_loss_J`` and ``closing_loss_J`` include
    friction's part; ``friction_loss_J`` is that of following.
    """

    def __init__(self, joints: int) -> None:
        self.constraint_work_J = 0.0
        self.normal_impulse_N_s, self.friction_loss_J = np.zeros(joints), np.zeros(joints)
        self.impact_loss_J, self.closing_loss_J = np.zeros(joints), np.zeros(joints)

    def add(self, sums: FloatArray) -> None:
        """Add the sums (1 + 2J,) of steps (see ``rigid_modes``)."""
        joints = len(self.friction_loss_J)
        self.constraint_work_J += float(sums[0])
        self.normal_impulse_N_s += sums[1 : 1 + joints]
        self.friction_loss_J += sums[1 + joints :]

    def entries(self) -> tuple[float, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return drivers' work, normal impulses, and losses in impacts, in closings and by friction."""
        losses = (self.impact_loss_J, self.closing_loss_J, self.friction_loss_J)
        impact, closing, friction = (loss.copy() for loss in losses)
        return self.constraint_work_J, self.normal_impulse_N_s.copy(), impact, closing, friction


@dataclass(frozen=True)
class RigidSolution:
    """The motion of n coordinates, m ideal rows and J rigid joints at s equally spaced times.

    ``time_s`` (s,), ``q`` and ``v`` (s, n), ``multipliers`` (s, m) of the ideal rows. ``following`` (s, J)
    tells which pins follow their walls; the others fly. Without impulses: ``normal_force_N`` (s, J) presses
    the pin inwards, ``friction_force_N`` (s, J) is on the pin along t, ``joint_force_N`` (s, J, 2) is the
    bearing's force on the pin, of both.

    The ledger since t = 0: kinetic and potential energy and the drivers' work (s,), that of impulses
    included, and of every joint (s, J) the losses in impacts, in closings and by friction in following. The
    first two include friction's part in impulses. Closings include pins kept on their walls when another
    hits, which are no entries in ``impacts``. ``normal_impulse_N_s`` (s, J) is the normal force's integral
    in following and the impulses of all these; a pin that is kept on its wall gets a negative one.
    """

    time_s: FloatArray
    q: FloatArray
    v: FloatArray
    multipliers: FloatArray
    following: NDArray[np.bool_]
    normal_force_N: FloatArray
    friction_force_N: FloatArray
    joint_force_N: FloatArray
    impacts: tuple[RigidImpact, ...]
    mode_changes: tuple[ModeChange, ...]
    kinetic_energy_J: FloatArray
    potential_energy_J: FloatArray
    constraint_work_J: FloatArray
    normal_impulse_N_s: FloatArray
    impact_loss_J: FloatArray
    closing_loss_J: FloatArray
    friction_loss_J: FloatArray

    @property
    def energy_residual_J(self) -> FloatArray:
        """Return what the ledger leaves over (s,): the error of the steps, and what dampers took."""
        energy = self.kinetic_energy_J + self.potential_energy_J
        lost = self.impact_loss_J + self.closing_loss_J + self.friction_loss_J
        return np.asarray(energy - energy[0] - self.constraint_work_J + lost.sum(axis=1))


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
