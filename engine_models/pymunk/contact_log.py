"""What a contact's steps leave behind, and the engine's ``Contact`` made of it after the run."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Contact, FloatArray, Impacts
from engine_models.mechanics.trajectory import contact_of
from engine_models.pymunk.compiled.records import KICK
from engine_models.scene.format import Clearance

#: What is added up, named as in ``Contact``.
SUMS = ("normal_impulse_N_s", "normal_loss_J", "clipped_loss_J", "friction_loss_J")
#: Stands in a contact whose run is not over.
NO_IMPACTS = Impacts(*np.zeros((9, 0)))


class ContactLog:
    """The kicks of one contact, taken up block by block; a kick is there for every step in contact.

    Kept for good are the sums since the start and a row for each contact that has begun. Between ``rigid``
    walls a force is an impulse over the step, and has no largest value.
    """

    def __init__(self, rigid: bool) -> None:
        self._rigid = rigid
        #: Of every contact begun: its largest force and penetration, each with its time.
        self._largest: list[list[tuple[float, float]]] = []
        self._last_step = -2  # of those taken up so far: the first kick, at step 0 or later, begins a contact
        self._totals = dict.fromkeys((*SUMS, "energy_lost_J"), 0.0)
        self._last_time_s = 0.0
        #: Of every contact begun: its first time, its approach speed, normal impulse and loss before it, and
        #: step and time of the last kick of the contact before it.
        self._begun: list[FloatArray] = []
        self.add(np.zeros(0, KICK))

    def add(self, kicks: NDArray[Any]) -> None:
        """Take up the kicks that follow those so far, (k,) of ``records.KICK``."""
        self._step: NDArray[np.int64] = kicks["step"].astype(np.int64)
        self._normal, self._friction = kicks["normal_N_s"], kicks["friction_N_s"]
        clipped, spring, rate = kicks["clipped"] != 0, kicks["spring_N_s"], kicks["mean_rate"]
        amounts = {
            "normal_impulse_N_s": self._normal,
            "normal_loss_J": np.where(clipped, 0.0, (self._normal - spring) * rate),
            "clipped_loss_J": np.where(clipped, -spring * rate, 0.0),
            "friction_loss_J": -self._friction * kicks["mean_sliding"],
        }
        amounts["energy_lost_J"] = sum(amounts[name] for name in SUMS[1:])
        self._amounts = amounts
        # The sums before each of these kicks and after the last, (k + 1,).
        self._sums = {
            name: np.cumsum(np.append(self._totals[name], amount)) for name, amount in amounts.items()
        }
        self._totals = {name: float(sums[-1]) for name, sums in self._sums.items()}
        before, times = np.append(self._last_step, self._step), np.append(self._last_time_s, kicks["time_s"])
        first = np.flatnonzero(np.diff(before) > 1)
        #: The steps at which a contact begins: they follow one without.
        self.touches = self._step[first]
        self._begun.append(
            np.column_stack(
                [
                    kicks["time_s"][first],
                    kicks["rate_before"][first],
                    self._sums["normal_impulse_N_s"][first],
                    self._sums["energy_lost_J"][first],
                    before[first],
                    times[first],
                ]
            )
        )
        self._last_step, self._last_time_s = int(before[-1]), float(times[-1])
        self._largest += [[(-np.inf, np.nan)] * 2 for _ in first]
        if not self._rigid:
            self._keep_largest(kicks, first)

    def _keep_largest(self, kicks: NDArray[Any], first: NDArray[np.int64]) -> None:
        """Keep the largest of the contacts that have kicks here, which begin at the ``first`` ones."""
        parts = np.split(kicks, first)  # the first part belongs to the contact before, if there was one
        kept = self._largest[-len(parts) :]
        for of_contact, part in zip(kept, parts[len(parts) - len(kept) :], strict=True):
            if len(part):
                for k, value in enumerate((part["normal_N_s"] / part["kick_s"], part["depth_m"])):
                    at = int(np.argmax(value))
                    of_contact[k] = max(of_contact[k], (float(value[at]), float(part["time_s"][at])))

    def at(self, impulse: FloatArray, wanted: NDArray[np.int64]) -> FloatArray:
        """Return an impulse at the wanted steps, zero where there is no contact."""
        at_wanted = np.zeros(len(wanted))
        _, place, hit = np.intersect1d(self._step, wanted, assume_unique=True, return_indices=True)
        at_wanted[hit] = impulse[place]
        return at_wanted

    def since_start(self, amount: str, wanted: NDArray[np.int64], share: FloatArray) -> FloatArray:
        """Return the sum of an amount over all steps before each wanted one, and its share of that step's."""
        before = self._sums[amount][np.searchsorted(self._step, wanted)]
        return np.asarray(before + share * self.at(self._amounts[amount], wanted))

    def impacts(self, last_step: int) -> Impacts:
        """Return the contacts that have ended: runs of consecutive steps; a single one has no duration."""
        first_s, speed, impulse, lost, before, before_s = np.concatenate(self._begun).T
        over = np.append(before[1:], self._last_step)[: len(first_s)] < last_step
        ends_s = np.append(before_s[1:], self._last_time_s)[: len(first_s)]

        def change(before_each: FloatArray, amount: str) -> FloatArray:
            return np.asarray(np.diff(np.append(before_each, self._totals[amount]))[over])

        of_each = np.reshape(self._largest, (-1, 4))[over]
        force, force_s, depth, depth_s = np.where(self._rigid, np.nan, of_each).T
        return Impacts(
            time_s=first_s[over],
            duration_s=(ends_s - first_s)[over],
            approach_speed_m_s=speed[over],
            normal_impulse_N_s=change(impulse, "normal_impulse_N_s"),
            energy_lost_J=change(lost, "energy_lost_J"),
            largest_normal_force_N=force,
            largest_normal_force_time_s=force_s,
            largest_penetration_m=depth,
            largest_penetration_time_s=depth_s,
        )

    def contact(
        self,
        clearance: Clearance,
        gap: FloatArray,
        wanted: NDArray[np.int64],
        share: FloatArray,
        kick_s: FloatArray,
    ) -> Contact:
        """Return what the joint did at wanted steps (n,) of this block, where its gap is d (n, 2) in m.

        Forces are those steps' impulses over ``kick_s`` (n,); ``share`` (n,) of the work at a step is
        before its sample. The impacts are left to the end of the run.
        """
        return contact_of(
            clearance,
            gap,
            normal_force_N=self.at(self._normal, wanted) / kick_s,
            friction_force_N=self.at(self._friction, wanted) / kick_s,
            impacts=NO_IMPACTS,
            **{name: self.since_start(name, wanted, share) for name in SUMS},
        )
