"""Predictability: how long a scene can be followed, how fast motions part, and what holds past that.

Parts are told apart by the column ``part``. ``HORIZON``: until when the reference agrees with its own
perturbed and step-halved runs. ``EXPONENT``: the finite-time Lyapunov exponent, a case for each of several
starts. Those of ``diagrams``: what the mechanism does over its clearance and its speed, that of ``chains``:
as its speed goes up and down, and that of ``basins``: by its start. All others are ensembles: a case is a
member, and starts differ by a little of the crank angle.
"""

import math
from statistics import median

from engine_models.engines import make_engine
from studies.judges import horizon, lyapunov
from studies.judges.kinds import turns_steadily
from studies.predictability import basins, chains, diagrams, ensemble
from studies.predictability import cases as parts
from studies.predictability.scenes import period_s
from studies.running.case import Case, Curves, Row

cases = parts.cases

#: Tolerances on the slider's position by the words in the names of columns.
TOLERANCES_M = {"1nm": 1e-9, "1um": 1e-6, "100um": 1e-4}


def measure(case: Case) -> tuple[Row, Curves]:
    """Run one case and return its part's columns and curves."""
    part = case.columns["part"]
    if part == parts.HORIZON:
        return _horizon(case)
    if part == parts.EXPONENT:
        return _exponent(case)
    if part in diagrams.FIELDS:
        return diagrams.measure(case)
    if part == chains.PART:
        return chains.measure(case)
    if part == basins.PART:
        return basins.measure(case)
    return ensemble.measure(case)


def _horizon(case: Case) -> tuple[Row, Curves]:
    """Return the horizon of each tolerance: median, least and largest over the perturbations.

    The least and the largest of n values bound the median with a confidence of 1 - 2^(1-n). A horizon that
    lies past the end is absent, as is a bound that does. The halved step's is one number.
    """
    parted = horizon.apart(case.scene, case.run.samples, step_s=case.run.step_s)
    row: Row = {
        "perturbations": len(parted.perturbed_m),
        "perturbation_rad": horizon.PERTURBATION_RAD,
        "largest_distance_perturbed_m": float(parted.perturbed_m.max()),
        "largest_distance_halved_m": float(parted.halved_m.max()),
    }
    if turns_steadily(case.scene):
        row["revolutions"] = case.scene.end_time_s / period_s(case.plain_scene)
    for words, tolerance in TOLERANCES_M.items():
        times = [horizon.first_beyond_s(parted.time_s, one, tolerance) for one in parted.perturbed_m]
        halved = horizon.first_beyond_s(parted.time_s, parted.halved_m, tolerance)
        horizons = {
            f"horizon_{words}_s": median(times),
            f"horizon_{words}_least_s": min(times),
            f"horizon_{words}_largest_s": max(times),
            f"horizon_halved_{words}_s": halved,
        }
        row |= {name: value for name, value in horizons.items() if math.isfinite(value)}
    sizes = {f"perturbed_{k}_m": one for k, one in enumerate(parted.perturbed_m)}
    return row, {"time_s": parted.time_s, **sizes, "halved_m": parted.halved_m}


def _exponent(case: Case) -> tuple[Row, Curves]:
    """Return the exponent of a motion that goes on, from a quarter and a half of the run as well.

    A motion that settles to continuous contact has none, nor has a part that was not followed to its end; of
    the whole, half is enough.
    """
    period, (skipped, used) = period_s(case.plain_scene), parts.EXPONENT_REVOLUTIONS
    engine = make_engine(case.engine, **case.settings)
    growth = lyapunov.growth(engine, case.scene, case.run.step_s, period, case.run.samples)
    followed = float(growth.time_s[-1])
    row: Row = {"revolutions": followed / period, "settled": growth.settled}
    for words, part in parts.EXPONENT_PARTS.items():
        begin, end = skipped * period, (skipped + part * used) * period
        needed = min(end, (skipped + parts.EXPONENT_PARTS["_half"] * used) * period)
        # What is left at the end and shorter than a stretch is not run.
        if not growth.settled and followed > needed - period:
            row[f"lyapunov_exponent_per_revolution{words}"] = growth.exponent_per_s(begin, end) * period
    return row, {"time_s": growth.time_s, "log_growth": growth.log_growth}
