"""Make the truths of random scenes: ``python -m tests.random_scenes.make [compliant | rigid] [SCENES]``.

What is in the files already is kept, unless the recipe makes another scene of its seed now; without a file
all is made anew. Every scene is integrated several times by ``studies.truth``, by other methods, at other
tolerances, and from a start that is a unit in the last place off. The uncertainty at a time is twice the
largest difference of any two until then.
"""

import json
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np

from engine_models.scene.scene import Scene
from studies.judges.horizon import a_place_off
from studies.truth.motion import Motion
from studies.truth.rigid_walls import Paradox
from studies.truth.stepping import collocated, extrapolated, extrapolation, radau
from tests.random_scenes.recipe import random_scene
from tests.random_scenes.truths import (
    DEFAULT,
    SAMPLES,
    TOLERANCES_M,
    FloatArray,
    Judgement,
    Kind,
    Truth,
    certain_to_m,
    fingerprint,
    path_of,
    row_of,
    write,
)

SCENES: dict[Kind, int] = {"compliant": 240, "rigid": 120}
#: Times at which integrations are compared, and how few of them a scene is not judged at all.
COMPARED, FEWEST = 240, 5
#: Most steps of an integration; one that takes more is left out. The scene stops without the best one or
#: a second.
STEPS, STEPS_COMPLIANT_IMPLICIT = 60_000, 300_000
#: The shortest flights between rigid walls. What a bounce's end leaves out is in proportion to them.
FLIGHTS_S = 2e-10, 1e-9, 4e-10


class Integration(Motion):
    """A crank-slider in motion."""

    @property
    def slider_m(self) -> float:
        """Where the slider is."""
        self.answer()
        return float(self.bodies()[0][-1, 0])


def compliant_integrations(scene: Scene) -> list[Callable[[], Integration]]:
    """Return what makes each integration of a scene; the first one is the best."""
    implicit, beside = STEPS_COMPLIANT_IMPLICIT, a_place_off(scene)
    return [
        lambda: Integration(scene, collocated, radau(7, 1e-11), implicit),
        lambda: Integration(beside, collocated, radau(6, 1e-12), implicit),
        lambda: Integration(scene, extrapolated, extrapolation(1e-14), STEPS),
    ]


def rigid_integrations(scene: Scene) -> list[Callable[[], Integration]]:
    """As ``compliant_integrations``; converging bounces end at other flights in each."""
    (first, second, third), beside = FLIGHTS_S, a_place_off(scene)
    return [
        lambda: Integration(scene, collocated, radau(7, 1e-11), STEPS, first),
        lambda: Integration(beside, collocated, radau(6, 1e-12), STEPS, second),
        lambda: Integration(scene, extrapolated, extrapolation(1e-14), STEPS, third),
    ]


INTEGRATIONS: dict[Kind, Callable[[Scene], list[Callable[[], Integration]]]] = {
    "compliant": compliant_integrations,
    "rigid": rigid_integrations,
}


def truth(seed: int, kind: Kind) -> Truth:
    """Find the truth of one scene."""
    scene = random_scene(seed, kind == "rigid")
    begin = INTEGRATIONS[kind](scene)
    wanted = {at: certain_to_m(scene, at) for at in (*TOLERANCES_M, DEFAULT)}
    known, count, stopped = uncertainties(scene, [make() for make in begin], max(wanted.values()))
    ends = {at: int(np.searchsorted(known, certain, side="right")) for at, certain in wanted.items()}
    ends = {at: n for at, n in ends.items() if n >= FEWEST}
    times = {n: np.linspace(0.0, n * scene.end_time_s / COMPARED, SAMPLES + 1) for n in set(ends.values())}
    try:
        positions = _positions(begin[0](), np.unique(np.concatenate([*times.values(), np.zeros(1)])))
    except Paradox as paradox:
        return Truth(seed, kind, str(paradox), {})
    judgements: dict[float | str, Judgement] = {}
    for at, n in ends.items():
        position = np.array([positions[t] for t in times[n].tolist()])
        judgements[at] = Judgement(float(times[n][-1]), position, float(known[n - 1]), count[n - 1])
    return Truth(seed, kind, stopped, judgements)


def uncertainties(
    scene: Scene, integrations: Sequence[Integration], most_m: float
) -> tuple[FloatArray, list[int], str]:
    """Return the uncertainty in m at each compared time, and from how many integrations it is.

    Third is why it stops before the scene's end, if it does: a part of them beyond ``most_m`` is no use.
    """
    known, count, running, worst = list[float](), list[int](), list(integrations), 0.0
    for n in range(1, COMPARED + 1):
        try:
            running = [one for one in running if one.to(n * scene.end_time_s / COMPARED)]
        except Paradox as paradox:
            return np.array(known), count, str(paradox)
        if len(running) < 2 or running[0] is not integrations[0]:
            return np.array(known), count, "steps"
        places = [one.slider_m for one in running]
        worst = max(worst, 2 * (max(places) - min(places)))
        if not worst <= most_m:
            return np.array(known), count, "horizon"
        known.append(worst)
        count.append(len(running))
    return np.array(known), count, ""


def _positions(integration: Integration, times: FloatArray) -> dict[float, float]:
    """Return where the slider is at ascending times, at which steps end as they did not before."""
    found, integration.steps = {}, np.inf
    for t in times.tolist():
        if not integration.to(t):
            raise Paradox(f"not reached again: {t} s")
        found[t] = integration.slider_m
    return found


def make(kind: Kind, scenes: int) -> None:
    """Make the truths of a kind that there are not yet."""
    rows = {}
    if path_of(kind).exists():
        for line in path_of(kind).read_text(encoding="utf-8").splitlines():
            row = json.loads(line)
            if row["scene"] == fingerprint(random_scene(row["seed"], kind == "rigid")):
                rows[row["seed"]] = row
    for seed in range(scenes):
        if seed in rows:
            continue
        began, found = time.perf_counter(), truth(seed, kind)
        rows[seed] = row_of(found)
        write(kind, rows.values())
        ends = {at: f"{one.end_time_s:.3g}" for at, one in found.judgements.items()}
        took = time.perf_counter() - began
        print(f"{kind} {seed}: {took:.1f} s, {found.stopped or 'to its end'}, {ends}", flush=True)


def main(arguments: Sequence[str]) -> None:
    """Make what is asked for, or all."""
    kinds = [kind for kind in INTEGRATIONS if not arguments or kind == arguments[0]]
    for kind in kinds:
        make(kind, int(arguments[1]) if len(arguments) > 1 else SCENES[kind])


if __name__ == "__main__":
    main(sys.argv[1:])
