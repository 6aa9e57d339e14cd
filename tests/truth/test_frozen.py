"""The reference solutions of today held to the frozen ones: every number of every scene of the library.

A solution may differ from a frozen one by ``TIMES`` its stated uncertainty and ``ROUNDING`` of the largest
of its kind. To the uncertainty comes the reference engine's own, whose tolerance decides: ``COVERAGE``
distances of its run at the sharpest tolerance from those at larger ones, begun a hair beside.
"""

import io
import json
import lzma
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

from engine_models.engine import FloatArray, RunSettings
from engine_models.reference.engine import SHARPEST, ReferenceEngine
from engine_models.scene.library import SCENES
from engine_models.scene.library.mechanisms import ALL_SCENES
from studies.judges.converged_truth import COLLOCATION, EXTRAPOLATION, GRID, PLACES
from studies.judges.horizon import a_place_off
from studies.judges.metrics import COVERAGE
from studies.judges.run_cache import Solver
from tests.truth.freeze import FILE, scene_of, told

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


@cache
def frozen() -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Return what is told of each scene, and all arrays by scene and number."""
    arrays = dict(np.load(io.BytesIO(lzma.decompress(FILE.read_bytes()))))
    return json.loads(str(arrays.pop("about"))), arrays


def kind_of(key: str) -> str:
    """Return what a number is compared with the largest of: its kind, and of an impact the field's."""
    kind, *others = key.split()
    return others[-1] if kind == "impact" else kind


def outside(name: str, solvers: Sequence[Solver]) -> dict[str, str]:
    """Return the numbers that the first solver has beyond their bounds; distances of others add to these."""
    scene, about = scene_of(name), frozen()[0]["scenes"][name]
    starts = [a_place_off(scene, places) for places in (0.0, PLACES, -PLACES)]
    first, *others = (
        told(scene, solver.simulate(beside, RunSettings(scene.end_time_s, GRID)), about["samples"])
        for solver, beside in zip(solvers, starts, strict=False)
    )
    true = {key: frozen()[1][f"{name} {key}"] for key in about["uncertainty"]}
    largest = dict[str, float]()
    for key, value in true.items():
        largest[kind_of(key)] = max(largest.get(kind_of(key), 0.0), np.abs(value).max(initial=0.0))
    wrong = dict[str, str]()
    for key, value in true.items():
        if any(run[key].shape != value.shape for run in (first, *others)):
            wrong[key] = f"{len(first[key])} values, {len(value)} expected"
            continue
        own = max((np.abs(run[key] - first[key]).max(initial=0.0) for run in others), default=0.0)
        bound = TIMES * (about["uncertainty"][key] + COVERAGE * own) + ROUNDING * largest[kind_of(key)]
        off = np.abs(first[key] - value).max(initial=0.0)
        if not off <= bound:
            wrong[key] = f"off by {off:.1e}, {bound:.1e} allowed"
    return wrong


@scenes
def test_the_reference_engine_has_the_frozen_solution(name: str) -> None:
    assert outside(name, SHARP) == {}


@pytest.mark.parametrize("solver", [COLLOCATION, EXTRAPOLATION], ids=lambda solver: solver.method)
@scenes
def test_the_independent_solver_has_the_frozen_solution(name: str, solver: Solver) -> None:
    assert outside(name, [solver]) == {}


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
