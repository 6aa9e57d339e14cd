"""Planar mechanisms in Pymunk (Chipmunk): joint impulses and position-first semi-implicit Euler.

One ``space.step(dt)`` first moves the positions with the stored velocities, then kicks the velocities by the
loads and by the impulses of joints and contacts, all at the new positions. The impulses also take the joints'
position errors back. So after step k the positions x_k are those of t_k = k dt, and the kick was made at x_k.
"""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from engine_models.engine import STRICT, BareRun, Engine, RunSettings, Trajectory, UnsupportedScene
from engine_models.mechanics.forces import require_family
from engine_models.mechanics.start import checked_start, unwound
from engine_models.pymunk import kicks
from engine_models.pymunk.loop import Loop
from engine_models.pymunk.model import build, changes_speed, sweeps_of
from engine_models.pymunk.native_contact import rigid_twin
from engine_models.pymunk.record import Record
from engine_models.scene.scene import Scene
from engine_models.watch import require_followed, require_memory

#: What fits into a C int.
Count = Annotated[int, Field(gt=0, lt=2**31)]


@dataclass(frozen=True, config=STRICT)
class PymunkEngine(Engine):
    """Settings of the Pymunk model; the defaults are its best practice.

    ``iterations`` is the number of Gauss-Seidel sweeps over joints and contacts in a step; without one there
    are a hundred, or more after a sample where joints converge slowly (``model.sweeps_of``), as they do near
    a dead centre. What they leave of an open
    joint has to stay below a half where ``error_bias``, the fraction of a joint's position error that is left
    after a second, is 0: all of it is taken back in every step then. A crank-slider has nothing to gain from
    more than ten, Andrews' squeezer needs 45 and a quick return 70. Between rigid walls impulses have to get
    through the joints within one step, or a bounce is lost: ten lose up to 80 % of one at any step, 100 are
    within 1e-3 of 400.

    With ``half_kick_start`` velocities begin half a step ahead. The scheme is then the leap-frog, of order 2:
    the velocity stored after step k is that of t_k + dt/2. Reported at t_k are the places x_k, the mean of
    the velocities before and after kick k, and the forces that follow from their change. Joints learn how
    their paths curve from the gap that a step opens, so that kick 1 adds the half impulse that the start has
    not; forces at steps 1 and 2 are therefore those of the state there. Without it all is as a user reads it
    after step k, of order 1, and every ideal pin and guide has a joint. Forces at t = 0 are the start's.

    Loads and springs are set before every step, as Pymunk's manual has it, and so is a motion that is
    prescribed with a changing speed. They are those of the places in the kick. What dampers feel is foreseen
    from the last two kicks, while no pin touches, which keeps order 2 and takes steps below m/c.

    With ``contact`` = "as-scene" a compliant law is applied as a force in every kick and a rigid one is
    Pymunk's native contact (``native_contact``); "rigid" makes the compliant ones native too, with the
    restitution they name (see ``twin``). Rigid walls are of order 1, since a contact is noticed in the first
    step that is past the wall, and so are laws with damping or friction, which know the speeds of half a step
    before; Hertz's alone is of order 2. Forces are means over a step: a rigid impact's peak grows as 1/dt and
    means nothing, its impulse does. At the kick that strikes a rigid wall velocity, losses and work are those
    before.

    With ``shorter_in_contact`` steps are that many times shorter in contact, and from two long steps before a
    touch on. A kick's loads last from the middle of the step before it to the middle of the one after, so
    that the order stays what it is. It pays where flights are long and contacts brief; forces within two
    steps of a change are not those of their time.

    The rest is for native contacts. ``collision_bias`` is the fraction of a penetration left after a second,
    ``collision_slop_m`` the penetration left alone, ``collision_persistence`` the number of steps that a
    contact is remembered. At a bias of 0 a pin that follows its wall leaves it at every other step, with 4
    times the error and 12 times the energy residual of 1e-300 (set R, 0.1 mm, e = 0.5, dt = 1.2e-7 s).
    """

    iterations: Count | None = None
    shorter_in_contact: Annotated[float, Field(ge=1, le=16)] = 1.0
    error_bias: Annotated[float, Field(ge=0, lt=1)] = 0.0
    half_kick_start: bool = True
    contact: Literal["as-scene", "rigid"] = "as-scene"
    collision_bias: Annotated[float, Field(ge=0, le=1)] = 1e-300
    collision_slop_m: Annotated[float, Field(ge=0)] = 0.0
    collision_persistence: Count = 1

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene for a guide, or for a law without a restitution, that Pymunk cannot express.

        So is a scene without the steps asked for.
        """
        twin = self.twin(scene)
        build(twin, np.zeros((len(twin.mechanism.bodies), 3)), all_joints=not self.half_kick_start)

    def twin(self, scene: Scene) -> Scene:
        """Return the scene itself, or with ``contact`` = "rigid" the same one with rigid laws throughout.

        Raises:
            UnsupportedScene: see ``check``.
        """
        require_family(scene, "pymunk")
        twin = rigid_twin(scene) if self.contact == "rigid" else scene
        rooms = twin.clearances.items()
        fixing = [f"clearance.{name}.law = rigid" for name, room in rooms if room.law == "rigid"]
        fixing += [f"drive.kind = {twin.drive.kind}"] if changes_speed(twin.mechanism) else []
        fixing += [] if self.half_kick_start else ["half_kick_start = False"]
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
            SimulationFailed: a pin went through the wall of its bearing, the numbers overflowed, or the
                driver's speed changes within a step.
        """
        require_memory(scene, settings)
        twin = self.twin(scene)
        with np.errstate(all="ignore"):  # overflow ends as a failure with its time, not as a warning
            loop = self._loop(twin, settings)
            record = Record(twin, loop)
            loop.run(record.every_step, record.take)
            return unwound(scene, record.trajectory(loop.solve_time_s))

    def bare_run(self, scene: Scene, settings: RunSettings) -> BareRun:
        """Return the same steps, of which works and forces need nothing."""
        twin = self.twin(scene)
        with np.errstate(all="ignore"):
            loop = self._loop(twin, settings)
            loop.run()
            loop.account(kicks.KNOWN)
            return BareRun(loop.solve_time_s, loop.q.reshape(-1, 3), loop.engine_time_s)

    def _loop(self, scene: Scene, settings: RunSettings) -> Loop:
        require_followed(scene, settings.step_used_s(scene.end_time_s))
        start, velocity = checked_start(scene)
        model = build(scene, start, all_joints=not self.half_kick_start)
        space = model.space
        space.gravity = scene.mechanism.gravity_m_s2
        space.iterations = self.iterations or sweeps_of(model.forces, start)
        space.collision_bias, space.collision_slop = self.collision_bias, self.collision_slop_m
        space.collision_persistence = self.collision_persistence
        for joint in space.constraints:
            joint.error_bias = self.error_bias
        varies = self.iterations is None
        return Loop(scene, settings, model, velocity, self.half_kick_start, self.shorter_in_contact, varies)
