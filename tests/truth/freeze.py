"""Writes the frozen reference solutions: ``python -m tests.truth.freeze``.

They are what the independent solver of ``studies.truth`` had of every scene of the library, up to the scene's
predictability horizon, before anything was replaced. A number's stated uncertainty is ``COVERAGE`` times the
largest distance of the repeat by another method, and round-off.
"""

import io
import json
import lzma
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.energy import energy_balance_residual_J, kinetic_energy_J, potential_energy_J
from engine_models.mechanics.samples import selected
from engine_models.scene.library.mechanisms import ALL_SCENES
from engine_models.scene.parts import AnyScene
from studies.clearance import END_S
from studies.judges.converged_truth import GRID, converged, followed, truth_by
from studies.judges.metrics import COVERAGE, ROUND_OFF
from tests.engines.runs import impact_numbers, numbers

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
    frozen["energy residual"] = energy_balance_residual_J(scene, cut)
    for joint in run.contacts:
        impacts = {name: value for name, value in impact_numbers(run).items() if name.startswith(f"{joint} ")}
        time_s, impulse = impacts[f"{joint} time_s"], impacts[f"{joint} normal_impulse_N_s"]
        over = time_s + impacts[f"{joint} duration_s"] <= end_s
        over &= impulse > WEAK * impulse.max(initial=0.0, where=over)
        frozen |= {
            f"impact {name}": value[over] for name, value in impacts.items() if np.isfinite(value).all()
        }
    return frozen


def uncertainty(value: FloatArray, repeat: FloatArray) -> float:
    """Return the stated uncertainty of a number (n, ...), infinite where a repeat has another count."""
    if value.shape != repeat.shape:
        return float("inf")
    apart, size = np.abs(value - repeat).max(initial=0.0), np.abs(value).max(initial=0.0)
    return float(COVERAGE * apart + ROUND_OFF * size)


def main() -> None:
    """Write the file of all scenes."""
    commit = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout
    about: dict[str, Any] = {"commit": commit.strip(), "scenes": {}}
    arrays = dict[str, FloatArray]()
    for name in ALL_SCENES:
        scene = scene_of(name)
        (truth, repeats), count = converged(scene, GRID), followed(scene, GRID)
        frozen, again = (told(scene, run, count) for run in (truth, repeats[0]))
        stated = {key: uncertainty(value, again[key]) for key, value in frozen.items()}
        about["scenes"][name] = {"samples": count, "by": truth_by(scene, GRID), "uncertainty": stated}
        arrays |= {f"{name} {key}": value for key, value in frozen.items()}
        print(name, count, about["scenes"][name]["by"], flush=True)
    content = io.BytesIO()
    np.savez(content, about=np.array(json.dumps(about)), **arrays)
    FILE.write_bytes(lzma.compress(content.getvalue(), preset=9))


if __name__ == "__main__":
    main()
