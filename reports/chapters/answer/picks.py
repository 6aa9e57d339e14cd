"""Who to take: each engine's cheapest run within an error that all finer ones of its arm keep, by scene."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from shlex import quote

import pandas as pd

from reports.equal_error import Arrival, Judged, Ratio, at_rung, ratio
from reports.quantities import PEAK, with_largest, with_peak
from reports.results import Results, with_columns
from reports.run.command import command

POSITION, FORCE = "slider_position_error_m", "largest_joint_force_error_N"
#: What is asked for: an error in a signal, in words, and how large it may be, in the column's unit.
TARGETS = ((POSITION, "motion", 1e-6), (FORCE, "joint forces", 1.0), (PEAK, "peak forces", 1.0))
#: How the columns begin that only scenes with clearance have.
LOOSE = "^clearance_"


@dataclass(frozen=True)
class Pick:
    """A rung within a target: ``way`` is arm, setting and times, ``error`` its own, ``command`` runs it."""

    way: Arrival
    error: float
    command: str


@dataclass(frozen=True)
class Race:
    """Each engine's cheapest pick for one target on one scene, in that order; ``absent`` do not get there.

    There are none where no engine gets there.

    ``end_s`` is the length of the motion, ``uncertainty`` the truth's own, ``within`` are all rungs within
    the target.
    """

    column: str
    what: str
    target: float
    scene: str
    loose: bool
    end_s: float
    uncertainty: float
    picks: tuple[Pick, ...]
    absent: tuple[str, ...]
    within: tuple[Pick, ...]

    @property
    def cheapest(self) -> list[Pick]:
        """The cheapest pick, and those that the timing does not resolve from it."""
        ratios = self.ratios
        level = [pick for pick in self.picks if (of := ratios.get(pick.way.label)) and not of.decided]
        return [*self.picks[:1], *level]

    @property
    def ratios(self) -> dict[str, Ratio]:
        """What every other engine takes in times of the cheapest."""
        found = {pick.way.label: ratio(pick.way, self.picks[0].way) for pick in self.picks[1:]}
        return {label: each for label, each in found.items() if each}


def races(timed: Results) -> list[Race]:
    """Return the races for every target on every scene that has the error asked for, clearance first."""
    needed = (
        "round",
        "compiled_anew",
        "compared_until_s",
        "solve_time_s",
        "build_time_s",
        "end_time_s",
        POSITION,
    )
    rows = with_largest(with_columns(timed.rows, *needed), FORCE, r"joint_\w_force_error_N")
    rows = with_peak(rows)
    loose = set(rows["scene"][rows.filter(regex=LOOSE).notna().any(axis=1)])
    found = [race for target in TARGETS for race in _races(rows, *target, loose)]
    return sorted(found, key=lambda race: not race.loose)


def _races(rows: pd.DataFrame, column: str, what: str, target: float, loose: set[str]) -> Iterator[Race]:
    for scene, (rungs, floor) in Judged("", rows, column).ladders.items():
        within = rungs[rungs["kept"] <= target].sort_values("time_s")
        best = within.drop_duplicates("engine")
        absent = tuple(sorted(set(rungs["engine"]) - set(best["engine"])))
        end = float(rows["end_time_s"][rows["scene"] == scene].max())
        typed = f"{quote(scene)} --end {end:.6g}"
        ways = {
            rung.Index: Pick(at_rung(rung), float(str(rung.error)), command(rows.loc[rung.Index], typed))
            for rung in within.itertuples()
        }
        picks = tuple(ways[place] for place in best.index)
        yield Race(
            column, what, target, scene, scene in loose, end, floor, picks, absent, tuple(ways.values())
        )


def asked(found: Sequence[Race], column: str, *, loose: bool) -> list[Race]:
    """Return the races for one target, with clearance or without."""
    return [race for race in found if race.column == column and race.loose == loose]


@dataclass(frozen=True)
class Setting:
    """An arm at a setting that is within a target on some scenes.

    ``times_s`` are its run times there, ``ratios`` the same in times of the cheapest engine's. ``command``
    runs it on the first of them. ``without`` says what these times leave out (see ``Arrival.without``).
    """

    engine: str
    label: str
    setting: str
    times_s: tuple[float, ...]
    ratios: tuple[float, ...]
    command: str
    without: str = ""


def widest(races: Sequence[Race]) -> list[Setting]:
    """Return each engine's setting that is within the target on most scenes, the best engine first.

    Of those within it on as many it is the one that takes the least on the scene where it does worst.
    """
    ways: dict[tuple[str, str, str, str], list[tuple[float, float, str]]] = {}
    for race in races:
        for pick in race.within:
            way, without = pick.way, pick.way.without(race.column)
            costs = (way.time_s, way.time_s / race.picks[0].way.time_s, pick.command)
            ways.setdefault((way.engine, way.label, way.setting, without), []).append(costs)
    settings = [
        Setting(engine, label, setting, times, ratios, commands[0], without)
        for (engine, label, setting, without), (times, ratios, commands) in (
            (way, zip(*costs, strict=True)) for way, costs in ways.items()
        )
    ]
    best: dict[str, Setting] = {}
    for each in sorted(settings, key=lambda each: (-len(each.times_s), max(each.ratios))):
        best.setdefault(each.engine, each)
    return list(best.values())


def won_by(races: Sequence[Race], winner: str, loser: str) -> list[Ratio]:
    """Return the ratio of the loser's cheapest run to the winner's, wherever nobody is surely as cheap."""
    lost = [
        (race, pick.way.label)
        for race in races
        for pick in race.picks
        if race.picks[0].way.engine == winner and pick.way.engine == loser
    ]
    found = [race.ratios.get(label) for race, label in lost]
    return [ratio for ratio in found if ratio and ratio.decided]
