"""Planar mechanisms in Pymunk (Chipmunk): joint impulses and position-first semi-implicit Euler.

One ``space.step(dt)`` first moves the positions with the stored velocities, then kicks the velocities by the
loads and by the impulses of joints and contacts, all at the new positions. The impulses also take the joints'
position errors back. So after step k the positions x_k are those of t_k = k dt, and the kick was made at x_k.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from engine_models.engine import (
    SETTINGS_CONFIG,
    BareRun,
    RunSettings,
    T,
    Trajectory,
    UnsupportedScene,
    require_finite,
)
from engine_models.kernels import CompiledEngine
from engine_models.mechanics.crank_motion import require_followed
from engine_models.mechanics.start_check import checked_start, unwound
from engine_models.memory import require_memory
from engine_models.minimal.run import trajectory_of
from engine_models.pymunk.loop import Loop
from engine_models.pymunk.model import build
from engine_models.pymunk.native_contact import rigid_twin
from engine_models.pymunk.record import Record, require_the_mechanism
from engine_models.scene.parts import AnyScene
from reference_solver.mechanism.data import ConstantSpeed

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

    iterations: Count = 100
    shorter_in_contact: Annotated[float, Field(ge=1, le=16)] = 1.0
    error_bias: Annotated[float, Field(ge=0, lt=1)] = 0.0
    half_kick_start: bool = True
    contact: Literal["as-scene", "rigid"] = "as-scene"
    collision_bias: Annotated[float, Field(ge=0, le=1)] = 1e-300
    collision_slop_m: Annotated[float, Field(ge=0)] = 0.0
    collision_persistence: Count = 1
    any_mechanism: ClassVar[bool] = True

    def check(self, scene: AnyScene) -> None:
        """Raise UnsupportedScene for a guide, or for a law without a restitution, that Pymunk cannot express.

        So is a scene without the steps asked for.
        """
        twin = self.twin(scene)
        build(twin, np.zeros((len(twin.mechanism.bodies), 3)), all_joints=not self.half_kick_start)

    def twin(self, scene: T) -> T:
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

    def simulate(self, scene: AnyScene, settings: RunSettings) -> Trajectory:
        """Run the scene with steps of one length, or shorter ones in contact.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: a joint came apart by more than a tenth of the longest lever, a pin went through
                the wall of its bearing, the numbers overflowed, or the driver's speed changes within a step.
        """
        require_memory(scene, settings)
        twin = self.twin(scene)
        with np.errstate(all="ignore"):  # overflow ends as a failure with its time, not as a warning
            loop = self._loop(twin, settings)
            record = Record(twin, loop)
            loop.run(record.every_step, record.take)
            run = trajectory_of(record, loop.solve_time_s)
            require_the_mechanism(twin, loop.model.groove_m, run.position, run.position[:1], run.time_s)
            return unwound(scene, require_finite(run))

    def bare_run(self, scene: AnyScene, settings: RunSettings) -> BareRun:
        """Return the same steps, of which works and forces need nothing.

        Raises:
            UnsupportedScene, SimulationFailed: as ``simulate`` does.
        """
        twin = self.twin(scene)
        with np.errstate(all="ignore"):
            loop = self._loop(twin, settings)
            start = loop.positions()
            loop.run()
            end, end_s = loop.positions(), np.array([twin.end_time_s])
            require_the_mechanism(twin, loop.model.groove_m, end[None], start[None], end_s)
            return BareRun(loop.solve_time_s, end, loop.engine_time_s)

    def _loop(self, scene: AnyScene, settings: RunSettings) -> Loop:
        require_followed(scene, settings.step_used_s(scene.end_time_s))
        start, velocity = checked_start(scene)
        model = build(scene, start, all_joints=not self.half_kick_start)
        space = model.space
        space.gravity, space.iterations = scene.mechanism.gravity_m_s2, self.iterations
        space.collision_bias, space.collision_slop = self.collision_bias, self.collision_slop_m
        space.collision_persistence = self.collision_persistence
        for joint in space.constraints:
            joint.error_bias = self.error_bias
        return Loop(scene, settings, model, velocity, self.half_kick_start, self.shorter_in_contact)


def needs_one_step(scene: AnyScene) -> list[str]:
    """Return what of a scene is made for steps of one length: native contacts and changing speeds."""
    joints, law = scene.clearances.items(), scene.mechanism.drive.law
    changes = scene.mechanism.drive.prescribes and not isinstance(law, ConstantSpeed)
    return [
        *(f"clearance.{name}.law = rigid" for name, clearance in joints if clearance.law == "rigid"),
        *([f"drive.kind = {scene.driven_by.kind}"] if changes else []),
    ]
