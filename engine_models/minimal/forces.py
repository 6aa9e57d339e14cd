"""Forces and reactions in any states of a mechanism, from what loads, springs, drives and contacts do.

For the engines that have them not themselves. Whoever has a compiled loop of its own hands ``Forces.p`` to it
and calls ``equations.engage`` for each contact and then ``equations.forces``, for one state at a time. All
else goes by samples (n,): ``Forces.act`` gives generalised forces, powers of loads, and contacts by their law
or with forces that are given; ``Forces.reactions`` gives the forces of joints, guides and drive from motion
alone. By Newton's second law B^T lambda = M a - F, of which lambda is the solution by least squares in the
norm of M^-1: B M^-1 B^T lambda = B (a - M^-1 F).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from engine_models.engine import Contact, FloatArray, UnsupportedScene
from engine_models.mechanics.forces import integrals_of
from engine_models.mechanics.states import pin_gap
from engine_models.mechanics.trajectory import ContactStates, Reactions, reactions_of
from engine_models.minimal import equations as eq
from engine_models.minimal.model import Numbers
from engine_models.scene.plain_words import shown
from engine_models.scene.scene import Scene
from reference_solver.mechanism.contacts import DAMPING_FACTORS, NORMAL_LAWS

#: Singular values below this part of the largest are zero, where rows depend on each other.
ZERO = 1e-15


@dataclass(frozen=True)
class Acting:
    """What acts in n states: ``on_bodies`` (n, bodies, 3) has all forces and torques but reactions.

    ``torque_N_m`` (n,) is that of a drive that prescribes no motion. ``powers_W`` has those of loads whose
    works are integrals over time, by the names of ``Trajectory.load_work_J``.
    """

    on_bodies: FloatArray
    torque_N_m: FloatArray | None
    powers_W: dict[str, FloatArray]
    contacts: dict[str, ContactStates]


def require_family(scene: Scene, engine: str) -> None:
    """Refuse laws that the reference has by functions of their own, which an engine has no form for.

    Raises:
        UnsupportedScene: a joint has one.
    """
    for name, room in scene.clearances.items():
        if room.law in NORMAL_LAWS:
            expected = "a law of a stiffness and a damping, or of the dissipative family"
            raise UnsupportedScene(
                f"{engine}: clearance.{name}.law: expected {expected}, got {shown(room.law)}"
            )


class Forces(Numbers):
    """The forces on the bodies of a scene's mechanism, and its reactions, in any states.

    ``integrated`` names the works that are integrals over time.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene.mechanism, np.zeros(3 * len(scene.mechanism.bodies)), _damping_of)
        self._short = "slider." if scene.is_short else ""
        self.integrated = tuple(integrals_of(scene).values())

    def motion(self, time_s: FloatArray) -> FloatArray:
        """Return how far what is driven has gone since t = 0, its speed and its acceleration, (3, n)."""
        motion = np.empty((len(time_s), 3))
        eq.drive(self.p, np.ascontiguousarray(time_s), motion)
        return np.asarray(motion.T)

    def act(
        self,
        time_s: FloatArray,
        position: FloatArray,
        velocity: FloatArray,
        contacts: Mapping[str, Contact | ContactStates] | None = None,
        approach_m_s: Mapping[str, FloatArray] | None = None,
    ) -> Acting:
        """Return what acts at times (n,) in states (n, bodies, 3).

        Joints with clearance do what is told in ``contacts``, or what their law does with a latest touch at
        the speeds ``approach_m_s`` (n,); those in neither do nothing.
        """
        n, loose, bodies = len(time_s), self.of.loose, len(self.of.bodies)
        phases = np.zeros((n, len(loose), 3))
        for k, pin in enumerate(loose):
            if contacts and pin.name in contacts:
                of_pin = contacts[pin.name]
                rub = 0.0 if of_pin.friction_force_N is None else of_pin.friction_force_N
                phases[:, k] = np.stack(
                    np.broadcast_arrays(float(eq.GIVEN), of_pin.normal_force_N, rub), axis=-1
                )
            elif approach_m_s and pin.name in approach_m_s:
                wall = self.contacts[k]
                phases[:, k, 0] = eq.PUSHED
                phases[:, k, 1] = wall[eq.A] / np.maximum(approach_m_s[pin.name], wall[eq.SLOWEST])
        F = np.empty((n, 3 * bodies))
        told, powers = np.empty((n, len(self.told))), np.empty((n, len(self.sums) + 1))
        eq.act(self.p, np.ascontiguousarray(time_s), flat(position), flat(velocity), phases, F, told, powers)
        at, place, states = eq.OF_CONTACT * len(loose), eq.OF_SUMS * len(loose), dict[str, ContactStates]()
        for k, pin in enumerate(loose):
            gap, c = pin_gap(pin, position, np.zeros_like(position)).gap_m, self.contacts[k, eq.C]
            normal, friction, _, rate, *_ = told[:, eq.OF_CONTACT * k : eq.OF_CONTACT * (k + 1)].T
            losses = powers[:, eq.OF_SUMS * k + 1 : eq.OF_SUMS * (k + 1)].T
            distance = np.hypot(*gap.T)
            rate_m_s = rate * c / np.maximum(distance, np.finfo(float).tiny)
            states[pin.name] = ContactStates(gap, distance - c, normal, friction, rate_m_s, *losses)
        torque = told[:, at + self.parts.index("driver")] if "driver" in self.parts else None
        works = {name.removeprefix(self._short): powers[:, place + k] for k, name in enumerate(self.parts)}
        works = {name: works[name] for name in self.integrated if name in works}
        return Acting(F.reshape(n, bodies, 3), torque, works, states)

    def reactions(
        self,
        time_s: FloatArray,
        position: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        contacts: Mapping[str, Contact | ContactStates],
    ) -> Reactions:
        """Return all reactions at times (n,) in states (n, bodies, 3) with such accelerations.

        ``contacts`` has what the joints with clearance do then.
        """
        acting = self.act(time_s, position, velocity, contacts)
        B, masses = self.look(0.0, flat(position))[0], self.masses.ravel()
        missing = flat(acceleration) - flat(acting.on_bodies) / masses
        matrix, right = B / masses @ B.swapaxes(1, 2), B @ missing[..., None]
        try:
            multipliers = np.linalg.solve(matrix, right)[..., 0]
        except np.linalg.LinAlgError:  # the shortest where one is singular
            multipliers = (np.linalg.pinv(matrix, ZERO, hermitian=True) @ right)[..., 0]
        return reactions_of(self.of, multipliers, contacts, acting.torque_N_m)


def _damping_of(law: str, e: float) -> float:
    """Return the factor a of a law; a law that somebody adds is known to the reference alone."""
    return DAMPING_FACTORS[law](e) if law in DAMPING_FACTORS else 0.0


def flat(states: FloatArray) -> FloatArray:
    """Return states (n, bodies, 3) as (n, 3b)."""
    return np.ascontiguousarray(states.reshape(len(states), 3 * states.shape[1]), dtype=np.float64)
