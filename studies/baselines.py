"""Baselines: what every configuration's errors, order and steps were when somebody last accepted them.

A number that got better leaves its band as one that got worse does: either may be a bug, and only a baseline
at what is now the best shows when it is lost again.
"""

import math
import os
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from rich.progress import track

from engine_models import arms
from engine_models.engine import RunSettings, SimulationFailed, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.library import SCENES
from studies.case import Case
from studies.failures import BadInput, Failed, log, progress_console, writing
from studies.judges.comparison import Judged, compared, judged
from studies.judges.impact_matching import FORCE_ERROR, impact_errors
from studies.judges.metrics import energy_balance_residual_J, is_force, sizes
from studies.whole_file import write_whole
from studies.workers import Ended, Pool

FOLDER, FILE = Path(__file__).parent, "baselines.csv"
RUN = ["scene", "engine", "configuration", "setting"]
#: The numbers, and up to what size each is round-off.
FLOORS = {
    "position_error_m": 1e-12,
    "velocity_error_m_s": 1e-9,
    "force_error_N": 1e-5,
    "peak_force_error_N": 2e-2,
    "energy_error_J": 1e-9,
    "order": 0.0,
    "steps": 0.0,
}
#: By what factor a number may differ from its baseline, to either side: errors of smooth motion; past impacts
#: in equal steps, and at a tolerance; and of an engine as it comes. Processors move these by up to 1.2, 1.5,
#: 4 and 2, others hardly.
FACTORS = {"smooth": 1.25, "step": 2.0, "tolerance": 8.0, "as": 3.0, "order": 1.02, "steps": 1.1}
#: Of each scene the end in s, with clearance long before the horizon; the first step in s and the first
#: tolerance; and how many settings there are.
RUNS = {
    "ideal-free": (0.24, 5e-4, 1e-6, 2),
    "ideal-driven": (0.024, 1e-4, 1e-6, 1),
    "ideal-compressor": (0.08, 1e-4, 1e-6, 1),
    "clearance-free-0.5mm": (0.02, 1e-5, 1e-8, 2),
    "clearance-driven-damped": (0.009, 2e-6, 1e-8, 1),
    "rigid-free-0.5mm": (0.07, 2e-5, 1e-8, 1),
}
#: Who ends a step on every touch takes steps so many times as long.
LOCATING, SAMPLES = 20, 120
IDEAL = (
    *(arms.REFERENCE, arms.BAUMGARTE, arms.NO_STABILISATION, arms.REFERENCE_DOP853),
    *(arms.EXUDYN, arms.GENERALIZED_ALPHA, arms.GENERALIZED_ALPHA_09, arms.TUNED, arms.OUT_OF_THE_BOX),
    *(arms.SCIPY, arms.SCIPY_DOP853, arms.LSODA, arms.RADAU),
)
LOOSE = (
    *(arms.LOCATED, arms.LOCATED_ALONE, arms.PLAIN, arms.PLAIN_RK4, arms.REFERENCE_DOP853),
    *(arms.TRAPEZOIDAL, arms.GENERALIZED_ALPHA, arms.RK44, arms.DOPRI5),
    *(arms.AS_THE_SCENE, arms.SHORTER_IN_CONTACT, arms.NATIVE_CONTACT, arms.SCIPY_DOP853, arms.LSODA),
)


def cases(engines: Collection[str] = arms.NAMED) -> Iterator[Case]:
    """Yield the runs of some engines; one that the catalogue does not know is run as it comes.

    A setting is half the step of the one before, or a tenth of its tolerance.
    """
    for name, (end_s, step_s, tolerance, settings) in RUNS.items():
        scene = SCENES[name]().replace("end_time_s", end_s)
        loose = bool(scene.clearances)
        for arm in (*(LOOSE if loose else IDEAL), *arms.newcomers()):
            by_step = make_engine(arm.engine, **arm.settings).order is not None
            longest_s = step_s * (LOCATING if arm.settings.get("locate_events") else 1)
            longest_s = longest_s if by_step else end_s / (40 if loose else 10)
            for k in range(settings if by_step or arm.tolerances else 1) if arm.engine in engines else ():
                run = RunSettings(longest_s / 2**k if by_step else longest_s, SAMPLES)
                yield Case("baselines", scene, arm, run, dict.fromkeys(arm.tolerances, tolerance / 10**k))


def measure(case: Case) -> dict[str, str | float] | None:
    """Return the row of a run, without numbers if the run fails; None if the engine refuses the scene."""
    engine = make_engine(case.engine, **case.settings)
    setting = f"step {case.run.step_used_s(case.scene.end_time_s):.4g} s"
    if engine.order is None:
        setting = next((f"tolerance {case.settings[name]:g}" for name in case.arm.tolerances), "as it comes")
    names = case.scene.name, case.engine, case.arm.name, setting
    row: dict[str, str | float] = dict(zip(RUN, names, strict=True))
    try:
        result = judged(engine, case.scene, case.run)
    except (UnsupportedScene, SimulationFailed) as reason:
        return None if isinstance(reason, UnsupportedScene) else row
    errors = {name: float(str(value)) for name, value in compared(result)[0].items() if "_error_" in name}
    row["position_error_m"], row["velocity_error_m_s"], *_ = errors.values()
    row["force_error_N"] = max((value for name, value in errors.items() if is_force(name)), default=math.nan)
    row["peak_force_error_N"] = _peak_error_N(result)
    row["energy_error_J"] = float(np.abs(energy_balance_residual_J(case.scene, result.plain)).max())
    return row | {"steps": result.plain.steps}


