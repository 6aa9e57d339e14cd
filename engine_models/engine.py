"""What every engine takes and gives: run settings, trajectory, the base class and its refusals."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from engine_models.scene.plain_words import shown
from engine_models.scene.scene import Scene

FloatArray = NDArray[np.float64]
#: Validation of an engine's settings, for ``pydantic.dataclasses.dataclass(frozen=True, config=...)``.
STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)
#: The most of one run, on the command line as well.
MOST_SAMPLES = 100_000
#: Times that are so near to an equally spaced one, as a part of the interval, are that one.
ROUNDING = 1e-9


# Exceptions say who failed: the engine itself; this project's model of it, which does not express the scene;
# a check of this project's (``SimulationFailed`` itself); or the scene, before any engine is asked.


class UnsupportedScene(Exception):
    """The engine, or its present settings, cannot express this scene; the message is the reason."""


class ImpossibleScene(UnsupportedScene):
    """No engine is asked: there is no such mechanism."""


class SimulationFailed(Exception):
    """The run broke down; the message says when and why."""


class EngineFailed(SimulationFailed):
    """The engine itself gave up."""


class AdapterCannot(SimulationFailed):
    """The run came to what this project's model of the engine does not express."""


class ImpossibleStart(SimulationFailed):
    """No engine is asked: the mechanism cannot begin as the scene says."""


def require_samples(samples: object) -> None:
    """Raise ValueError for what is no number of samples, or too large a one."""
    whole = isinstance(samples, Integral) and not isinstance(samples, bool)
    if not (whole and samples in range(1, MOST_SAMPLES + 1)):
        expected = f"an integer >= 1 and <= {MOST_SAMPLES}"
        raise ValueError(f"samples: expected {expected}, got {shown(samples)}")


