"""The bodies that ideal joints hold together as one open tree: its links, and where its coordinates put them.

A crank-slider with clearance somewhere has no closed loop: its bodies are open chains, hanging from the crank
pivot or from the guide, and free bodies. In the coordinates of such chains no ideal joint needs a
constraint. The chains are the branches of one tree. A link's frame sits at its joint and its x axis points
along its body, from the body's first pin to its second.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.joints import CRANK, ROD, SLIDER
from engine_models.scene.scene import Scene

#: Position, velocity, acceleration of all bodies, each (n, bodies, 3) as in ``Trajectory``.
States = tuple[FloatArray, FloatArray, FloatArray]

#: What a joint's coordinate moves of its link's frame: x, y or the angle.
AXES = {"x": 0, "y": 1, "turn": 2}


@dataclass(frozen=True)
class TreeLink:
    """One link: its joint, whose coordinate moves or turns it against its parent, -1 being the ground.

    ``offset_m`` is the joint's place along the parent's x axis. ``body`` is None for a link without mass;
    ``centre_m`` is the place of the body's centre of mass along the link's own x axis.
    """

    parent: int
    joint: Literal["x", "y", "turn"]
    offset_m: float = 0.0
    body: int | None = None
    centre_m: float = 0.0


def tree_links(scene: Scene) -> tuple[TreeLink, ...]:
    """Return the tree of a crank-slider with clearance, parents first; empty if ideal joints hold nothing.

    A body that no ideal joint holds is in no tree, nor is a slider with clearance at B.
    """
    if not scene.is_crank_slider:
        return ()
    crank, rod, _ = scene.crank_slider()
    r, s, length, d = crank.length_m, crank.centre_of_mass_m, rod.length_m, rod.centre_of_mass_m
    at_O, at_A, at_B = (getattr(scene.clearance, joint) is None for joint in ("O", "A", "B"))
    links: list[TreeLink] = []
    if at_O or (at_A and not at_B):  # from the crank pivot, or afloat
        if not at_O:
            links += [TreeLink(-1, "x"), TreeLink(0, "y")]
        links.append(TreeLink(len(links) - 1, "turn", 0.0, CRANK, s))
        if at_A:
            links.append(TreeLink(len(links) - 1, "turn", r, ROD, d))
    if at_B:  # from the guide, backwards along the bodies
        links.append(TreeLink(-1, "x", 0.0, SLIDER))
        links.append(TreeLink(len(links) - 1, "turn", 0.0, ROD, d - length))
        if at_A:
            links.append(TreeLink(len(links) - 1, "turn", -length, CRANK, s - r))
    return tuple(links)


def tree_start(
    links: tuple[TreeLink, ...], position: FloatArray, velocity: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the tree's coordinates and their rates, each (links,), from the bodies', each (bodies, 3)."""
    q, v = np.zeros((2, len(links)))
    for k, link in enumerate(links):
        # A link without mass moves the next one that has a body.
        carried = next(other for other in links[k:] if other.body is not None)
        frame = np.stack([position[carried.body], velocity[carried.body], np.zeros(3)])[:, None]
        frame[:, :, :2] += _along(-carried.centre_m, frame)
        q[k], v[k], _ = frame[:, 0, AXES[link.joint]]
        parent = links[link.parent].body if link.parent >= 0 and link.joint == "turn" else None
        if parent is not None:
            q[k], v[k] = q[k] - position[parent, 2], v[k] - velocity[parent, 2]
    return q, v


def tree_states(
    links: tuple[TreeLink, ...], q: FloatArray, v: FloatArray, a: FloatArray
) -> Iterator[tuple[int, States]]:
    """Yield each body with its position, velocity and acceleration (n, 3) from the tree's (n, links)."""
    n = len(q)
    frames: list[FloatArray] = []  # (3, n, 3): position, velocity, acceleration of origin and angle
    for k, link in enumerate(links):
        frame = np.zeros((3, n, 3))
        if link.parent >= 0:
            frame += frames[link.parent]
            frame[:, :, :2] += _along(link.offset_m, frames[link.parent])
        frame[:, :, AXES[link.joint]] += np.stack([q[:, k], v[:, k], a[:, k]])
        frames.append(frame)
        if link.body is not None:
            centre = frame.copy()
            centre[:, :, :2] += _along(link.centre_m, frame)
            yield link.body, (centre[0], centre[1], centre[2])


def _along(distance_m: float, frame: FloatArray) -> FloatArray:
    """Return a distance along a frame's x axis with its two derivatives, (3, n, 2)."""
    angle, rate, acceleration = frame[:, :, 2]
    x = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    y = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    return np.asarray(
        distance_m * np.stack([x, rate[:, None] * y, acceleration[:, None] * y - (rate**2)[:, None] * x])
    )
