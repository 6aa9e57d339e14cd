"""Writes the frozen reference solutions: ``python -m tests.truth.freeze``.

They are what the independent solver of ``studies.truth`` had of every scene of the library, up to the scene's
predictability horizon, before anything was replaced. A number's stated uncertainty is ``COVERAGE`` times the
largest distance of repeats by two methods, begun some places beside, and round-off.
"""

import io
import json
import lzma
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from engine_models.engine import FloatArray, RunSettings, Trajectory
from engine_models.mechanics.energy import kinetic_energy_J, potential_energy_J
from engine_models.mechanics.samples import selected
from engine_models.scene.library.mechanisms import ALL_SCENES
from engine_models.scene.parts import AnyScene
from studies.judges.converged_truth import (
    COLLOCATION,
    EXTRAPOLATION,
    GRID,
    PLACES,
    converged,
    followed,
    truth_by,
)
from studies.judges.horizon import a_place_off
from studies.judges.metrics import COVERAGE, ROUND_OFF
from studies.settings import END_S
from tests.engines.runs import impact_numbers, numbers

#: The folders that decide: the commit is the last that changed one of them.
CODE = ("engine_models", "reference_solver", "studies")
FILE = Path(__file__).with_name("frozen.npz.xz")
#: Impacts of less than this part of the largest impulse of their joint are the last of a bounce's many.
WEAK = 1e-3


def scene_of(name: str) -> AnyScene:
    """Return a scene of the library with the end that the studies have."""
    scene = ALL_SCENES[name]()
    return scene.replace("end_time_s", END_S.get(name, scene.end_time_s))


def told(scene: AnyScene, run: Trajectory, count: int) -> dict[str, FloatArray]:
    """Return what is frozen of a run: its numbers at the first samples, energies, impacts that ended then."""
    cut, end_s = selected(run, slice(count)), run.time_s[count - 1]
    frozen = numbers(cut)
    frozen |= {
        "energy kinetic": kinetic_energy_J(scene, cut),
        "energy potential": potential_energy_J(scene, cut),
    }
    for joint in run.contacts:
        impacts = {name: value for name, value in impact_numbers(run).items() if name.startswith(f"{joint} ")}
        time_s, impulse = impacts[f"{joint} time_s"], impacts[f"{joint} normal_impulse_N_s"]
        over = time_s + impacts[f"{joint} duration_s"] <= end_s
        over &= impulse > WEAK * impulse.max(initial=0.0, where=over)
        frozen |= {
            f"impact {name}": value[over] for name, value in impacts.items() if np.isfinite(value).all()
        }
    return frozen


def more(scene: AnyScene) -> list[Trajectory]:
    """Return more repeats, by a method of another kind and begun on either side of the start."""
    settings = RunSettings(scene.end_time_s, GRID)
    sides = [a_place_off(scene, side * PLACES) for side in (-1.0, 0.0, 1.0)]
    return [solver.simulate(side, settings) for solver in (COLLOCATION, EXTRAPOLATION) for side in sides]


def uncertainty(value: FloatArray, repeats: list[FloatArray]) -> float:
    """Return the stated uncertainty of a number (n, ...), infinite where a repeat has another count."""
    if any(repeat.shape != value.shape for repeat in repeats):
        return float("inf")
    apart, size = (np.abs(x).max(initial=0.0) for x in (np.array(repeats) - value, value))
    return float(COVERAGE * apart + ROUND_OFF * size)


def main() -> None:
    """Write the file of all scenes."""
    log = ["git", "log", "-1", "--format=%H", "--", *CODE]
    commit = subprocess.run(log, capture_output=True, text=True, check=True).stdout.strip()
    about: dict[str, Any] = {"commit": commit, "scenes": {}}
    arrays = dict[str, Any]()
    for name in ALL_SCENES:
        scene = scene_of(name)
        (truth, repeats), count = converged(scene, GRID), followed(scene, GRID)
        frozen, *others = (told(scene, run, count) for run in (truth, *repeats, *more(scene)))
        stated = {key: uncertainty(value, [run[key] for run in others]) for key, value in frozen.items()}
        about["scenes"][name] = {"samples": count, "by": truth_by(scene, GRID), "uncertainty": stated}
        arrays |= {f"{name} {key}": value for key, value in frozen.items()}
        print(name, count, about["scenes"][name]["by"], flush=True)
    content = io.BytesIO()
    np.savez(content, about=np.array(json.dumps(about)), **arrays)
    FILE.write_bytes(lzma.compress(content.getvalue(), preset=9))


if __name__ == "__main__":
    main()
