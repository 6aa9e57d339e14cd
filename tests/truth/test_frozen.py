"""The reference solutions of today held to frozen ones: every number of every scene of the library.

Frozen is what another independent solver had, up to the scene's predictability horizon: in coordinates of a
spanning tree, gaps of loose pins among them, by collocation (commit 7642256c). A number's stated uncertainty
is three times the largest distance of repeats by two methods, begun some places beside, and round-off.

A solution may differ from a frozen one by ``TIMES`` its stated uncertainty and ``ROUNDING`` of the largest
of its kind. To the uncertainty comes the solution's own: ``TIMES`` distances from its repeats.
"""

import io
import json
import lzma
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine_models.engine import FloatArray, RunSettings, Trajectory
from engine_models.mechanics.energy import kinetic_energy_J, potential_energy_J
from engine_models.mechanics.states import lever_m
from engine_models.mechanics.trajectory import selected
from engine_models.reference.engine import SHARPEST, ReferenceEngine
from engine_models.scene.library import ALL_SCENES, SCENES
from engine_models.scene.scene import Scene
from studies.judges.converged_truth import GRID, PLACES, converged, truth_by
from studies.judges.horizon import a_place_off
from studies.settings import END_S
from tests.engines.runs import impact_numbers, numbers

FILE = Path(__file__).with_name("frozen.npz.xz")
#: Impacts of less than this part of the largest impulse of their joint are the last of a bounce's many.
WEAK = 1e-3
TIMES, ROUNDING = 3.0, 1e-12
#: Of a number's largest value: near their horizon the forces of loose pins are known to four digits.
SMALL = 2e-4
SHARP = tuple(ReferenceEngine(method="dop853", step_tolerance=times * SHARPEST) for times in (1, 10, 100))
#: Scenes that between them have every kind of joint, drive and load; `make accuracy` has the others.
FEW = (
    *("ideal-fluctuating", "ideal-compressor", "clearance-driven-damped", "clearance-free-OAB"),
    *("rigid-driven-AB", "rigid-pendulum", "scotch-yoke", "quick-return", "four-bar-clearance"),
)
scenes = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in FEW else pytest.mark.accuracy) for name in ALL_SCENES]
)


def scene_of(name: str) -> Scene:
    """Return a scene of the library with the end that the studies have."""
    scene = ALL_SCENES[name]()
    return scene.replace("end_time_s", END_S.get(name, scene.end_time_s))


def told(scene: Scene, run: Trajectory, count: int) -> dict[str, FloatArray]:
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


@cache
def frozen() -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Return what is told of each scene, and all arrays by scene and number."""
    arrays = dict(np.load(io.BytesIO(lzma.decompress(FILE.read_bytes()))))
    return json.loads(str(arrays.pop("about"))), arrays


def kind_of(key: str) -> str:
    """Return what a number is compared with the largest of: its kind, and of an impact the field's."""
    kind, *others = key.split()
    return others[-1] if kind == "impact" else kind


def outside(name: str, *runs: Trajectory) -> dict[str, str]:
    """Return the numbers that the first run has beyond their bounds; distances of others add to these."""
    scene, about = scene_of(name), frozen()[0]["scenes"][name]
    first, *others = (told(scene, run, about["samples"]) for run in runs)
    true = {key: frozen()[1][f"{name} {key}"] for key in about["uncertainty"]}
    largest = dict[str, float]()
    for key, value in true.items():
        largest[kind_of(key)] = max(largest.get(kind_of(key), 0.0), np.abs(value).max(initial=0.0))
    if "moment" in largest:  # of a force along a lever, though it may come to nothing
        largest["moment"] = max(largest["moment"], largest["force"] * lever_m(scene))
    wrong = dict[str, str]()
    for key, value in true.items():
        if any(run[key].shape != value.shape for run in (first, *others)):
            wrong[key] = f"{len(first[key])} values, {len(value)} expected"
            continue
        own = max((np.abs(run[key] - first[key]).max(initial=0.0) for run in others), default=0.0)
        bound = TIMES * (about["uncertainty"][key] + TIMES * own) + ROUNDING * largest[kind_of(key)]
        off = np.abs(first[key] - value).max(initial=0.0)
        if not off <= bound:
            wrong[key] = f"off by {off:.1e}, {bound:.1e} allowed"
    return wrong


@scenes
def test_the_reference_engine_has_the_frozen_solution(name: str) -> None:
    scene = scene_of(name)
    starts = [a_place_off(scene, places) for places in (0.0, PLACES, -PLACES)]
    settings = RunSettings(scene.end_time_s, GRID)
    runs = (solver.simulate(begun, settings) for solver, begun in zip(SHARP, starts, strict=True))
    assert outside(name, *runs) == {}


@scenes
def test_the_reference_solution_is_the_frozen_one(name: str) -> None:
    truth, repeats = converged(scene_of(name), GRID)
    assert outside(name, truth, *repeats) == {}
    assert truth_by(scene_of(name), GRID) == ("reference" if name.startswith("rigid") else "independent")


def test_all_scenes_are_frozen_until_they_end_or_cannot_be_told_any_longer() -> None:
    scenes = frozen()[0]["scenes"]
    assert scenes.keys() == ALL_SCENES.keys()
    assert {about["by"] for about in scenes.values()} == {"independent"}
    cut = {name for name, about in scenes.items() if about["samples"] < GRID + 1}
    assert cut < {name for name in SCENES if not name.startswith("ideal")}
    assert sum(about["samples"] for about in scenes.values()) > 0.9 * len(scenes) * (GRID + 1)
    assert FILE.stat().st_size < 4e6


def test_uncertainties_are_small() -> None:
    """Else the bounds would let everything through."""
    about, arrays = frozen()
    for name, scene in about["scenes"].items():
        for key, uncertainty in scene["uncertainty"].items():
            size = np.abs(arrays[f"{name} {key}"]).max(initial=1e-9)  # moments of no size are round-off
            assert uncertainty < SMALL * size, f"{name} {key}: {uncertainty / size:.1e}"
