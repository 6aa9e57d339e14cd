"""How many Gauss-Seidel sweeps over its joints a scene needs in a step: by how slowly they converge there.

A sweep goes from joint to joint and gives each the impulse that closes it. What it leaves open of all joints
is G times what was open before, with G = -(D + L)^-1 U of the joints' matrix J M^-1 J^T = L + D + U, and n
sweeps leave rho^n, rho the largest eigenvalue of G. Where all of a position error is taken back in a step,
runs break up if more than half is left: measured, with bodies 100 times heavier and 10 times lighter than the
library's, between 0.45 and 0.65. With a third left the errors of all signals are within a few per cent of
those of a hundred sweeps. A contact, though, comes as a surprise to joints that begin with their last
impulses: with a third left positions are off by three times as much, and velocities after a rigid impact by
ten times; with a thirtieth, by some per cent more.
"""

import math

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.assembly import assembled
from engine_models.mechanics.joints import CRANK, SLIDER, axis, ends
from engine_models.pymunk.model import crank_is_kinematic
from engine_models.scene.scene import Scene

#: What sweeps may leave, and with contacts.
LEFT_OVER, LEFT_OVER_WITH_CONTACTS = 1 / 3, 1 / 30
#: How many there are at least, and at most: a step of as many takes 30 us.
FEWEST, MOST = 4, 1000
#: Dampers take part in the sweeps without being in the matrix.
FEWEST_WITH_DAMPERS = 10
#: Crank angles at which joints are looked at, over half a revolution: the other half is its mirror image.
ANGLES = 9


def needed_sweeps(scene: Scene, left: float | None = None) -> int:
    """Return the number of sweeps that leave no more than a part of an open joint, wherever the crank is."""
    rate = float(np.max([_rate(scene, angle) for angle in np.linspace(0.0, np.pi, ANGLES).tolist()]))
    load = scene.load.slider
    damped = scene.drive.kind == "motor" or (load is not None and bool(load.viscous_N_s_m))
    fewest = FEWEST_WITH_DAMPERS if damped else FEWEST
    if left is None:
        left = LEFT_OVER_WITH_CONTACTS if scene.joints_with_clearance else LEFT_OVER
    if not rate < 1:  # NaN among them
        return MOST
    needed = math.ceil(math.log(left) / math.log(rate)) if rate > 0 else 0
    return min(max(needed, fewest), MOST)


def _rate(scene: Scene, angle_rad: float) -> float:
    """Return rho at a crank angle of the ideal mechanism; NaN where it cannot be told."""
    rows, joints = _rows(scene, angle_rad)
    with np.errstate(all="ignore"):
        matrix = (rows / _inertias(scene)) @ rows.T
        done = joints[:, None] >= joints
        if not len(rows) or not np.isfinite(matrix).all():
            return math.nan if len(rows) else 0.0
        try:
            sweep = np.linalg.solve(np.where(done, matrix, 0.0), np.where(done, 0.0, matrix))
        except np.linalg.LinAlgError:
            return math.nan
        return float(np.abs(np.linalg.eigvals(sweep)).max()) if np.isfinite(sweep).all() else math.nan


def _inertias(scene: Scene) -> FloatArray:
    """Return mass, mass and moment of inertia of each body as Pymunk has them, (3 bodies,)."""
    inertias = np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in scene.bodies])
    if scene.is_crank_slider:
        inertias[SLIDER, 2] = math.inf
    if scene.speed_is_prescribed:
        inertias[CRANK] = math.inf if crank_is_kinematic(scene) else [*inertias[CRANK, :2], math.inf]
    return inertias.ravel()


def _rows(scene: Scene, angle_rad: float) -> tuple[FloatArray, FloatArray]:
    """Return J (rows, 3 bodies) of the ideal joints and the guide, and the joint that each row belongs to."""
    position, _ = assembled(scene, angle_rad, 0.0)
    turned = axis(position[:, 2])
    blocks = []
    for name, (pin, bearing) in ends(scene).items():
        if name in scene.joints_with_clearance or (name == "O" and crank_is_kinematic(scene)):
            continue
        block = np.zeros((2, len(position), 3))
        for sign, (body, place_m) in ((1.0, pin), (-1.0, bearing)):
            if body is not None:
                x, y = place_m * turned[body]
                block[:, body] += sign * np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
        blocks.append(block.reshape(2, -1))
    if scene.is_crank_slider:
        guide = np.zeros((1, 3 * len(position)))
        guide[0, 3 * SLIDER + 1] = 1.0
        blocks.append(guide)
    rows = np.concatenate(blocks) if blocks else np.zeros((0, 3 * len(position)))
    return rows, np.repeat(np.arange(len(blocks)), [len(block) for block in blocks])
