"""Forces by the names of joints, guides and drive, clearances in any states, and some of all samples."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Contact, FloatArray
from reference_solver.mechanism.data import MechanismData

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

#: A dataclass of arrays over samples, and of mappings of arrays or of such records.
Record = TypeVar("Record", bound="DataclassInstance")


@dataclass(frozen=True)
class ContactStates:
    """A joint with clearance in n states; shapes and signs as in ``engine.Contact``.

    ``rate_m_s`` (n,) is that of the penetration; the losses (n,) are in W.
    """

    gap_m: FloatArray
    penetration_m: FloatArray
    normal_force_N: FloatArray
    friction_force_N: FloatArray
    rate_m_s: FloatArray
    normal_loss_W: FloatArray
    friction_loss_W: FloatArray


@dataclass(frozen=True)
class Reactions:
    """Forces of joints (n, 2), of guides (n,), their moments (n,), and the drive's torque or force (n,).

    Names and signs are those of ``engine.Trajectory``.
    """

    joint_force_N: dict[str, FloatArray]
    guide_force_N: dict[str, FloatArray]
    guide_moment_N_m: dict[str, FloatArray]
    driver_torque_N_m: FloatArray | None


def force_on_pin(contact: Contact | ContactStates) -> FloatArray:
    """Return the force of a bearing on its pin, (n, 2) in N."""
    distance = np.maximum(np.hypot(*contact.gap_m.T), np.finfo(float).tiny)
    x, y = contact.gap_m.T / distance
    force = -contact.normal_force_N * np.array([x, y])
    if contact.friction_force_N is not None:
        force += contact.friction_force_N * np.array([-y, x])
    return np.asarray(force.T)


def reactions_of(
    of: MechanismData,
    multipliers: FloatArray,
    contacts: Mapping[str, Contact | ContactStates],
    torque: FloatArray | None,
) -> Reactions:
    """Return multipliers (n, m) in the order of the rows by name, beside what contacts do.

    ``torque`` (n,) is that of a drive that prescribes no motion.
    """
    rows, forces = iter(multipliers.T), dict[str, FloatArray]()
    for pin in of.ideal:
        forces[pin.name] = np.stack([next(rows), next(rows)], axis=-1)
    for pin in of.loose:
        force = force_on_pin(contacts[pin.name])
        forces[pin.name] = -force if pin.bearing_on_j else force
    across, moments = dict[str, FloatArray](), dict[str, FloatArray]()
    for guide in of.guides:
        across[guide.name] = next(rows)
        if not guide.turns:
            moments[guide.name] = next(rows)
    ordered = {pin.name: forces[pin.name] for pin in of.pins}
    return Reactions(ordered, across, moments, next(rows) if of.drive.prescribes else torque)


def selected(record: Record, which: slice | NDArray[Any]) -> Record:
    """Return a record, and what it holds by name, with some of its samples; impacts all stay."""

    def some(value: Any) -> Any:
        return value[which] if isinstance(value, np.ndarray) else selected(value, which)

    kept: dict[str, Any] = {}
    for name, value in vars(record).items():
        if isinstance(value, Mapping):
            kept[name] = {key: some(part) for key, part in value.items()}
        elif isinstance(value, np.ndarray):
            kept[name] = some(value)
    return replace(record, **kept)
