"""The answer in sentences: whom to take, what it costs, what not to trust, what the study cannot say."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from reports.chapters.answer.picks import FORCE, POSITION, Race, Setting, asked, widest, won_by
from reports.chapters.answer.trust import HIDDEN_PART, LOST_IN_WORDS, Hidden
from reports.chapters.extremes.verdict import MODEL, Verdict, answers
from reports.equal_error import Ratio
from reports.parts import Finding, Number
from reports.quantities import PEAK
from reports.results import Results
from reports.shared_tables import not_installed
from reports.style import words
from reports.tables import listed, on_scenes, plain

#: How a target is written in a sentence, by its column.
WITHIN = {
    POSITION: "the slider within 1 µm",
    FORCE: "joint forces within 1 N",
    PEAK: "the peak force of every impact within 1 %",
}
#: What is meant by the error of a force, where there are impacts.
FORCES = (
    "The error of joint forces is the largest pointwise difference on a grid that resolves every impact; "
    "10⁻⁹ s at the flank of an impact is some newtons, so peak forces, and forces at equal phase of an "
    "impact, are judged beside it."
)


def whom_to_take(races: Sequence[Race]) -> Iterator[Finding]:
    """Yield whose setting is within each target on most scenes with clearance, its cost, and the others'."""
    taken: Setting | None = None
    told: set[str] = set()
    for column in WITHIN:
        of = asked(races, column, loose=True)
        settings = widest(of)
        if taken and of and _as_sharp(taken, of):
            scenes = on_scenes(len(of))
            text = f"{taken.label} at {taken.setting} has {WITHIN[column]} as well; it is enough {scenes}."
            yield Finding(text, f"take-{column}")
            first = taken
        elif settings:
            first = settings[0]
            taken = taken or first
            yield _taken(first, column, len(of))
            yield from _run(first, of, told)
        others = [(each, won_by(of, each.engine, first.engine)) for each in settings]
        for each, won in sorted(others, key=lambda pair: -len(pair[1])):
            if won:
                yield _winner(each, first, of, won)
                yield from _run(each, of, told)
            elif column == POSITION and each.engine != first.engine:
                yield _beside(each, of)
        without = Counter(engine for race in of for engine in race.absent)
        for engine in sorted(without.keys() - {each.engine for each in settings}):
            text = f"No setting of {engine} has {WITHIN[column]} on any of {without[engine]} scenes."
            yield Finding(text, f"{engine}-{column}")
        if of and column == FORCE:
            yield Finding(FORCES, "forces")


def _as_sharp(taken: Setting, races: Sequence[Race]) -> bool:
    """Return whether a setting is within the target of all races."""
    at = (taken.label, taken.setting)
    return all(at in {(pick.way.label, pick.way.setting) for pick in race.within} for race in races)


def _taken(first: Setting, column: str, scenes: int) -> Finding:
    times = [1e3 * time for time in first.times_s]
    text = (
        f"For {WITHIN[column]} with clearance take {first.label} at {first.setting}{_there(first, scenes)}. "
        f"A run takes {_between(times)} ms there{_left_out(first)}."
    )
    return Finding(text, f"take-{column}", [Number(time, "ms") for time in times])


def _run(each: Setting, races: Sequence[Race], told: set[str]) -> Iterator[Finding]:
    """Yield the command that runs a setting, unless it is among those told."""
    if each.command not in told:
        told.add(each.command)
        yield Finding(f"To run it: {each.command}", f"run-{_id(each, races)}")


def _winner(each: Setting, first: Setting, races: Sequence[Race], won: Sequence[Ratio]) -> Finding:
    """Return on how many scenes an engine is faster than the one taken, by how much, and where it stops."""
    worst = max(won, key=lambda times: times.median)
    text = (
        f"In {races[0].what} {each.engine} is cheaper {on_scenes(len(won), len(races))}; {first.engine} "
        f"takes up to {plain(worst.median)} times as long there{_left_out(each)}. Its setting for most "
        f"scenes is {each.label} at {each.setting}{_there(each, len(races))}."
    )
    return Finding(text, _id(each, races), [Number(worst.median, "times", worst.low, worst.high)])


def _beside(each: Setting, races: Sequence[Race]) -> Finding:
    """Return what an engine's setting costs beside the cheapest engine's."""
    text = (
        f"{each.label} at {each.setting}: a run takes {_between(each.ratios)} times as long as the cheapest"
        f"{_there(each, len(races))}."
    )
    return Finding(text, _id(each, races), [Number(value, "times") for value in each.ratios])


def _left_out(each: Setting) -> str:
    """Return what the run times of a setting leave out, if they do."""
    return (
        f"; {each.engine}'s forces are computed after the run and are not in its time" if each.without else ""
    )


