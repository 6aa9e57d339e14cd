"""The catalogue of arms: engines at the settings that studies compare, each with one name and one meaning."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from engine_models import engines

Setting = str | int | float | bool


@dataclass(frozen=True)
class Arm:
    """An engine at named settings, as it takes part in studies.

    ``settings`` are what makes the arm; the rest has the engine's defaults. Where it has ``tolerances``, the
    names of settings, its method chooses its steps, and the run's step is only the longest. What a study adds
    resolves more or less and changes no meaning: the step, the tolerances, ``steps_per_contact``, and
    what Pymunk's sweeps leave.
    """

    engine: str
    name: str
    settings: Mapping[str, Setting] = field(default_factory=dict, hash=False)
    tolerances: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """What tables and figures call it: reference (projection)."""
        return f"{self.engine} ({self.name})"


#: The name of an engine as it comes, with nothing set.
AS_IT_COMES = "default"

#: The reference as it comes; with its constraints kept in three ways; with contacts' events located, also
#: with nothing else done, or not; the paper's, one step for all and nothing corrected; and by error control.
REFERENCE = Arm("reference", AS_IT_COMES)
PROJECTION = Arm("reference", "projection", {"stabilisation": "projection"})
BAUMGARTE = Arm("reference", "Baumgarte", {"stabilisation": "baumgarte"})
NO_STABILISATION = Arm("reference", "none", {"stabilisation": "none"})
LOCATED = Arm("reference", "located", {"locate_events": True})
LOCATED_ALONE = Arm("reference", "located, none", {"locate_events": True, "stabilisation": "none"})
PLAIN = Arm("reference", "plain", {"locate_events": False})
PLAIN_RK4 = Arm("reference", "plain RK4", {"locate_events": False, "stabilisation": "none"})
REFERENCE_DOP853 = Arm("reference", "DOP853", {"method": "dop853"}, ("step_tolerance",))

#: Exudyn as it comes, and its solvers by name.
EXUDYN = Arm("exudyn", AS_IT_COMES)
TRAPEZOIDAL = Arm("exudyn", "trapezoidal", {"solver": "TrapezoidalIndex2"})
GENERALIZED_ALPHA = Arm("exudyn", "generalized-alpha", {"solver": "GeneralizedAlpha", "spectral_radius": 0.5})
GENERALIZED_ALPHA_09 = Arm(
    "exudyn", "generalized-alpha 0.9", {"solver": "GeneralizedAlpha", "spectral_radius": 0.9}
)
RK44 = Arm("exudyn", "RK44", {"solver": "RK44"})
DOPRI5 = Arm("exudyn", "DOPRI5", {"solver": "DOPRI5"}, ("step_tolerance",))

#: Pymunk at its best, and with all that a user who sets nothing has; its contacts as the scene's law has
#: them, in steps of one length and in steps shorter there, and as Pymunk has them.
TUNED = Arm("pymunk", "tuned")
OUT_OF_THE_BOX = Arm(
    "pymunk",
    "out of the box",
    {
        "iterations": 10,
        "error_bias": (1 - 0.1) ** 60,
        "half_kick_start": False,
        "collision_bias": (1 - 0.1) ** 60,
        "collision_slop_m": 0.1,
        "collision_persistence": 3,
    },
)
AS_THE_SCENE = Arm("pymunk", "as the scene", {"contact": "as-scene"})
SHORTER_IN_CONTACT = Arm("pymunk", "shorter in contact", {"contact": "as-scene", "shorter_in_contact": 16.0})
NATIVE_CONTACT = Arm("pymunk", "native contact", {"contact": "rigid"})

#: SciPy as it comes, and its methods.
SCIPY = Arm("scipy", AS_IT_COMES)
SCIPY_DOP853 = Arm("scipy", "solve_ivp, DOP853", {"method": "DOP853"}, ("rtol", "atol"))
LSODA = Arm("scipy", "solve_ivp, LSODA", {"method": "LSODA"}, ("rtol", "atol"))
RADAU = Arm("scipy", "solve_ivp, Radau", {"method": "Radau"}, ("rtol", "atol"))
#: Engines, and arms, whose solve gives the motion alone: forces are computed after the run, at the samples
#: that are asked for, and are in no run time. Exudyn's explicit solvers have no joints to tell forces of.
MOTION_ALONE = ("scipy", DOPRI5, RK44)

#: What each arm is, by its label.
MEANINGS = {
    REFERENCE.label: "the paper's RK4 with projection and located contact events, as it comes",
    PROJECTION.label: "the paper's RK4; positions and velocities return to the constraints after every step",
    BAUMGARTE.label: "the paper's RK4 with Baumgarte's terms in the equations of the constraints",
    NO_STABILISATION.label: "the paper's RK4, constraints left to drift",
    LOCATED.label: "RK4 with touch and release located and shorter steps in contact",
    LOCATED_ALONE.label: "the same, constraints left to drift",
    PLAIN.label: "RK4 with all steps of one length through contacts, and projection",
    PLAIN_RK4.label: "the paper's RK4 and nothing else: steps of one length, constraints left to drift",
    REFERENCE_DOP853.label: "the paper's equations by DOP853, order 8, with error control and located events",
    EXUDYN.label: "Exudyn's solver for the scene, as it comes",
    TRAPEZOIDAL.label: "implicit trapezoidal rule, index 2",
    GENERALIZED_ALPHA.label: "implicit generalized-alpha method, spectral radius 0.5",
    GENERALIZED_ALPHA_09.label: "implicit generalized-alpha method, spectral radius 0.9: less damping",
    RK44.label: "explicit RK4 on a kinematic tree, steps of one length",
    DOPRI5.label: "explicit DOPRI5 on a kinematic tree, with error control",
    TUNED.label: "joint errors corrected in full in every step, order 2",
    OUT_OF_THE_BOX.label: "Pymunk's own defaults, order 1",
    AS_THE_SCENE.label: "tuned joints, contact forces by the scene's law, steps of one length",
    SHORTER_IN_CONTACT.label: "tuned joints, contact forces by the scene's law, shorter steps in contact",
    NATIVE_CONTACT.label: "tuned joints, Pymunk's own rigid contact with the scene's restitution",
    SCIPY.label: "solve_ivp as it comes here: DOP853, with its events for contacts",
    SCIPY_DOP853.label: "solve_ivp with DOP853, order 8, and with its events for contacts",
    LSODA.label: "solve_ivp with LSODA, of variable order",
    RADAU.label: "solve_ivp with Radau, implicit, order 5",
}

#: Engines that the catalogue knows. Any other takes part in all studies as it comes.
NAMED = ("reference", "exudyn", "pymunk", "scipy")


def gives_motion_alone(arm: Arm) -> bool:
    """Return whether an arm's solve leaves the forces for later (see ``MOTION_ALONE``)."""
    return arm.engine in MOTION_ALONE or arm in MOTION_ALONE


def newcomers() -> tuple[Arm, ...]:
    """Return the arms of the engines that the catalogue does not know."""
    return tuple(Arm(name, AS_IT_COMES) for name in engines.ENGINES if name not in NAMED)
