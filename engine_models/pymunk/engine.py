"""Planar mechanisms in Pymunk (Chipmunk): joint impulses and position-first semi-implicit Euler.

One ``space.step(dt)`` first moves the positions with the stored velocities, then kicks the velocities by the
loads and by the impulses of joints and contacts, all at the new positions. The impulses also take the joints'
position errors back. So after step k the positions x_k are those of t_k = k dt, and the kick was made at x_k.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from engine_models.engine import SETTINGS_CONFIG, BareRun, RunSettings, Trajectory, UnsupportedScene
from engine_models.kernels import CompiledEngine
from engine_models.mechanics.start import checked_start, unwound
from engine_models.memory import require_memory
from engine_models.pace import require_followed
from engine_models.pymunk.inputs import Inputs
from engine_models.pymunk.joints.balance import balanced
from engine_models.pymunk.joints.dampers import damped, dampers_of, require_damped
from engine_models.pymunk.joints.plan import Plan, plan_of
from engine_models.pymunk.joints.sweeps import (
    LEFT_OVER,
    LEFT_OVER_WITH_CONTACTS,
    THINNED,
    Convergence,
    are_apart,
    convergence_of,
    path_of,
)
from engine_models.pymunk.model import build
from engine_models.pymunk.rigid_twin import rigid_twin
from engine_models.pymunk.run import pymunk_bare_run, pymunk_run
from engine_models.pymunk.stepping import Model
from engine_models.pymunk.workspace import Workspace
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import ConstantSpeed

#: Pymunk's own defaults: joints and contacts lose a tenth of their position error every sixtieth of a second.
LIBRARY_ITERATIONS, LIBRARY_ERROR_BIAS = 10, (1.0 - 0.1) ** 60.0
LIBRARY_SLOP_M, LIBRARY_PERSISTENCE = 0.1, 3
#: Masses are balanced where that saves so many sweeps, or one where a drive prescribes the motion: elsewhere
#: one is not worth what it changes of the error (four-bars: up to 28 % more).
SAVED = 2
#: What fits into a C int.
Count = Annotated[int, Field(gt=0, lt=2**31)]


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class PymunkEngine(CompiledEngine):
    """Settings of the Pymunk model; the defaults are its best practice, ``out_of_the_box`` is Pymunk's own.

    With ``joints`` = "fewest" Pymunk is given no joint that it can do without (see ``joints.plan``), and
    masses at pins are balanced (see ``joints.balance``). With "all" every ideal pin and guide has a joint,
    but for those that hold what a drive moves, and bodies have their own masses.

    ``joint_order`` is the one in which sweeps meet the joints: pins and then guides, as in the file, or the
    other way round. None converges faster: with two sweeps errors in all orders of the joints of set F are
    within 2 % of each other, and those of Andrews' squeezer and of a V-twin within 1 % with their own sweeps.

    ``iterations`` is the number of Gauss-Seidel sweeps over the joints in a step; without one, a scene gets
    as many as leave at most ``sweeps_leave`` of an open joint (see ``joints.sweeps``, which has its default).
    ``error_bias`` is the fraction of a joint's position error
    left after a second: 0 takes all of it back in every step, which needs enough sweeps to be stable.

    With ``half_kick_start`` the run begins with a kick over dt/2 that moves nothing. The scheme is then the
    leap-frog, of order 2: the velocity stored after step k is that of t_k + dt/2. Reported at t_k are x_k,
    the mean of the velocities before and after kick k, and the forces that made kick k. The first three
    kicks are an exception. The joints learn how their paths curve from the gap that a step opens; kick 0 sees
    none, so it lacks the centripetal half impulse, which kick 1 adds to its own; kick 2 makes up for how the
    path has changed. Their sum is right, and so is the motion, but none is the force of its time: the
    accelerations at steps 0 to 2 are the parabola through those of steps 3 to 5, and forces (and the
    velocities at steps 1 and 2) follow from them.

    Without it all is as a user reads it after step k, of order 1: x_k, the stored velocity, the forces that
    made kick k, all taken as those of t_k. There is no kick at t = 0, so step 1's acceleration stands there.
    Step 1 has no earlier impulses to start its sweeps from: forces at t = 0 and for some steps more are off
    by what ten sweeps leave, however short the step, and with ``error_bias`` 0 also by kick 1's extra half.

    Drives and loads. A prescribed motion is set before every step, and so are loads, springs and torques, as
    Pymunk's manual has it (``inputs``). They are those of the positions in the kick. A damper of what moves
    its body alone is implicit (``joints.dampers``): it acts on the mean velocity of a kick, in steps below
    2 m/c, or without the half kick on the velocity after it, in any steps. What other dampers and tables over
    a speed feel is foreseen from the last two kicks, which keeps order 2 and takes a step below m/c; without
    the half kick it is what a user reads. A table's acceleration has kinks at its entries: in the two steps
    after one forces are of order 1, and with few sweeps in some more.

    Contacts. With ``contact`` = "as-scene" a compliant law is applied as a force in every kick
    (``compliant_contact``) and a rigid one is Pymunk's native contact (``native_contact``); "rigid" makes the
    compliant ones native too, with the restitution they name (see ``twin``). Rigid walls are of order 1,
    since a contact is noticed in the first step that is past the wall, and so are laws with damping or
    friction, which know the speeds of half a step before; Hertz's alone is of order 2. Forces at t_k are
    impulses of kick k over dt, means over a step: a rigid impact's peak grows as 1/dt and means nothing, its
    impulse does. At a kick that strikes a rigid wall (the first of a contact) the velocity reported is the
    one before, and losses and work are those before.

    Steps. Pymunk's manual advises steps of one length, which is the default. With ``shorter_in_contact`` they
    are that many times shorter in contact, and from two long steps before a touch on, foreseen along straight
    lines. The change is abrupt, as a joint answers to it for two steps, and a kick's loads last from the
    middle of the step before it to the middle of the one after, so that the order stays what it is. Samples
    between steps are interpolated (see ``samples.interpolated``), at that order. It pays
    where flights are long and contacts brief; forces within two steps of a change are not those of their
    time. It is for compliant contacts, half a kick at the start, and drives that know no step; all dampers
    are foreseen then.

    The other settings are for native contacts alone. ``contact_iterations`` are the sweeps of a step in
    contact: impulses must get through the joints within one step, or a bounce is lost (in the free scenes ten
    sweeps lose up to 80 % of one at any step; 100 are within 1e-3 of 400). ``collision_bias`` is the fraction
    of a penetration left after a second, ``collision_slop_m`` the penetration left alone. Pymunk takes it
    back by moving the two bodies with no regard for their joints, whose own correction turns that into
    velocity. At 0 all of it is taken back within a step: a pin that follows its wall leaves it at every other
    step, with 4 times the error and 12 times the energy residual of 1e-300, a rate of 690/s (set R, 0.1 mm,
    e = 0.5, over a revolution at dt = 1.2e-7 s). The library's own rate, 6.3/s, lets the drift along the wall
    add up: twice the error at 1e-6 s. ``collision_persistence`` is the number of steps that a contact is
    remembered.
    """

    joints: Literal["fewest", "all"] = "fewest"
    joint_order: Literal["pins-first", "reversed"] = "pins-first"
    iterations: Count | None = None
    sweeps_leave: Annotated[float, Field(gt=0, lt=0.5)] | None = None
    shorter_in_contact: Annotated[float, Field(ge=1, le=16)] = 1.0
    error_bias: Annotated[float, Field(ge=0, lt=1)] = 0.0
    half_kick_start: bool = True
    contact: Literal["as-scene", "rigid"] = "as-scene"
    contact_iterations: Count = 200
    collision_bias: Annotated[float, Field(ge=0, le=1)] = 1e-300
    collision_slop_m: Annotated[float, Field(ge=0)] = 0.0
    collision_persistence: Count = 1
    any_mechanism: ClassVar[bool] = True

    @classmethod
    def out_of_the_box(cls) -> "PymunkEngine":
        """Return the engine as it is for a user who sets nothing."""
        return cls(
            joints="all",
            iterations=LIBRARY_ITERATIONS,
            error_bias=LIBRARY_ERROR_BIAS,
            half_kick_start=False,
            contact_iterations=LIBRARY_ITERATIONS,
            collision_bias=LIBRARY_ERROR_BIAS,
            collision_slop_m=LIBRARY_SLOP_M,
            collision_persistence=LIBRARY_PERSISTENCE,
        )

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene for a guide, or for a law without a restitution, that Pymunk cannot express.

        So is a scene without the steps asked for.
        """
        plan_of(self.twin(scene).mechanism, self.joints == "fewest")

    def twin(self, scene: Scene) -> Scene:
        """Return the scene itself, or with ``contact`` = "rigid" the same one with rigid laws throughout.

        Raises:
            UnsupportedScene: see ``check``.
        """
        twin = rigid_twin(scene) if self.contact == "rigid" else scene
        fixing = [*needs_one_step(twin), *([] if self.half_kick_start else ["half_kick_start = False"])]
        if self.shorter_in_contact > 1 and fixing:
            raise UnsupportedScene(
                "pymunk with shorter_in_contact > 1: expected nothing that needs steps of one length, "
                f"got {', '.join(fixing)}"
            )
        return twin

    @property
    def order(self) -> float:
        """The leap-frog's, or without the half kick at the start the library's own."""
        return 2 if self.half_kick_start else 1

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene with steps of one length, or shorter ones in contact.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: a joint came apart by more than a tenth of the longest lever, a pin went through
                the wall of its bearing, the numbers overflowed, a damper is too strong for the step, or the
                driver's speed changes within a step.
        """
        require_memory(scene, settings)
        model = self._model(self.twin(scene), settings)
        with np.errstate(all="ignore"):  # overflow ends as a failure with its time, not as a warning
            return unwound(scene, pymunk_run(model, settings))

    def bare_run(self, scene: Scene, settings: RunSettings) -> BareRun:
        """Return the same steps, of which works and forces need nothing.

        Raises:
            UnsupportedScene, SimulationFailed: as ``simulate`` does.
        """
        model = self._model(self.twin(scene), settings)
        with np.errstate(all="ignore"):
            return pymunk_bare_run(model, settings)

    def _model(self, scene: Scene, settings: RunSettings) -> Model:
        of, step_s = scene.mechanism, settings.step_used_s(scene.end_time_s)
        require_followed(scene, step_s)
        plan = plan_of(of, self.joints == "fewest")
        if self.joint_order == "reversed":
            plan = replace(plan, joints=plan.joints[::-1])
        dampers = dampers_of(of, self.shorter_in_contact == 1)
        require_damped(of, plan, dampers, step_s, self.half_kick_start)
        start, velocity = checked_start(scene)
        left = self.sweeps_leave or (LEFT_OVER_WITH_CONTACTS if scene.joints_with_clearance else LEFT_OVER)
        heavier = partial(damped, dampers=dampers, damped_s=step_s / 2 if self.half_kick_start else step_s)
        plan, convergence = self._settled(scene, plan, heavier, left)
        sweeps = self.iterations or convergence.sweeps(left)
        space, bodies = build(plan, of.gravity_m_s2, start, velocity, sweeps, self.error_bias)
        space.collision_bias, space.collision_slop = self.collision_bias, self.collision_slop_m
        space.collision_persistence = self.collision_persistence
        inputs = Inputs(of, plan, dampers)
        workspace = Workspace(space, bodies, inputs, scene.clearances, self.contact_iterations)
        return Model(
            scene,
            plan,
            start,
            space,
            bodies,
            inputs,
            workspace,
            convergence,
            self.half_kick_start,
            self.shorter_in_contact,
        )

    def _settled(
        self, scene: Scene, plan: Plan, heavier: Callable[[Plan], Plan], left: float
    ) -> tuple[Plan, Convergence]:
        """Return the plan with dampers, balanced where that saves sweeps, and how these converge."""
        own = heavier(plan)
        if are_apart(plan):
            return own, Convergence(0.0)
        path = path_of(scene)
        found = convergence_of(own, path)
        rigid = any(room.law == "rigid" for room in scene.clearances.values())
        sweeps = found.sweeps(left)
        if self.joints == "all" or rigid or sweeps == 1:
            return own, found
        other = heavier(balanced(plan, path[::THINNED]))
        faster = convergence_of(other, path)
        saved = sweeps - faster.sweeps(left)
        pays = saved >= (1 if scene.mechanism.drive.prescribes else SAVED)
        return (other, faster) if pays else (own, found)


def needs_one_step(scene: Scene) -> list[str]:
    """Return what of a scene is made for steps of one length: native contacts and changing speeds."""
    joints, law = scene.clearances.items(), scene.mechanism.drive.law
    changes = scene.mechanism.drive.prescribes and not isinstance(law, ConstantSpeed)
    return [
        *(f"clearance.{name}.law = rigid" for name, clearance in joints if clearance.law == "rigid"),
        *([f"drive.kind = {scene.drive.kind}"] if changes else []),
    ]
