"""The answer in sentences: whom to take, what it costs, what not to trust, what the study cannot say."""

from collections.abc import Iterator, Mapping, Sequence

from reports.chapters.answer.picks import FORCE, POSITION, Race, asked, safest
from reports.chapters.answer.trust import HIDDEN_PART, LOST_IN_WORDS, Hidden
from reports.chapters.extremes.verdict import Verdict, answers
from reports.equal_error import Ratio
from reports.parts import Finding, Number
from reports.results import Results
from reports.style import words
from reports.tables import listed, plain

#: How a target is written in a sentence, by its column.
WITHIN = {POSITION: "the slider within 1 µm", FORCE: "joint forces within 1 N"}


def whom_to_take(races: Sequence[Race]) -> Iterator[Finding]:
    """Yield the cheapest engine for each target on each scene with clearance, and how far the next one is."""
    for column in WITHIN:
        for race in asked(races, column, loose=True):
            yield _cheapest(race)
    for column in WITHIN:
        yield from _others(asked(races, column, loose=True), column)


def one_for_all(races: Sequence[Race]) -> Iterator[Finding]:
    """Yield the one setting that is within a target on all scenes with clearance, if there is any."""
    of_all = asked(races, POSITION, loose=True)
    if len(of_all) < 2 or not (safe := safest(of_all)):
        return
    arm, setting, times = safe
    yield Finding(
        f"{arm} at {setting} has {WITHIN[POSITION]} on all {len(of_all)} scenes with clearance that are "
        f"timed, in at most {plain(times)} times the time of the cheapest there.",
        "one-for-all",
        [Number(times, "times")],
    )


def _cheapest(race: Race) -> Finding:
    first, *others = race.picks
    time = Number(1e3 * first.way.time_s, "ms", 1e3 * min(first.way.times_s), 1e3 * max(first.way.times_s))
    text = (
        f"For {WITHIN[race.column]} on {race.scene} take {first.way.label} at {first.way.setting}: "
        f"{plain(time.value)} ms for {race.end_s:.2g} s of motion"
    )
    numbers = [time, Number(first.error, words(race.column)[1], high=race.uncertainty + first.error)]
    if others:
        next_one = others[0].way.label
        times = race.ratios.get(next_one)
        text += f"; next is {next_one} at {others[0].way.setting}" + (f", {_slower(times)}" if times else "")
        numbers += [Number(times.median, "times", times.low, times.high)] if times else []
    return Finding(f"{text}.", f"take-{race.column}-{race.scene}", numbers)


def _slower(times: Ratio) -> str:
    return f"{plain(times.median)} times as long" if times.decided else "which rounds do not tell apart"


def _others(races: Sequence[Race], column: str) -> Iterator[Finding]:
    """Yield what the engines cost that are cheapest nowhere, and who does not get there at all."""
    if not races:
        return
    near = {pick.way.engine for race in races for pick in race.picks[:2]}
    far: dict[str, list[Ratio]] = {}
    for race in races:
        for pick in race.picks[2:]:
            if pick.way.engine not in near and pick.way.label in race.ratios:
                far.setdefault(pick.way.engine, []).append(race.ratios[pick.way.label])
    if far:
        costs = listed(f"{engine} {_between(ratios)} times" for engine, ratios in far.items())
        numbers = [Number(each.median, "times", each.low, each.high) for of in far.values() for each in of]
        yield Finding(f"For {WITHIN[column]}, {costs} as long as the cheapest.", f"dear-{column}", numbers)
    absent = {
        engine: [race.scene for race in races if engine in race.absent]
        for race in races
        for engine in race.absent
    }
    for engine, scenes in absent.items():
        where = "any of these scenes" if len(scenes) == len(races) else listed(scenes)
        yield Finding(f"No rung of {engine} gets {WITHIN[column]} on {where}.", f"absent-{column}-{engine}")


def _between(ratios: Sequence[Ratio]) -> str:
    ends = dict.fromkeys(plain(end) for end in (min(r.median for r in ratios), max(r.median for r in ratios)))
    return " to ".join(ends)


def who_keeps_energy(arms: Sequence[Hidden]) -> Iterator[Finding]:
    """Yield which arms hide next to nothing of the energy that contacts dissipate, and which one most."""
    keep = [arm for arm in arms if arm.part <= HIDDEN_PART]
    if keep:
        yield Finding(
            f"Energy stays, to {100 * HIDDEN_PART:g} % of what contacts dissipate, with "
            f"{listed(arm.label for arm in keep)}, on all scenes with contact that they finished.",
            "energy-kept",
            [Number(100 * keep[-1].part, "%")],
        )
    if arms and arms[-1].part > HIDDEN_PART:
        worst = arms[-1]
        yield Finding(
            f"{worst.label} may hide up to {plain(100 * worst.part)} % of it.",
            "energy-hidden",
            [Number(100 * worst.part, "%")],
        )


def what_not_to_trust(studies: Mapping[str, Results], horizons: Mapping[str, float]) -> Iterator[Finding]:
    """Yield from when on nobody's motion means anything, and who reports success where it is wrong."""
    if horizons:
        scene, turns = next(iter(horizons.items()))
        others = f", at the latest after {plain(max(horizons.values()))}" if len(horizons) > 1 else ""
        yield Finding(
            f"Trust no single motion for long: on {scene} a start moved by a hair has the slider off by "
            f"{LOST_IN_WORDS} after {plain(turns)} revolutions"
            + (f", and on {len(horizons) - 1} other scenes{others}" if others else "")
            + "; past that only averages can be right.",
            "horizon",
            [Number(count, "revolutions") for count in horizons.values()],
        )
    if "extremes" in studies:
        runs = answers(studies["extremes"].rows)
        bare = runs["unguarded"].where(runs["unguarded"].notna(), runs["verdict"])
        wrong = bare.isin((Verdict.NONSENSE, Verdict.NOTICED)).groupby(runs["label"], observed=True).sum()
        if wrong.max() > 0:
            cases = runs["scene"].nunique()
            yield Finding(
                f"Trust no run without a check: on {cases} hard cases {wrong.idxmax()} by itself calls "
                f"nonsense a success {wrong.max()} times"
                + (f", and {listed(wrong.index[wrong == 0])} never" if (wrong == 0).any() else "")
                + ".",
                "nonsense",
                [Number(float(wrong.max()), "runs")],
            )


def what_it_cannot_say(races: Sequence[Race], studies: Mapping[str, Results]) -> Iterator[str]:
    """Yield what no row tells: of other machines, other scenes, and real mechanisms."""
    timed = studies.get("work-precision")
    if timed and races:
        scenes = dict.fromkeys(race.scene for race in races)
        machine = (timed.sidecar or {}).get("machine", {}).get("processor", "a machine that is not on record")
        yield (
            f"Run times are of {machine} and {len(scenes)} scenes; ratios carry over to other machines, "
            "milliseconds do not."
        )
    yield (
        "Truth is the exact solution of each engine's own model: how well rigid links, planar motion and a "
        "dry contact law describe a machine is not asked, nor anything of bending, lubrication, heat or wear."
    )
    if not any(name in studies for name in ("energy", "extremes", "predictability")):
        yield "Nothing here tells of energy over long runs, of hard cases, or of how long a motion is known."
