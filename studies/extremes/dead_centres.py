"""The gallery's dead centres: rods as long as the crank, nearly so, and shorter, and rest."""

import math
from functools import partial

import numpy as np

from engine_models.engine import FloatArray
from engine_models.scene.scene import Scene, Start
from studies.extremes.case import Extreme, Wanted
from studies.extremes.checks import ideal_motion, impossible, resting, slider_by
from studies.extremes.mechanisms import DRIVEN, FREE, FREE_STEP_S, STEP_S
from studies.extremes.scenes import driven, free, rod

RADIUS_M = DRIVEN.crank.length_m


def _folded(scene: Scene, time_s: FloatArray) -> FloatArray:
    """Return the slider's position (n,) of a driven crank with a rod of its length, phi = -theta."""
    theta = scene.start.crank_angle_rad + scene.start.crank_speed_rad_s * time_s
    return np.asarray(2 * scene.crank.length_m * np.cos(theta))


def dead_centres() -> list[Extreme]:
    """Return rods as long as the crank, nearly so, and shorter, and starts at dead centres."""

    case = partial(Extreme, "dead centre", check=impossible, step_s=STEP_S)

    def of_length(
        name: str, part: float, half_width_rad: float, step_s: float, theory: str, wanted: Wanted = "answer"
    ) -> Extreme:
        begin, speed = math.pi / 2 - half_width_rad, DRIVEN.start.crank_speed_rad_s
        end = 2 * half_width_rad / speed
        scene = driven(name, end, angle_rad=begin, rod=rod(DRIVEN, length_m=RADIUS_M * part))
        return case(scene, theory, check=ideal_motion, step_s=step_s, wanted=wanted)

    equal = rod(DRIVEN, length_m=RADIUS_M)
    short = 0.8 * RADIUS_M
    rest = Start(crank_angle_rad=0.0, crank_speed_rad_s=0.0)
    snap = "The rod turns over the vertical and back within {0} of crank angle, at finite force"
    return [
        case(
            driven("L = r through the fold", 0.006, rod=equal),
            "At t = 3 ms two branches cross, B has rank 8 of 9: stop there, or go on along x = 2r cos θ.",
            check=slider_by(_folded),
            wanted="stop",
            stop_s=0.003,
        ),
        case(
            driven("L = r, start in the fold", 0.006, angle_rad=math.pi / 2, rod=equal),
            "Begins where two branches cross: no motion follows from this start.",
            wanted="refusal",
        ),
        of_length("L = 1.001 r", 1.001, 0.5, STEP_S / 4, snap.format("0.09 rad") + "."),
        of_length("L = (1 + 1e-6) r", 1 + 1e-6, 0.05, STEP_S / 100, snap.format("0.003 rad") + "."),
        of_length(
            "L = (1 + 1e-6) r, long step",
            1 + 1e-6,
            0.5,
            STEP_S * 2,
            snap.format("0.003 rad") + ": a step of 0.006 rad does not see it.",
            "answer or word",
        ),
        case(
            driven("L = 0.8 r, driven", 0.012, rod=rod(DRIVEN, length_m=short)),
            "The crank cannot turn: it locks at sin θ = 0.8.",
            wanted="refusal",
        ),
        case(
            free("L = 0.8 r, free", 0.1, rod=rod(FREE, length_m=short)),
            "The rod turns over and over, the crank swings between ±53°: smooth in the rod's angle.",
            check=ideal_motion,
            step_s=FREE_STEP_S,
        ),
        case(
            free("at rest at a dead centre", 0.1, gravity_m_s2=0.0, start=rest),
            "No force acts: nothing ever moves.",
            check=resting,
            step_s=FREE_STEP_S,
        ),
    ]
