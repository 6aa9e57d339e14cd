"""The compiled loop against plain Pymunk: a crank-slider with room at B, by Python callbacks of its own."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pymunk
import pytest

from engine_models.engine import FloatArray, RunSettings, UnsupportedScene
from engine_models.pymunk import self_test
from engine_models.pymunk.compiled.chipmunk import FUNCTIONS
from engine_models.pymunk.engine import PymunkEngine
from engine_models.scene.library import SCENES, clearance_driven_damped
from engine_models.scene.scene import Clearance, Scene

#: Round-off of 2000 steps and some impacts, in m and rad; measured 5e-15.
ROUND_OFF = 1e-12
STEPS, END_S, SWEEPS = 2000, 2e-3, 20


def plain_space(scene: Scene) -> tuple[pymunk.Space, pymunk.Body, pymunk.Body]:
    """Return a space with a crank at constant speed, a rod pinned to it and a slider, and the last two."""
    assert scene.rod is not None
    assert scene.slider is not None
    space, speed = pymunk.Space(), scene.start.crank_speed_rad_s
    space.iterations, space.gravity = SWEEPS, (0.0, -scene.weight_m_s2)
    r, length, d = scene.crank.length_m, scene.rod.length_m, scene.rod.centre_of_mass_m
    crank = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    rod = pymunk.Body(scene.rod.mass_kg, scene.rod.inertia_kg_m2)
    slider = pymunk.Body(scene.slider.mass_kg, math.inf)
    crank.angular_velocity, rod.angular_velocity = speed, -r / length * speed  # at the outer dead centre
    rod.position, slider.position = (r + d, 0.0), (r + length, 0.0)
    rod.velocity = (0.0, speed * r * (1 - d / length))
    pivot = pymunk.PivotJoint(crank, rod, (r, 0.0), (-d, 0.0))
    guide = pymunk.GrooveJoint(space.static_body, slider, (-1.0, 0.0), (1.0, 0.0), (0.0, 0.0))
    pivot.error_bias = guide.error_bias = 0.0
    space.add(crank, rod, slider, pivot, guide)
    return space, rod, slider


def gap_of(rod: pymunk.Body, slider: pymunk.Body, place_m: float) -> tuple[pymunk.Vec2d, pymunk.Vec2d]:
    """Return the vector from the rod's bearing to the slider's pin, and how fast it changes."""
    d = slider.position - rod.local_to_world((place_m, 0.0))
    return d, slider.velocity - rod.velocity_at_local_point((place_m, 0.0))


def pushed_by_its_law(space: pymunk.Space, rod: pymunk.Body, slider: pymunk.Body, scene: Scene) -> None:
    """Have the law of Hu and Guo with hyperbolic friction act, as a hook of a joint that never does."""
    room, place = scene.clearance.B, scene.rod.length_m - scene.rod.centre_of_mass_m  # type: ignore[union-attr]
    assert room is not None
    assert room.friction is not None
    assert room.restitution is not None
    R, c, e, mu = room.bearing_radius_m, room.radial_clearance_m, room.restitution, room.friction.coefficient
    K, full = stiffness(room), room.friction.regularisation_speed_m_s
    began = [0.0]

    def push(_joint: Any, _space: Any) -> None:
        d, rate = gap_of(rod, slider, place)
        delta = d.length - c
        if delta <= 0:
            began[0] = 0.0
            return
        n = d / d.length
        began[0] = began[0] or n.dot(rate)
        law = K * delta**1.5 * max(0.0, 1 + 3 * (1 - e) / (2 * e) * n.dot(rate) / began[0])
        sliding = n.cross(rate) - rod.angular_velocity * (R + delta / 2)
        rub = mu * law * math.tanh(sliding / full)
        force = -law * n - rub * n.perpendicular()
        at = rod.local_to_world((place, 0.0)) + (R + delta / 2) * n
        slider.apply_force_at_world_point(force, at)
        rod.apply_force_at_world_point(-force, at)

    hook = pymunk.SlideJoint(rod, slider, (place, 0.0), (0.0, 0.0), 0.0, math.inf)
    hook.pre_solve, hook.max_force = push, 0.0
    space.add(hook)


def stiffness(room: Clearance) -> float:
    """Return Hertz's stiffness of a pin in a hole of the same material."""
    assert room.young_modulus_Pa is not None
    assert room.poisson_ratio is not None
    R, c = room.bearing_radius_m, room.radial_clearance_m
    compliance = (1 - room.poisson_ratio**2) / room.young_modulus_Pa
    return 4 / (3 * 2 * compliance) * math.sqrt(R * (R - c) / c)


