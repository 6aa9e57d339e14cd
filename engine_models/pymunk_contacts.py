"""What a contact's steps leave behind, and the engine's ``Contact`` made of it after the run."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine_models.contact_stiffness import elastic_energy_J
from engine_models.engine import Contact, FloatArray, Impacts
from engine_models.scene import Clearance


class ContactStep(NamedTuple):
    """One kick of a contact: impulses in N s on the pin, inward and along t, and speeds in m/s.

    Speeds are those of the penetration before the kick, and the means of before and after: an impulse times
    the mean speed is its work, exactly. ``spring_N_s`` is the elastic part of the normal impulse.
    """

    step: int
    normal_N_s: float
    friction_N_s: float
    rate_before: float
    mean_rate: float
    mean_sliding: float
    spring_N_s: float
    clipped: bool


class ContactLog:
    """The kicks of one contact as arrays (k,), in the order of time; only steps in contact are there.

    ``clips`` tells whether its law can.
    """

    def __init__(self, steps: list[ContactStep], clips: bool) -> None:
        self.clips = clips
        table = np.array(steps, dtype=np.float64).reshape(-1, len(ContactStep._fields))
        columns = dict(zip(ContactStep._fields, table.T, strict=True))
        self.step: NDArray[np.int64] = columns["step"].astype(np.int64)
        self.normal, self.friction = columns["normal_N_s"], columns["friction_N_s"]
        self.rate_before, rate = columns["rate_before"], columns["mean_rate"]
        clipped, spring = columns["clipped"] != 0, columns["spring_N_s"]
        self.normal_loss = np.where(clipped, 0.0, (self.normal - spring) * rate)
        self.clipped_loss = np.where(clipped, -spring * rate, 0.0)
        self.friction_loss = -self.friction * columns["mean_sliding"]
        begins = np.ones(len(self.step), dtype=bool)
        begins[1:] = np.diff(self.step) > 1
        #: Where each contact begins: at a step that follows one without.
        self.first = np.flatnonzero(begins)

    @property
    def touches(self) -> NDArray[np.int64]:
        """The steps at which a contact begins."""
        return self.step[self.first]

    def at(self, impulse: FloatArray, wanted: NDArray[np.int64]) -> FloatArray:
        """Return an impulse at the wanted steps, zero where there is no contact."""
        place = np.searchsorted(self.step, wanted)
        inside = place < len(self.step)
        out = np.zeros(len(wanted))
        hit = np.flatnonzero(inside)[self.step[place[inside]] == wanted[inside]]
        out[hit] = impulse[place[hit]]
        return out

    def since_start(self, amount: FloatArray, wanted: NDArray[np.int64], share: FloatArray) -> FloatArray:
        """Return the sum of an amount over all steps before each wanted one, and its share of that step's."""
        sums = np.concatenate([[0.0], np.cumsum(amount)])
        before = sums[np.searchsorted(self.step, wanted)]
        return np.asarray(before + share * self.at(amount, wanted))

    def impacts(self, dt: float, last_step: int) -> Impacts:
        """Return the contacts that have ended: runs of consecutive steps; a single one has no duration."""
        first = self.first
        ends = np.append(first[1:], len(self.step)) - 1 if len(first) else first
        over = self.step[ends] < last_step
        first, ends = first[over], ends[over]

        def total(amount: FloatArray) -> FloatArray:
            sums = np.concatenate([[0.0], np.cumsum(amount)])
            return np.asarray(sums[ends + 1] - sums[first])

        return Impacts(
            time_s=np.asarray(dt * self.step[first], dtype=np.float64),
            duration_s=np.asarray(dt * (self.step[ends] - self.step[first]), dtype=np.float64),
            approach_speed_m_s=self.rate_before[first],
            normal_impulse_N_s=total(self.normal),
            energy_lost_J=total(self.normal_loss + self.clipped_loss + self.friction_loss),
        )

    def contact(
        self,
        room: Clearance,
        gap: FloatArray,
        wanted: NDArray[np.int64],
        share: FloatArray,
        dt: float,
        last: int,
    ) -> Contact:
        """Return what the joint did at the wanted steps, (n,), where its gap is d (n, 2) in m.

        Forces are those steps' impulses over dt; ``share`` (n,) of the work at a step is before its sample.
        """
        penetration = np.hypot(gap[:, 0], gap[:, 1]) - room.radial_clearance_m
        rigid = room.law == "rigid"
        has_friction = room.friction is not None
        return Contact(
            gap_m=gap,
            penetration_m=penetration,
            normal_force_N=self.at(self.normal, wanted) / dt,
            friction_force_N=self.at(self.friction, wanted) / dt if has_friction else None,
            elastic_energy_J=np.zeros(len(gap)) if rigid else elastic_energy_J(room, penetration),
            normal_impulse_N_s=self.since_start(self.normal, wanted, share),
            normal_loss_J=self.since_start(self.normal_loss, wanted, share),
            friction_loss_J=self.since_start(self.friction_loss, wanted, share) if has_friction else None,
            clipped_loss_J=self.since_start(self.clipped_loss, wanted, share) if self.clips else None,
            impacts=self.impacts(dt, last),
        )
