"""The reference against the best rungs of its rivals: who is cheaper at their errors, counted and told."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite

import pandas as pd

from reports.equal_error import SLIDER, Judged, Ratio, arrival, at_rung, front, ratio, saturated
from reports.parts import Table
from reports.quantities import finished
from reports.style import words
from reports.tables import ABSENT, in_text, listed, on_scenes, plain

REFERENCE = "reference"


@dataclass(frozen=True)
class Race:
    """The reference on a scene against the rungs of its rivals that no other of theirs beats.

    ``shares`` are the reference's run times at their errors in parts of theirs, each with the rival's label:
    None where the reference does not get there. ``alone`` is how many of the reference's own best rungs have
    errors that no rival gets to, ``nearest`` the smallest error of the reference.
    """

    scene: str
    shares: tuple[tuple[str, Ratio | None], ...]
    alone: int
    nearest: float

    @property
    def cheaper(self) -> list[float]:
        """The shares where the reference is cheaper."""
        return [share.median for _, share in self.shares if share and share.decided and share.median < 1]

    @property
    def dearer(self) -> list[tuple[str, float]]:
        """The rivals that are cheaper, with the shares."""
        decided = [(label, share.median) for label, share in self.shares if share and share.decided]
        return [(label, share) for label, share in decided if share > 1]

    @property
    def rivals_alone(self) -> list[str]:
        """The rivals at whose rungs the reference does not arrive."""
        return [label for label, share in self.shares if share is None]

    @property
    def undecided(self) -> int:
        """At how many rungs the timing does not resolve who is cheaper."""
        return len(self.shares) - len(self.cheaper) - len(self.dearer) - len(self.rivals_alone)


def races(judged: Judged) -> list[Race]:
    """Return the races on all scenes that the reference and a rival run."""
    return [
        _race(scene, rungs, judged.column)
        for scene, (rungs, _) in judged.ladders.items()
        if {REFERENCE} < set(rungs["engine"])
    ]


def _race(scene: str, rungs: pd.DataFrame, column: str) -> Race:
    own, rivals = rungs[rungs["engine"] == REFERENCE], front(rungs[rungs["engine"] != REFERENCE])
    shares: list[tuple[str, Ratio | None]] = []
    for rung in rivals.itertuples():
        there = arrival(own, float(str(rung.kept)))
        way = at_rung(rung)
        label = f"{rung.label}, without its forces," if way.without(column) else str(rung.label)
        shares.append((label, ratio(there, way) if there else None))
    alone = front(own)["kept"] < rivals["kept"].min()
    return Race(scene, tuple(shares), int(alone.sum()), float(own["kept"].min()))


def found(judged: Judged) -> Iterator[str]:
    """Yield how the reference does, and by scene where a rival is cheaper, alone or level."""
    run = races(judged)
    if not run:
        return
    name, unit = words(judged.column)
    won = sum(len(race.cheaper) == len(race.shares) for race in run)
    sentence = (
        f"By {name}, {judged.work}, the reference is cheaper at the errors of all its rivals' best rungs "
        f"{on_scenes(won, len(run))}."
    )
    if shares := [share for race in run for share in race.cheaper]:
        scenes = on_scenes(sum(bool(race.cheaper) for race in run), len(run))
        sentence += f" It is cheaper at some of them {scenes}. There it takes {_span(shares)} of their time."
    yield sentence
    for race in run:
        yield from (f"{race.scene} by {name}, {judged.work}: {each}" for each in _not_won(race, unit))


def _not_won(race: Race, unit: str) -> Iterator[str]:
    """Yield where a rival is cheaper than the reference, where it is alone, and where neither is cheaper."""
    for label in dict.fromkeys(label for label, _ in race.dearer):
        shares = [share for rival, share in race.dearer if rival == label]
        yield (
            f"{label} is cheaper at {len(shares)} of the best rungs; the reference takes up to "
            f"{plain(max(shares))} times as long."
        )
    if race.rivals_alone:
        nearest = (
            f"comes no nearer than {in_text(race.nearest)} {unit}" if isfinite(race.nearest) else "has none"
        )
        yield (
            f"{listed(dict.fromkeys(race.rivals_alone))} alone is there at {len(race.rivals_alone)} of the "
            f"best rungs; the reference {nearest}."
        )
    if race.undecided:
        rungs = f"{race.undecided} of {len(race.shares)} best rungs"
        yield f"the timing does not resolve who is cheaper at {rungs}."


def saturated_found(rows: pd.DataFrame) -> Iterator[str]:
    """Yield on each scene how many runs' errors have grown to the clearance, and of whom all have."""
    recorded = finished(rows[rows["round"].isna() & rows["compiled_anew"].isna()])
    for scene, runs in recorded.groupby("scene"):
        lost = saturated(runs, SLIDER)
        if lost.any():
            everywhere = lost.groupby(runs["engine"]).all()
            whole = f", among them all of {listed(everywhere.index[everywhere])}" if everywhere.any() else ""
            yield (
                f"On {scene} the slider's error grows to a tenth of the clearance or more in {lost.sum()} of "
                f"{len(runs)} runs{whole}. These are ranked at fixed earlier times alone."
            )


def races_table(judged: Judged) -> Table | None:
    """Return the counts of the races; None if there are none."""
    run = races(judged)
    if not run:
        return None
    return Table.of(
        f"{judged.name}-races",
        f"Who is cheaper by {words(judged.column)[0]}, {judged.work}",
        "Counted are the best rungs of the reference's rivals: those that no other of theirs beats in both "
        "error and run time. At each of these errors the reference or the rival is cheaper, if the interval "
        "of the ratio of their run times leaves out 1. A rival is there alone where the reference does not "
        "get to that error; the reference alone at those of its own best rungs that no rival gets to.",
        {
            "scene": [race.scene for race in run],
            "rivals' best rungs": [str(len(race.shares)) for race in run],
            "reference cheaper": [str(len(race.cheaper)) for race in run],
            "in parts of the rival's time": [_span(race.cheaper) for race in run],
            "rival cheaper": [str(len(race.dearer)) for race in run],
            "not resolved": [str(race.undecided) for race in run],
            "rival alone": [str(len(race.rivals_alone)) for race in run],
            "reference alone": [str(race.alone) for race in run],
        },
    )


def _span(shares: list[float]) -> str:
    ends = [plain(min(shares)), plain(max(shares))] if shares else [ABSENT]
    return " to ".join(dict.fromkeys(ends))
