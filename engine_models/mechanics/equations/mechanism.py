"""The scene as a mechanism of the reference solver."""

from engine_models.engine import SimulationFailed
from engine_models.scene.parts import AnyScene
from reference_solver.mechanism import building
from reference_solver.mechanism.mechanism import Load, Mechanism


def mechanism_of(scene: AnyScene) -> Mechanism:
    """Return the mechanism; a joint with clearance has no rows, and is a contact.

    Raises:
        SimulationFailed: the stiffness of a contact overflows.
    """
    try:
        return building.mechanism_of(scene.mechanism)
    except OverflowError as reason:
        raise SimulationFailed(str(reason)) from None


def loads_of(scene: AnyScene) -> dict[str, Load]:
    """Return the mechanism's loads in their order by their names (see ``building.loads_of``)."""
    return building.loads_of(scene.mechanism)