def _peak_error_N(result: Judged) -> float:
    """Return the largest error of the peak force of an impact, of ideal joints of that of a joint."""
    run, truth = result.run, result.solved.truth
    if not run.contacts:
        both = zip(sizes(result.own, run).items(), sizes(result.own, truth).values(), strict=True)
        return max(abs(float(size.max() - true.max())) for (name, size), true in both if is_force(name))
    pairs = [(contact.impacts, truth.contacts[joint].impacts) for joint, contact in run.contacts.items()]
    return max(impact_errors(*pair, result.compared_until_s).get(FORCE_ERROR, math.nan) for pair in pairs)


def measure_all(engines: Collection[str] = arms.NAMED) -> pd.DataFrame:
    """Return the table of some engines' runs, with the order at which errors of smooth motion fall."""
    todo = list(cases(engines))
    with Pool(os.cpu_count() or 1) as pool:
        done = track(pool.results(measure, todo), "baselines", len(todo), console=progress_console())
        rows = {case.key: row for case, row in done}
    if broken := [row for row in rows.values() if isinstance(row, Ended)]:
        raise Failed(str(broken[0]))
    table = pd.DataFrame([row for case in todo if (row := rows[case.key])], columns=[*RUN, *FLOORS])
    smooth = table[table["scene"].str.startswith("ideal") & table["setting"].str.startswith("step")]
    for _, series in smooth.groupby(RUN[:3]):
        coarse, fine = series.index[0], series.index[-1]
        falls = np.log(series["position_error_m"][coarse] / series["position_error_m"][fine])
        if coarse != fine and series["position_error_m"][fine] > 100 * FLOORS["position_error_m"]:
            table.loc[fine, "order"] = falls / np.log(series["steps"][fine] / series["steps"][coarse])
    return table


def differences(measured: pd.DataFrame, accepted: pd.DataFrame) -> list[str]:
    """Return a line for each number that left its band, has no baseline, or is gone."""
    old, new = (table.set_index(RUN)[[*FLOORS]] for table in (accepted, measured))
    lines = []
    for run in old.index.union(new.index, sort=False):
        scene, engine, configuration, setting = run
        smooth = scene.startswith("ideal") and setting != "as it comes"
        for number, floor in FLOORS.items():
            was, value = (float(table[number].get(run, math.nan)) for table in (old, new))
            factor = FACTORS.get(number, FACTORS["smooth" if smooth else setting.partition(" ")[0]])
            low, high = (was / factor if was > factor * floor else 0.0), max(was, floor) * factor
            if not (low <= value <= high or (math.isnan(was) and math.isnan(value))):
                where = f"{engine} ({configuration}) on {scene}, {setting}"
                band = f"baseline {was:.4g}, band {low:.4g} to {high:.4g}"
                lines.append(f"{number} of {where}: got {value:.4g} ({band})")
    return lines


def read(folder: Path) -> pd.DataFrame:
    """Return a folder's table; raise BadInput if there is none."""
    try:
        return pd.read_csv(folder / FILE, comment="#")[[*RUN, *FLOORS]]
    except (OSError, ValueError, KeyError) as reason:
        todo = '--accept --why "..." writes one'
        raise BadInput(f"baselines: expected {folder / FILE}, got '{reason}': {todo}") from None


def require_baselines(folder: Path, accept: bool, why: str | None) -> None:
    """Refuse, before any work, acceptance without a reason, and a folder that cannot be read or written."""
    if accept != bool(why and why.strip()):
        got = "none" if accept else "one without accept"
        raise BadInput(f"why: expected a reason with accept, got {got}")
    if accept:
        with writing("baselines", folder):
            folder.mkdir(parents=True, exist_ok=True)
    else:
        read(folder)


def compare_or_accept(engines: Collection[str], folder: Path, why: str | None) -> list[str]:
    """Return what ``differences`` says of some engines' numbers, or write the table anew with a reason."""
    measured = measure_all(engines)
    count = measured[[*FLOORS]].count().sum()
    if not why:
        lines = differences(measured, read(folder))
        log.info(f"{count - len(lines)} of {count} numbers are within their bands")
        return lines
    text = measured.to_csv(index=False, float_format="%.4g", lineterminator="\n")
    with writing("baselines", folder):
        write_whole(folder / FILE, f"# {' '.join(why.split())}\n{text}".encode())
    log.info(f"{count} numbers are accepted")
    return []