@dataclass(frozen=True)
class RunSettings:
    """What a run is asked for, whatever the engine.

    ``samples`` is the number of equal output intervals, so ``samples + 1`` rows come out, ends included.
    ``step_s`` is the longest step allowed. A fixed step is the longest that fits a whole number of times in
    an output interval, so that every sample lies on a step; engines that choose their steps interpolate.

    ``at_s`` are more times at which a scene with clearance is sampled, within its impacts for example (see
    ``times_s``). They change no step: an engine interpolates. One that leaves them out is judged by the
    samples that it has.
    """

    step_s: float
    samples: int
    at_s: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Refuse, with a ValueError, what is no step, and no number of samples or too large a one."""
        step = self.step_s
        if isinstance(step, bool) or not (isinstance(step, Real) and 0 < step < math.inf):
            raise ValueError(f"step_s: expected a finite number > 0, got {shown(step)}")
        require_samples(self.samples)

    def times_s(self, scene: Scene) -> FloatArray:
        """Return the times of all samples, in order: equally spaced, and with clearance those of ``at_s``."""
        equal = np.linspace(0.0, scene.end_time_s, self.samples + 1)
        if not (self.at_s and scene.clearances):
            return equal
        between = np.array(self.at_s)
        return np.union1d(equal, between[~self.are_equal(between, scene.end_time_s)])

    def are_equal(self, time_s: FloatArray, end_time_s: float) -> NDArray[np.bool_]:
        """Return which times (n,) are equally spaced samples, (n,)."""
        place = time_s * self.samples / end_time_s
        return np.asarray(np.abs(place - np.rint(place)) <= ROUNDING)

    def steps_per_sample(self, end_time_s: float) -> int:
        """Return the number of equal steps between two samples."""
        interval = end_time_s / self.samples
        return max(1, int(np.ceil(interval / self.step_s * (1 - 1e-9))))

    def step_used_s(self, end_time_s: float) -> float:
        """Return the step that is really taken, at most ``step_s``."""
        return end_time_s / (self.samples * self.steps_per_sample(end_time_s))


@dataclass(frozen=True)
class Impacts:
    """The m contacts of a joint with clearance that have ended, from touch to release, in the order of time.

    ``time_s`` (m,) is that of touch, ``duration_s`` (m,) is 0 between rigid walls. ``approach_speed_m_s``
    (m,) is the normal speed at touch, ``normal_impulse_N_s`` (m,) the integral of the normal force and
    ``energy_lost_J`` (m,) what contact and friction dissipated. The largest normal force and penetration, and
    the times of both, (m,) each, are NaN between rigid walls.
    """

    time_s: FloatArray
    duration_s: FloatArray
    approach_speed_m_s: FloatArray
    normal_impulse_N_s: FloatArray
    energy_lost_J: FloatArray
    largest_normal_force_N: FloatArray
    largest_normal_force_time_s: FloatArray
    largest_penetration_m: FloatArray
    largest_penetration_time_s: FloatArray


@dataclass(frozen=True)
class Contact:
    """What a joint with clearance did, at the trajectory's n times.

    ``gap_m`` (n, 2) points from the bearing's centre to the pin's; ``penetration_m`` (n,) is its length less
    the radial clearance, negative in flight. ``normal_force_N`` (n,) pushes the pin towards the bearing's
    centre; ``friction_force_N`` (n,) acts on the pin 90 degrees counter-clockwise of the gap, None without
    friction. ``elastic_energy_J`` (n,) is stored in the contact. The bearing belongs to the body nearer the
    crank pivot.

    Since t = 0, each (n,): ``normal_impulse_N_s`` is the integral of the normal force, the impulses of rigid
    impacts included; ``normal_loss_J`` is dissipated by the normal force, ``friction_loss_J`` by friction
    (None without), and ``clipped_loss_J`` is the elastic energy that went where the law would pull and the
    force is zero (None where it never is).
    """

    gap_m: FloatArray
    penetration_m: FloatArray
    normal_force_N: FloatArray
    friction_force_N: FloatArray | None
    elastic_energy_J: FloatArray
    normal_impulse_N_s: FloatArray
    normal_loss_J: FloatArray
    friction_loss_J: FloatArray | None
    clipped_loss_J: FloatArray | None
    impacts: Impacts

    @property
    def dissipated_energy_J(self) -> FloatArray:
        """Energy dissipated since t = 0 by all of these, (n,)."""
        parts = (self.normal_loss_J, self.friction_loss_J, self.clipped_loss_J)
        return np.asarray(sum(part for part in parts if part is not None))


@dataclass(frozen=True)
class Trajectory:
    """Motion and forces at n times (see ``RunSettings.times_s``), in SI units and the global frame.

    ``position`` and ``velocity`` are (n, bodies, 3): body, in the order of the scene's mechanism (crank, rod,
    slider), by (x, y, phi) of its centre of mass, angles unwrapped. ``joint_force_N`` has (n, 2) of every
    joint by its name: x and y of the force on the body named later, crank, rod and slider at O, A and B.
    ``guide_force_N`` has (n,) of every guide by its name ("guide" of a crank-slider): the force on its body
    to the left of its direction; ``guide_moment_N_m`` (n,) is that on the body, counter-clockwise, of guides
    that keep it from turning, where the engine tells it. ``driver_torque_N_m`` (n,) acts on what is driven,
    a force in N along a driven guide, None without a drive. ``driver_work_J`` (n,) is its work since t = 0
    in the engine's own quadrature, None without a drive. ``solve_time_s`` is the wall time of the native
    solve alone, without building the model or reading results out. ``contacts`` has an entry for every joint
    with clearance. ``load_work_J`` has the work since t = 0 of every part of the loads, (n,): "BODY.force",
    "BODY.viscous" and so on, of a crank-slider's "force", "viscous", "spring", "gas" (see
    ``minimal.forces``).
    ``stabilisation_loss_J`` (n,) is the energy that the stabilisation of constraints has removed since t = 0,
    None where the engine does not tell it or has none.
    """

    time_s: FloatArray
    position: FloatArray
    velocity: FloatArray
    joint_force_N: Mapping[str, FloatArray]
    guide_force_N: Mapping[str, FloatArray]
    driver_torque_N_m: FloatArray | None
    driver_work_J: FloatArray | None
    step_s: float
    steps: int
    solve_time_s: float
    contacts: Mapping[str, Contact] = field(default_factory=dict)
    stabilisation_loss_J: FloatArray | None = None
    load_work_J: Mapping[str, FloatArray] = field(default_factory=dict)
    guide_moment_N_m: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def work_J(self) -> FloatArray:
        """Work done on the bodies since t = 0 by driver and loads together, (n,)."""
        work = np.zeros(len(self.time_s)) if self.driver_work_J is None else self.driver_work_J
        return np.asarray(sum(self.load_work_J.values(), start=work))

    @property
    def dissipated_energy_J(self) -> FloatArray | None:
        """Energy dissipated in the joints with clearance since t = 0, (n,), None without any."""
        if not self.contacts:
            return None
        return np.asarray(sum(contact.dissipated_energy_J for contact in self.contacts.values()))


class BareRun(NamedTuple):
    """A run of which the end alone is kept: its solve's wall time in s, and ``position`` there, (bodies, 3).

    Angles are those of ``wound`` scenes. ``engine_time_s`` is the part of the time that was spent inside the
    engine's own calls, where this project's are beside them in a loop.
    """

    solve_time_s: float
    position: FloatArray
    engine_time_s: float | None = None


class Engine(ABC):
    """The base class of engines: a frozen dataclass of an engine's own settings that can run scenes.

    ``check`` and ``simulate`` are every engine's own. The rest has defaults: those of an engine that solves a
    scene as it is.
    """

    @abstractmethod
    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene, with the reason, if the engine at its settings cannot express the scene."""

    @abstractmethod
    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene; raise UnsupportedScene or SimulationFailed rather than return nonsense."""

    def twin(self, scene: Scene) -> Scene:
        """Return the scene that the engine really solves: the same, or with its own law in the contacts.

        The converged solution of it is the engine's model twin: what differs between the two
        scenes is the form of the model, what differs between engine and twin is numerical error.

        Raises:
            UnsupportedScene: as ``check`` does.
        """
        self.check(scene)
        return scene

    def sharper(self) -> "Engine":
        """Return the engine to take with half the step: its own tolerance, if it has one, a tenth."""
        return self

    @property
    def order(self) -> float | None:
        """The order at which the error of smooth motion falls with the step, None if a tolerance decides.

        ``crankslider conform`` holds the engine to it.
        """
        return None

    @property
    def accuracy_m(self) -> float | None:
        """The error in m that the slider's position has at most in smooth motion, None where none is stated.

        It is that in steps of 0.2 ms, or at the engine's own tolerance. ``crankslider conform`` holds the
        engine to it.
        """
        return None

    @property
    def controls_error(self) -> bool:
        """Whether a tolerance decides, and the step is no more than a limit."""
        return False

    def controlling_error(self, step_tolerance: float | None = None) -> "Engine":  # noqa: ARG002
        """Return the engine by a method that controls its error, to this tolerance, if it has one."""
        return self

    def idle(self) -> Mapping[str, str]:
        """Return the settings other than their defaults that change nothing, with that which says so."""
        return {}

    def bare_run(self, scene: Scene, settings: RunSettings) -> BareRun:
        """Return the end of a run that records as little as the engine lets it.

        Raises:
            UnsupportedScene, SimulationFailed: as ``simulate`` does.
        """
        run = self.simulate(scene, settings)
        return BareRun(run.solve_time_s, run.position[-1])


def require_finite(trajectory: Trajectory) -> Trajectory:
    """Return the trajectory, or raise SimulationFailed naming the first time with a non-finite number."""
    n, of = len(trajectory.time_s), trajectory
    arrays = [of.position, of.velocity, *of.joint_force_N.values(), *of.load_work_J.values()]
    arrays += [a for a in (of.driver_torque_N_m, of.driver_work_J) if a is not None]
    finite = np.all([np.isfinite(a).reshape(n, -1).all(axis=1) for a in arrays], axis=0)
    if not finite.all():
        when = trajectory.time_s[int(np.argmin(finite))]
        raise SimulationFailed(f"non-finite state at t = {when:.6g} s with step {trajectory.step_s:.3g} s")
    return trajectory
