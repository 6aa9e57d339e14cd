"""What every engine owes on every scene, whatever its method: each claim once, for all of them."""

from dataclasses import dataclass

import pytest

SMOOTH = ("free", "clocked", "tabled", "everything", "bead", "yoke")
LOOSE = ("rubbing", "bearing", "loop", "linear", "rigid", "walls")


@dataclass(frozen=True)
class Owes:
    """The order of smooth motion, None where a tolerance decides; largest errors, smooth and with impacts."""

    order: int | None
    smooth: float
    loose: float


#: Two to five times what is measured at the shorter step, as a part of the largest of its kind.
ENGINES = {
    "reference": Owes(4, 6e-10, 2e-6),
    "exudyn": Owes(2, 1e-4, 3e-4),
    "pymunk": Owes(2, 4e-4, 1e-2),
    "scipy": Owes(None, 1e-11, 5e-6),
}
#: Methods of theirs, on a scene: their order past the first samples, None where a tolerance decides.
METHODS = {
    ("reference method=dop853", "everything"): None,
    ("reference method=dopri5", "everything"): None,
    ("reference kernel=readable", "everything"): 4,
    ("reference stabilisation=none", "everything"): 4,
    ("reference stabilisation=baumgarte", "everything"): 4,
    ("exudyn solver=GeneralizedAlpha", "everything"): 2,
    ("exudyn solver=RK44", "bead"): 4,  # it has no loops
    ("exudyn solver=DOPRI5", "bead"): None,
    ("pymunk joints=all", "everything"): 2,
    ("scipy method=LSODA", "everything"): None,
    ("scipy coordinates=minimal", "everything"): None,
}
#: What is not an engine's, and in which words.
REFUSED = {
    ("exudyn", "rigid"): "exudyn has no rigid contact",
    ("exudyn", "walls"): "exudyn has no rigid contact",
    ("pymunk", "bead"): "Chipmunk's groove",
    ("pymunk", "yoke"): "Chipmunk's groove",
    ("scipy", "walls"): "bounces accumulate at t = 0.001458",
}
PAIRS = [(name, of) for name in ENGINES for of in (*SMOOTH, *LOOSE) if (name, of) not in REFUSED]
pairs = pytest.mark.parametrize(("name", "of"), PAIRS, ids=map("-".join, PAIRS))
each = pytest.mark.parametrize("name", ENGINES)
#: Odd numbers of steps between samples, as an even one would hide a force that rings from step to step.
STEPS, MANY = (27, 81), (243, 729)
#: An error below this part of the largest is round-off, and has no order.
ROUND_OFF = 1e-10
