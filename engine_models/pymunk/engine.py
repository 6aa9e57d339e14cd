"""The crank-slider in Pymunk (Chipmunk): joint impulses and position-first semi-implicit Euler.

One ``space.step(dt)`` first moves the positions with the stored velocities, then kicks the velocities by the
loads and by the impulses of joints and contacts, all at the new positions. The impulses also take the joints'
position errors back. So after step k the positions x_k are those of t_k = k dt, and the kick was made at x_k.
"""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from engine_models.engine import SETTINGS_CONFIG, RunSettings, T, Trajectory, UnsupportedScene, plain
from engine_models.mechanics.crank_motion import require_followed
from engine_models.mechanics.start_check import unwound
from engine_models.memory import require_memory
from engine_models.pymunk.loads import add_loads, needs_one_step
from engine_models.pymunk.model import build, pins
from engine_models.pymunk.rigid_twin import rigid_twin
from engine_models.pymunk.run import pymunk_run
from engine_models.pymunk.stepping import Model
from engine_models.pymunk.sweeps import needed_sweeps
from engine_models.pymunk.workspace import Workspace
from engine_models.reference.kernels import compile_time_s
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene

#: Pymunk's own defaults: joints and contacts lose a tenth of their position error every sixtieth of a second.
LIBRARY_ITERATIONS, LIBRARY_ERROR_BIAS = 10, (1.0 - 0.1) ** 60.0
LIBRARY_SLOP_M, LIBRARY_PERSISTENCE = 0.1, 3
#: What fits into a C int.
Count = Annotated[int, Field(gt=0, lt=2**31)]


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class PymunkEngine:
    """Settings of the Pymunk model; the defaults are its best practice, ``out_of_the_box`` is Pymunk's own.

    ``iterations`` is the number of Gauss-Seidel sweeps over the joints in a step; without one, a scene gets
    as many as leave at most ``sweeps_leave`` of an open joint (see ``sweeps``, which has its default).
    ``error_bias`` is the fraction of a joint's position error
    left after a second: 0 takes all of it back in every step, which needs enough sweeps to be stable (the
    library's scenes six, one with a slider 100 times as heavy over fifty).

    With ``half_kick_start`` the run begins with a kick over dt/2 that moves nothing. The scheme is then the
    leap-frog, of order 2: the velocity stored after step k is that of t_k + dt/2. Reported at t_k are x_k,
    the mean of the velocities before and after kick k, and the forces that made kick k. The first two kicks
    are an exception. The joints learn how their paths curve from the gap that a step opens; kick 0 sees
    none, so it lacks the centripetal half impulse, which kick 1 adds to its own. Their sum is right, and so
    is the motion, but neither is the force of its time: the accelerations at steps 0 and 1 are the parabola
    through those of steps 2 to 4, and forces (and the velocity at step 1) follow from them.

    Without it all is as a user reads it after step k, of order 1: x_k, the stored velocity, the forces that
    made kick k, all taken as those of t_k. There is no kick at t = 0, so step 1's acceleration stands there.
    Step 1 has no earlier impulses to start its sweeps from: forces at t = 0 and for some steps more are off
    by what ten sweeps leave, however short the step, and with ``error_bias`` 0 also by kick 1's extra half.

    Drives and loads. A prescribed speed that changes, a constant torque or force and the gas's force are set
    before every step, as Pymunk's manual has it (``step_inputs``); spring, viscous friction and motor are its
    own springs and dampers (``loads``). With ``half_kick_start`` these damp the mean of the velocities before
    and after a kick, for the sake of order 2, which takes a step below 2 m/c; without it, the one after. A
    table's acceleration has kinks at its entries: in the two steps after one forces are of order 1, and with
    few sweeps in some more.

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
    time. It is for compliant contacts, half a kick at the start, and drives and loads that know no step.

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

    iterations: Count | None = None
    sweeps_leave: Annotated[float, Field(gt=0, lt=0.45)] | None = None
    shorter_in_contact: Annotated[float, Field(ge=1, le=16)] = 1.0
    error_bias: Annotated[float, Field(ge=0, lt=1)] = 0.0
    half_kick_start: bool = True
    contact: Literal["as-scene", "rigid"] = "as-scene"
    contact_iterations: Count = 200
    collision_bias: Annotated[float, Field(ge=0, le=1)] = 1e-300
    collision_slop_m: Annotated[float, Field(ge=0)] = 0.0
    collision_persistence: Count = 1

    @classmethod
    def out_of_the_box(cls) -> "PymunkEngine":
        """Return the engine as it is for a user who sets nothing."""
        return cls(
            iterations=LIBRARY_ITERATIONS,
            error_bias=LIBRARY_ERROR_BIAS,
            half_kick_start=False,
            contact_iterations=LIBRARY_ITERATIONS,
            collision_bias=LIBRARY_ERROR_BIAS,
            collision_slop_m=LIBRARY_SLOP_M,
            collision_persistence=LIBRARY_PERSISTENCE,
        )

    def check(self, scene: AnyScene) -> None:
        """Raise UnsupportedScene for a law without a restitution, or a scene without the steps, asked for."""
        self.twin(scene)

    def twin(self, scene: T) -> T:
        """Return the scene itself, or with ``contact`` = "rigid" the same one with rigid laws throughout.

        Raises:
            UnsupportedScene: see ``check``.
        """
        twin = rigid_twin(scene) if self.contact == "rigid" else scene
        fixing = [
            *needs_one_step(plain(twin, "pymunk")),
            *([] if self.half_kick_start else ["half_kick_start = False"]),
        ]
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

    def sharper(self) -> "PymunkEngine":
        """Return the engine itself: the step alone decides."""
        return self

    def compile_time_s(self, scene: AnyScene, settings: RunSettings) -> float:
        """Return what compiling the loop takes where there is none yet, in s."""
        return compile_time_s(self, scene, settings)

    def simulate(self, scene: AnyScene, settings: RunSettings) -> Trajectory:
        """Run the scene with steps of one length, or shorter ones in contact.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: a joint came apart by more than a tenth of the crank, a pin went through the
                wall of its bearing, the rod turned over, the numbers overflowed, or the driver's speed
                changes within a step.
        """
        scene = plain(scene, "pymunk")
        require_memory(scene, settings)
        require_followed(scene, settings.step_used_s(scene.end_time_s))
        model = self._model(self.twin(scene), settings.step_used_s(scene.end_time_s))
        with np.errstate(all="ignore"):  # overflow ends as a failure with its time, not as a warning
            return unwound(scene, pymunk_run(model, settings, self.half_kick_start, self.shorter_in_contact))

    def _model(self, scene: Scene, step_s: float) -> Model:
        sweeps = self.iterations or needed_sweeps(scene, self.sweeps_leave)
        space, bodies = build(scene, sweeps, self.error_bias)
        add_loads(scene, space, bodies, step_s if self.half_kick_start else None)
        space.collision_bias, space.collision_slop = self.collision_bias, self.collision_slop_m
        space.collision_persistence = self.collision_persistence
        workspace = Workspace(space, bodies, pins(scene, space, bodies), self.contact_iterations)
        return Model(scene, space, bodies, workspace)