def _id(each: Setting, races: Sequence[Race]) -> str:
    return f"{each.engine}-{races[0].column}"


def _there(setting: Setting, scenes: int) -> str:
    """Return on how many scenes a setting is within the target."""
    return f"; it is enough {on_scenes(len(setting.times_s), scenes)}"


def on_each_scene(races: Sequence[Race]) -> Iterator[Finding]:
    """Yield the cheapest engine for each target on each scene with clearance, and how far the next one is."""
    for race in (race for column in WITHIN for race in asked(races, column, loose=True)):
        name = f"cheapest-{race.column}-{race.scene}"
        if not race.picks:
            yield Finding(f"No engine has {WITHIN[race.column]} on {race.scene}.", name)
            continue
        first, *others = race.picks
        times_ms = [1e3 * time for time in (first.way.time_s, min(first.way.times_s), max(first.way.times_s))]
        numbers = [
            Number(times_ms[0], "ms", *times_ms[1:]),
            Number(
                first.error,
                words(race.column)[1],
                max(0.0, first.error - race.uncertainty),
                first.error + race.uncertainty,
            ),
        ]
        text = (
            f"For {WITHIN[race.column]} on {race.scene} {first.way.label} at {first.way.setting} is "
            f"{'among ' if race.cheapest[1:] else ''}the cheapest; it takes {plain(times_ms[0])} ms"
            f"{first.way.without(race.column)}"
        )
        if others and (times := race.ratios.get(others[0].way.label)):
            text += f"; next is {others[0].way.label}, {times.in_words}{others[0].way.without(race.column)}"
            numbers.append(Number(times.median, "times", times.low, times.high))
        yield Finding(f"{text}.", name, numbers)


def _between(values: Sequence[float]) -> str:
    return " to ".join(dict.fromkeys(plain(end) for end in (min(values), max(values))))


def who_keeps_energy(arms: Sequence[Hidden]) -> Iterator[Finding]:
    """Yield which arms hide next to nothing of the energy in play, and which one most."""
    keep = [arm for arm in arms if arm.part <= HIDDEN_PART]
    if keep:
        yield Finding(
            f"Energy stays, to {100 * HIDDEN_PART:g} % of that in play, with "
            f"{listed(arm.label for arm in keep)}, on all scenes with contact that they finished; each "
            f"finished {min(arm.scenes for arm in keep)} or more of {keep[0].of_scenes} such scenes.",
            "energy-kept",
            [Number(100 * keep[-1].part, "%")],
        )
    if len(keep) < len(arms):
        worst = arms[-1]
        yield Finding(
            f"On {worst.worst_scene} {worst.label} makes or takes {plain(100 * worst.part)} % of it, the "
            f"most of all arms on {worst.of_scenes} scenes.",
            "energy-hidden",
            [Number(100 * worst.part, "%")],
        )


def what_not_to_trust(studies: Mapping[str, Results], horizons: Mapping[str, float]) -> Iterator[Finding]:
    """Yield from when on nobody's motion means anything, and who reports success where it is wrong."""
    if horizons:
        scene, turns = next(iter(horizons.items()))
        others = f"; on {len(horizons) - 1} more at the latest after {plain(max(horizons.values()))}"
        yield Finding(
            f"Trust no single motion for long: on {scene} a start moved by a hair has the slider off by "
            f"{LOST_IN_WORDS} after {plain(turns)} revolutions"
            + (others if len(horizons) > 1 else "")
            + "; past that only averages can be right.",
            "horizon",
            [Number(count, "revolutions") for count in horizons.values()],
        )
    if "extremes" in studies:
        runs = answers(studies["extremes"].rows)
        bare = runs["unguarded"].where(runs["unguarded"].notna(), runs["verdict"])
        wrong = bare.isin((Verdict.WRONG, Verdict.NOTICED)).groupby(runs["label"], observed=True).sum()
        if wrong.max() > 0:
            cases = runs["scene"].nunique()
            asked = runs[runs["told_by"] != MODEL].groupby("label", observed=False)["scene"].nunique()
            never = wrong.index[(wrong == 0) & (asked.reindex(wrong.index) == cases)]
            yield Finding(
                f"Check every run: on {cases} hard cases {wrong.idxmax()} reports success {wrong.max()} "
                "times although motion, energy or joints are off by more than ten times their bounds"
                + (f"; {listed(never)}, asked in all of them, never do" if len(never) else "")
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
    yield from not_installed(timed.rows) if timed else ()
    yield (
        "Truth is the exact solution of each engine's own model: how well rigid links, planar motion and a "
        "dry contact law describe a machine is not asked, nor anything of bending, lubrication, heat or wear."
    )
    if not any(name in studies for name in ("energy", "extremes", "predictability")):
        yield "Nothing here tells of energy over long runs, of hard cases, or of how long a motion is known."
