"""Baselines: what every configuration's errors, order and steps were when somebody last accepted them.

A number that got better leaves its band too: only a baseline at the best shows when that is lost again.
"""

import math
import os
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from rich.progress import track

from engine_models import arms
from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.scene.library import SCENES
from studies.case import Case, Row, run_case
from studies.failures import BadInput, Failed, log, progress_console, writing
from studies.judges.impact_matching import FORCE_ERROR
from studies.judges.metrics import is_force
from studies.running.workers import Ended, Pool

FOLDER, FILE = Path(__file__).parents[1] / "tests" / "accuracy", "baselines.csv"
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
                yield Case("accuracy", scene, arm, run, dict.fromkeys(arm.tolerances, tolerance / 10**k))


def numbers(case: Case, row: Row) -> Row:
    """Return a run's row of the table from that of ``accuracy``, without numbers if the run failed."""
    engine = make_engine(case.engine, **case.settings)
    setting = f"step {case.run.step_used_s(case.scene.end_time_s):.4g} s"
    if engine.order is None:
        setting = next((f"tolerance {case.settings[name]:g}" for name in case.arm.tolerances), "as it comes")
    names = case.scene.name, case.engine, case.arm.name, setting
    head: Row = dict(zip(RUN, names, strict=True))
    if row["status"] != "ok":
        return head
    others = ("impact_", "largest_", "setting_")
    errors = {name: it for name, it in row.items() if "_error_" in name and not name.startswith(others)}
    position_m, velocity_m_s, *_ = errors.values()
    force_N = max((float(str(it)) for name, it in errors.items() if is_force(name)), default=math.nan)
    energy_J = row["energy_balance_residual_J"]
    measured = position_m, velocity_m_s, force_N, row.get(FORCE_ERROR, math.nan), energy_J, math.nan
    return head | dict(zip(FLOORS, (*measured, row["steps"]), strict=True))


def measure_all(engines: Collection[str] = arms.NAMED) -> pd.DataFrame:
    """Return the table of some engines' runs, with the order at which errors of smooth motion fall."""
    todo = list(cases(engines))
    with Pool(os.cpu_count() or 1) as pool:
        done = track(pool.results(run_case, todo), "baselines", len(todo), console=progress_console())
        rows = dict[str, Row]()
        for case, result in done:
            if isinstance(result, Ended):
                raise Failed(str(result))
            rows[case.key], _ = result
    ran = [(case, rows[case.key]) for case in todo if rows[case.key]["status"] != "unsupported"]
    table = pd.DataFrame([numbers(*each) for each in ran], columns=[*RUN, *FLOORS])
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
        todo = '--accept "..." writes one'
        raise BadInput(f"folder: expected {folder / FILE}, got '{reason}': {todo}") from None


def compare_or_accept(engines: Collection[str], folder: Path, why: str | None) -> list[str]:
    """Return what ``differences`` says of some engines' numbers, or write the table anew with a reason."""
    accepted = pd.DataFrame() if why else read(folder)
    with writing("folder", folder):
        folder.mkdir(parents=True, exist_ok=True)
    measured = measure_all(engines)
    count = measured[[*FLOORS]].count().sum()
    if not why:
        lines = differences(measured, accepted)
        log.info(f"{count - len(lines)} of {count} numbers are within their bands")
        return lines
    text = measured.to_csv(index=False, float_format="%.4g", lineterminator="\n")
    (folder / FILE).write_text(f"# {' '.join(why.split())}\n{text}", encoding="utf-8")
    log.info(f"{count} numbers are accepted")
    return []