def bounced_natively(space: pymunk.Space, rod: pymunk.Body, slider: pymunk.Body, scene: Scene) -> None:
    """Have a circle in a circle, whose contact is made one from inside before it is solved."""
    room, place = scene.clearance.B, scene.rod.length_m - scene.rod.centre_of_mass_m  # type: ignore[union-attr]
    assert room is not None
    R, c = room.bearing_radius_m, room.radial_clearance_m
    hole, pin = pymunk.Circle(rod, R, (place, 0.0)), pymunk.Circle(slider, R - c)
    for kind, shape in enumerate((hole, pin), 1):
        shape.collision_type, shape.elasticity, shape.friction = kind, 1.0, 0.0
    hole.elasticity = room.restitution or 0.0
    space.collision_bias, space.collision_slop, space.collision_persistence = 1e-300, 0.0, 1

    def rewrite(arbiter: pymunk.Arbiter, _space: Any, _data: Any) -> None:
        d, _ = gap_of(rod, slider, place)
        arbiter.process_collision = d.length > c
        space.iterations = 200 if d.length > c else SWEEPS
        if d.length > c:
            n, points = d / d.length, arbiter.contact_point_set
            points.normal = -n
            points.points[0].point_a = rod.local_to_world((place, 0.0)) + R * n
            points.points[0].point_b = slider.position + (R - c) * n
            arbiter.contact_point_set = points

    space.on_collision(1, 2, pre_solve=rewrite)
    space.add(hole, pin)


def positions(rod: pymunk.Body, slider: pymunk.Body) -> list[list[float]]:
    return [[*body.position, body.angle] for body in (rod, slider)]


@pytest.mark.parametrize(
    ("scene", "contact"),
    [
        (clearance_driven_damped(), pushed_by_its_law),
        (SCENES["rigid-driven-0.5mm"](), bounced_natively),
    ],
    ids=["compliant", "native"],
)
def test_bodies_move_as_in_a_loop_of_python_with_callbacks(scene: Scene, contact: Any) -> None:
    scene = scene.model_copy(update={"end_time_s": END_S})
    space, rod, slider = plain_space(scene)
    contact(space, rod, slider, scene)
    path: list[list[list[float]]] = [positions(rod, slider)]
    for _ in range(STEPS):
        space.step(END_S / STEPS)
        path.append(positions(rod, slider))
    engine = PymunkEngine(iterations=SWEEPS, half_kick_start=False)
    trajectory = engine.simulate(scene, RunSettings(END_S / STEPS, STEPS))
    own: FloatArray = trajectory.position[:, 1:]
    assert np.abs(own - np.array(path)).max() < ROUND_OFF
    assert len(trajectory.contacts["B"].impacts.time_s) > 0


def test_a_pymunk_with_other_functions_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    self_test._unusable.cache_clear()
    monkeypatch.setitem(FUNCTIONS, "cpSpaceStep", "void(*)(struct cpSpace *, float)")
    with pytest.raises(
        UnsupportedScene, match=r"^pymunk .*: cpSpaceStep: expected .*float.*, got .*double.*$"
    ):
        PymunkEngine().simulate(clearance_driven_damped(), RunSettings(1e-4, 10))
    self_test._unusable.cache_clear()


def test_a_step_that_does_something_else_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    assert self_test._misstep() is None

    class Heavier(pymunk.Body):
        def __init__(self, mass: float, moment: float) -> None:
            super().__init__(mass, 2 * moment)

    monkeypatch.setattr("pymunk.Body", Heavier)
    assert "a step: expected" in str(self_test._misstep())


def test_asking_whether_a_scene_is_supported_compiles_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CRANKSLIDER_CACHE", str(tmp_path))
    PymunkEngine().check(clearance_driven_damped())
    assert not [*tmp_path.rglob("*.nbc")]
