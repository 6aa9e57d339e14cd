"""A run as the drawing of its mechanism: where bodies, joints, guides, springs, loads and forces are."""

from collections.abc import Iterator
from dataclasses import dataclass
from statistics import median_low

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.loads import load_forces, load_torques
from engine_models.mechanics.states import (
    GROUND,
    Line,
    Pin,
    Point,
    Spring,
    direction,
    guide_column,
    line_angle_rad,
    point_motion,
    way,
)
from engine_models.mechanics.wrenches import sum_of
from engine_models.scene.scene import Scene
from reports.run.film import Drawing, Force, Guide, Joint, Mark

#: A body, or the ground, and a point of it.
End = tuple[int, Point]
#: A pin nearer to its body's centre of mass than this part of the radius of gyration is at the centre.
CENTRED = 1e-6
#: A typical link is at most this part of the diagonal of all places, and at least that of the longest link.
OF_DIAGONAL, OF_LONGEST = 0.25, 0.1


@dataclass
class Shape:
    """A mechanism in the n samples of a run, of which a film is made.

    Gaps are drawn ``exaggerate`` times as large: the pin of a joint is moved away from its bearing, or the
    bearing from a pin on the ground or on a block.
    """

    scene: Scene
    run: Trajectory
    exaggerate: float = 1.0

    def __post_init__(self) -> None:
        self.of, self.time_s = self.scene.mechanism, self.run.time_s
        self.position, self.velocity = self.run.position, self.run.velocity
        self.blocks = {guide.body_j for guide in self.of.guides if not guide.turns}
        self.moved: dict[End, FloatArray] = {}
        held = {GROUND, *self.blocks}
        for joint in self.of.loose:
            bearing, pin = _bearing_and_pin(joint)
            more = (self.exaggerate - 1) * (self.place(pin) - self.place(bearing))
            if pin[0] in held and bearing[0] not in held:
                self.moved[bearing] = -more
            else:
                self.moved[pin] = more

    def drawing(self) -> Drawing:
        """Return the mechanism as it is drawn."""
        corners = {k: points for k in range(len(self.of.bodies)) if (points := self.corners(k))}
        bodies = {self.of.names[body]: self.polygon(body, points) for body, points in corners.items()}
        guides = {guide.name: self._guide(guide, not guide.turns) for guide in self.of.guides}
        places = [each.reshape(-1, 2) for each in bodies.values()] + [each.pin_m for each in guides.values()]
        return Drawing(
            time_s=self.time_s,
            link_m=_typical_m([_length_m(points) for points in corners.values()], np.concatenate(places)),
            bodies=bodies,
            joints={pin.name: self._joint(pin) for pin in self.of.pins},
            feet=self._feet(),
            guides=guides,
            springs=[np.stack([self.place(end) for end in _ends(each)], axis=1) for each in self.of.springs],
            loads=[*self._loads()],
            drive=self._drive(),
            forces=dict(self._forces()),
            exaggeration=self.exaggerate,
        )

    def place(self, end: End) -> FloatArray:
        """Return the place of a point of a body in m, (n, 2), as it is drawn."""
        true = point_motion(*end, self.position, self.velocity).place_m
        return true + self.moved.get(end, 0.0)

    def corners(self, body: int) -> list[Point]:
        """Return the points of a body that are its corners: two at least, or none of a mere block.

        They are where it is joined to others, and the point that is observed. To a single one comes the
        centre of mass, or if it is that, a point as far from it as the radius of gyration.
        """
        points, observed = self._joined(body), self.scene.observed
        if observed.body == body and observed.what in "xy" and observed.point not in points:
            points.append(observed.point)
        if len(points) == 1 and body in self.blocks:
            return []
        if len(points) == 1:
            radius = float(np.sqrt(self.of.bodies[body].inertia_kg_m2 / self.of.bodies[body].mass_kg))
            points.append((radius, 0.0) if np.hypot(*points[0]) < CENTRED * radius else (0.0, 0.0))
        about = np.array(points) - np.mean(points, axis=0)
        return [points[k] for k in np.argsort(np.arctan2(about[:, 1], about[:, 0]), kind="stable")]

    def polygon(self, body: int, corners: list[Point]) -> FloatArray:
        """Return the places of corners in m, (n, corners, 2); free ones move as the mean of joined ones."""
        joined = self._joined(body)
        mean = sum(self.moved.get((body, point), 0.0) for point in joined) / max(len(joined), 1)
        places = [self.place((body, point)) + (0.0 if point in joined else mean) for point in corners]
        return np.stack(places, axis=1)

    def _joined(self, body: int) -> list[Point]:
        """Return the points of a body at its joints, springs and guides, and amid its slots, each once."""
        linked: list[Pin | Spring] = [*self.of.pins, *self.of.springs]
        ends = [end for each in linked for end in _ends(each)]
        for guide in self.of.guides:
            ends += [_ends(guide)[1], _on(guide, sum(self._reach_m(guide)) / 2)]
        return list(dict.fromkeys(point for own, point in ends if own == body))

    def _joint(self, pin: Pin) -> Joint:
        bearing, own = (self.place(end) for end in _bearing_and_pin(pin))
        return Joint(bearing, own, self._clearance_m(pin))

    def _clearance_m(self, pin: Pin) -> float:
        return self.exaggerate * pin.clearance.radial_clearance_m if pin.clearance else 0.0

    def _feet(self) -> dict[Point, float]:
        """Return the clearances of bearings of the ground, as large as drawn, by the places of its pins."""
        feet = {point: 0.0 for each in self.of.springs for body, point in _ends(each) if body == GROUND}
        for pin in self.of.pins:
            if pin.body_i == GROUND:
                feet[pin.point_i] = 0.0 if pin.bearing_on_j else self._clearance_m(pin)
        return feet

    def _guide(self, line: Line, has_block: bool) -> Guide:
        ends = [self.place(_on(line, way_m)) for way_m in self._reach_m(line)]
        return Guide(
            self.place(_ends(line)[1]), np.stack(ends, axis=1), line_angle_rad(line, self.position), has_block
        )

    def _reach_m(self, line: Line) -> tuple[float, float]:
        """Return how far a line's point goes along it, both ways."""
        along, _ = way(line, self.position, self.velocity)
        return float(along.min()), float(along.max())

    def _loads(self) -> Iterator[Mark]:
        """Yield a mark of the sum of forces on a body along a line, and one of its torque."""
        forces = load_forces(self.of, self.time_s, self.position, self.velocity)
        torques = load_torques(self.of, self.time_s, self.velocity)
        for load in self.of.loads:
            name = self.of.names[load.body]
            force, torque = (sum_of(parts, f"{name}.", len(self.time_s)) for parts in (forces, torques))
            if load.line is not None:
                yield Mark(
                    self.place(_ends(load.line)[1]), line_angle_rad(load.line, self.position), np.sign(force)
                )
            if torque.any():
                yield Mark(self.place((load.body, (0.0, 0.0))), None, np.sign(torque))

    def _drive(self) -> Mark | None:
        """Return the mark of the drive: at a driven guide's pin, or where its body is joined to the ground.

        It has the sense of the motion that is prescribed, or of the torque.
        """
        drive = self.of.drive
        if drive.law is None:
            return None
        if drive.guide is not None:
            guide = self.of.guides[drive.guide]
            return Mark(
                self.place(_ends(guide)[1]), line_angle_rad(guide, self.position), np.ones(len(self.time_s))
            )
        pivots = [_ends(pin)[1] for pin in self.of.pins if (pin.body_i, pin.body_j) == (GROUND, drive.body)]
        sense = self.velocity[:, drive.body, 2] if drive.prescribes else self.run.driver_torque_N_m
        return Mark(self.place([*pivots, (drive.body, (0.0, 0.0))][0]), None, np.sign(np.asarray(sense)))

    def _forces(self) -> Iterator[tuple[str, Force]]:
        """Yield the forces of joints, each on the body named later, and of guides, by what they are."""
        run, names = self.run, self.of.names
        for pin in self.of.pins:
            force = Force(self.place(_ends(pin)[1]), run.joint_force_N[pin.name])
            yield f"joint {pin.name} on the {names[pin.body_j]}", force
        for guide in self.of.guides:
            across = direction(guide, self.position)[1] * run.guide_force_N[guide.name][:, None]
            name = guide_column(self.scene, guide.name).removesuffix("_normal_force_N").replace("_", " ", 1)
            yield f"{name} on the {names[guide.body_j]}", Force(self.place(_ends(guide)[1]), across)


def _ends(linked: Pin | Spring | Line) -> tuple[End, End]:
    return (linked.body_i, linked.point_i), (linked.body_j, linked.point_j)


def _bearing_and_pin(pin: Pin) -> tuple[End, End]:
    first, later = _ends(pin)
    return (later, first) if pin.bearing_on_j else (first, later)


def _on(line: Line, way_m: float) -> End:
    """Return the point at a way along a line, of the body that the line is on."""
    x, y = line.point_i
    cos, sin = float(np.cos(line.angle_rad)), float(np.sin(line.angle_rad))
    return line.body_i, (x + way_m * cos, y + way_m * sin)


def _length_m(points: list[Point]) -> float:
    """Return the largest distance between two points of a body."""
    places = np.array(points)
    return float(np.hypot(*(places[:, None] - places).T).max())


def _typical_m(links_m: list[float], places: FloatArray) -> float:
    """Return a length by which sizes are chosen: a usual link's, or less if all places (n, 2) are near."""
    most = OF_DIAGONAL * float(np.hypot(*np.ptp(places, axis=0)))
    usual = [length for length in links_m if length >= OF_LONGEST * max(links_m)]
    return min([median_low(usual), most] if usual else [most]) or 1.0
