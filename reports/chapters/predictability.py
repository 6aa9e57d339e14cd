"""Predictability: how fast small changes grow, where the motion is chaotic, and whether ensembles agree."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure as Drawing

from reports.analysis import ensembles, sweeps
from reports.analysis.ensembles import PERCENT, PLANTED, QUANTITIES, STUDY, Ensembles, Pair, with_half_width
from reports.analysis.statistics import EQUIVALENT, TOO_FEW, VERDICTS, Interval, student_interval
from reports.parts import Chapter, Figure, Finding, Number, Studies, Table, View
from reports.plots.maps import draw_basins, draw_map
from reports.plots.panels import Line, Panel, draw, grid, so_far
from reports.plots.series import mark
from reports.plots.sweeps import draw_over_field, explain
from reports.quantities import finished
from reports.results import FloatArray, Results, with_columns
from reports.shared_tables import reliability, runs_tables
from reports.style import BLACK, BLUE, GREY, RC, VERMILLION
from reports.tables import ABSENT, listed

INTRODUCTION = (
    "Small changes of the start grow in a mechanism with clearance. Up to the predictability horizon runs "
    "are compared at equal times, beyond it as ensembles, whose members start at different crank angles."
)
#: The parts of the study that follow small changes, as the column ``part`` has them.
HORIZON, EXPONENT = "horizon", "Lyapunov exponent"
#: Tolerances of the horizon: the words in the names of columns, and in m.
TOLERANCES = {"1nm": ("1 nm", 1e-9), "1um": ("1 µm", 1e-6), "100um": ("100 µm", 1e-4)}
#: A slider that is off by this much is no longer predicted; runs that stay closer, in m, do not diverge.
LOST, TOGETHER_M = "100um", 1e-9
#: Nothing closer than this is drawn, in m: it is round-off.
LEAST_M = 1e-14
#: How Matplotlib is told of a line.
Style = dict[str, Any]

#: Exponents of a start, and the part of the run that each is from, by the ends of columns.
PER_REVOLUTION = "lyapunov_exponent_per_revolution"
RUN_PARTS = {"_quarter": "the first quarter", "_half": "the first half", "": "all"}
#: An axis of differences ends here, in margins.
REACH = 4.0

# Horizons and exponents


def horizons(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the finished row of each scene that was followed the longest, with every horizon's column."""
    kinds = ("{}", "{}_least", "{}_largest", "halved_{}")
    columns = [f"horizon_{kind.format(tolerance)}_s" for tolerance in TOLERANCES for kind in kinds]
    rows = with_columns(finished(rows[rows["part"] == HORIZON]), "revolutions", *columns)
    longest = rows.sort_values("end_time_s", ascending=False, kind="stable").drop_duplicates("scene")
    return longest.sort_values("scene").fillna({"revolutions": 0.0})


def horizon_turns(rows: pd.DataFrame) -> dict[str, float]:
    """Return by scene after how many crank revolutions a small change has the slider off by ``LOST``.

    The shortest is first. Scenes without revolutions, or on which nothing grows that far, are left out.
    """
    rows = horizons(rows)
    turns = (rows[f"horizon_{LOST}_s"] * rows["revolutions"] / rows["end_time_s"]).set_axis(rows["scene"])
    return {str(scene): float(count) for scene, count in turns[turns > 0].sort_values().items()}


def _horizon_finding(rows: pd.DataFrame) -> Finding | None:
    """Return how soon a small change matters, and where it never grows."""
    turns, rows = horizon_turns(rows), horizons(rows).set_index("scene", drop=False)
    if rows.empty:
        return None
    tolerance, values = TOLERANCES[LOST][0], {"moved": Number(rows["perturbation_rad"].iloc[0], "rad")}
    text = f"No {{moved}} change of the initial crank angle grows to {tolerance} before the runs end"
    if turns:
        first, *_, last = (*turns, *turns)
        text = (
            "A {moved} change of the initial crank angle grows to "
            f"{tolerance} in {{first}} revolutions on {first}, in the median of the changes"
        )
        values["first"] = _turns(rows.loc[first], turns[first])
        if last != first:
            text += f", and in {{last}} on {last}, the longest of {len(turns)} scenes"
            values["last"] = _turns(rows.loc[last], turns[last])
        text += "; beyond that compare statistics only"
    together = rows[rows.filter(regex="^horizon_").isna().all(axis=1)]
    if together.empty:
        return Finding("horizon", f"{text}.", **values)
    largest = together[["largest_distance_perturbed_m", "largest_distance_halved_m"]].max(axis=None)
    values["largest"] = Number(largest, "m")
    text += f". No distance exceeds {{largest}} on {listed(together['scene'])}"
    return Finding("horizon", f"{text}.", **values).require(largest < TOGETHER_M)


def _turns(row: pd.Series, turns: float) -> Number:
    """Return a scene's horizon in revolutions, with the first and the last of its perturbed runs."""
    ends = row[[f"horizon_{LOST}_{end}_s" for end in ("least", "largest")]]
    ends = ends * row["revolutions"] / row["end_time_s"]
    low, high = (None if np.isnan(end) else float(end) for end in ends)
    return Number(turns, "", None if low is None else min(low, turns), high)


def _growth(results: Results, row: pd.Series) -> Panel:
    """Return how far perturbed runs on a scene are from the unperturbed one."""
    turns = row["revolutions"]
    unit_s = row["end_time_s"] / turns if turns > 0 else 1.0
    names = [f"perturbed_{k}_m" for k in range(int(row["perturbations"]))]
    time = results.curve(row["case"], "time_s") / unit_s
    each = np.array([so_far(results.curve(row["case"], name)) for name in names])
    curves: dict[str, tuple[FloatArray, Style]] = {
        "perturbed start (median)": (np.median(each, axis=0), {"color": BLACK}),
        "perturbed start (smallest)": (each.min(axis=0), {"color": GREY, "linewidth": 0.7}),
        "perturbed start (largest)": (each.max(axis=0), {"color": GREY, "linestyle": ":"}),
        "half the step": (so_far(results.curve(row["case"], "halved_m")), {"color": BLUE, "linestyle": "--"}),
    }
    lines = [Line(name, time, np.maximum(of, LEAST_M), style) for name, (of, style) in curves.items()]
    marker = {"color": VERMILLION, "marker": "D", "markersize": 4, "linestyle": ""}
    for words, (tolerance, size_m) in TOLERANCES.items():
        median, least, most = (row[f"horizon_{words}{end}_s"] for end in ("", "_least", "_largest"))
        if not np.isnan(least):
            ends = np.array([least, row["end_time_s"] if np.isnan(most) else most])
            bar = {"color": VERMILLION, "linewidth": 2.0}
            lines.append(Line("first to last horizon", ends / unit_s, [size_m] * 2, bar))
            lines.append(Line("horizon (median)", [median / unit_s], [size_m], marker, [tolerance]))
    x = "crank revolutions" if turns > 0 else "time [s]"
    return Panel(str(row["scene"]), x, "largest distance so far [m]", lines, log="y")


def _horizon_table(rows: pd.DataFrame) -> Table:
    turns = rows["revolutions"].map("{:.0f} revolutions".format)
    cells = {
        "scene": rows["scene"],
        "length of the run": turns.where(rows["revolutions"] > 0, rows["end_time_s"].map("{:g} s".format)),
    }
    for words, (tolerance, _) in TOLERANCES.items():
        median, least, most = (
            rows[f"horizon_{words}{end}_s"].map(_milliseconds) for end in ("", "_least", "_largest")
        )
        text = median + " (" + least + " to " + most.where(most != ABSENT, "later") + ")"
        cells[f"{tolerance}: perturbed [ms]"] = text.where(least != ABSENT, ABSENT)
        cells[f"{tolerance}: step halved [ms]"] = rows[f"horizon_halved_{words}_s"].map(_milliseconds)
    reading = (
        "Time at which the slider deviates by a tolerance: median, first and last over perturbed starts, "
        "and with half the step. A dash: not before the run ends."
    )
    return Table.of(f"{STUDY}-horizons", "Predictability horizons", reading, STUDY, cells)


def _milliseconds(time_s: float) -> str:
    return ABSENT if np.isnan(time_s) else f"{float(f'{1e3 * time_s:.3g}'):g}"


def exponents(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the finished starts of each scene whose exponent was sought."""
    rows = with_columns(rows, "settled", *(PER_REVOLUTION + part for part in RUN_PARTS))
    return dict(iter(finished(rows[rows["part"] == EXPONENT]).groupby("scene")))


def _exponent(starts: pd.DataFrame, part: str = "") -> Interval | None:
    """Return the mean exponent over starts, from a part of their runs; None for fewer than two."""
    values = starts[PER_REVOLUTION + part].dropna().to_numpy(dtype=float)
    return student_interval(values) if len(values) > 1 else None


def motion(starts: pd.DataFrame) -> str:
    """Return what the exponents of a scene's starts say of its motion."""
    settled = int(starts["settled"].eq(True).sum())
    if settled:
        every = settled == len(starts)
        return "settles to continuous contact" if every else "not decided, because some starts settle"
    whole, half = _exponent(starts), _exponent(starts, "_half")
    if whole is None or half is None or starts[PER_REVOLUTION].isna().any():
        return "not decided, because starts were not followed to the end"
    if whole.low > half.high or half.low > whole.high:
        return "exponent not converged"
    return "chaotic" if whole.low > 0 else "exponent not told from zero"


def _exponent_finding(by_scene: Mapping[str, pd.DataFrame]) -> Finding | None:
    """Return on which scenes the motion is chaotic, and what is known of the others."""
    scenes: dict[str, list[str]] = {}
    for scene, starts in by_scene.items():
        scenes.setdefault(motion(starts), []).append(scene)
    if not scenes:
        return None
    chaotic, values = scenes.pop("chaotic", []), dict[str, Number]()
    for k, mean in enumerate(_exponent(by_scene[scene]) for scene in chaotic):
        assert mean is not None, "what is chaotic has an exponent"
        values[f"n{k}"] = Number(mean.mean, "", mean.low, mean.high)
    parts = [f"{scene} ({{n{k}}})" for k, scene in enumerate(chaotic)]
    where = listed(parts) if parts else "no scene"
    text = f"The motion is chaotic, by a converged positive Lyapunov exponent per revolution, on {where}"
    others = "".join(f". {what.capitalize()}: {listed(of)}" for what, of in scenes.items())
    return Finding("lyapunov-exponents", f"{text}{others}.", **values)


def _exponent_table(by_scene: Mapping[str, pd.DataFrame]) -> Table:
    cells: dict[str, list[str]] = {}
    for scene, starts in by_scene.items():
        row = {"scene": scene, "starts": str(len(starts)), "settled": str(starts["settled"].eq(True).sum())}
        row["revolutions"] = f"{starts['revolutions'].max():.0f}"
        for part, words in RUN_PARTS.items():
            row[f"exponent from {words}"] = with_half_width(_exponent(starts, part))
        for name, cell in {**row, "motion": motion(starts)}.items():
            cells.setdefault(name, []).append(cell)
    reading = (
        "Finite-time exponents per revolution by Benettin's method, from parts of the run: means over starts "
        "with half of Student's 95 % interval. Chaotic: above zero, and the same from half of the run."
    )
    return Table.of(f"{STUDY}-exponents", "Lyapunov exponents", reading, STUDY, cells)


# Ensembles


def _ensemble_finding(by_scene: Mapping[str, Ensembles]) -> Finding | None:
    """Return the verdicts on all ensembles; that with less clearance must not be called equivalent."""
    scenes: dict[str, dict[str, int]] = {word: {} for word in VERDICTS}
    count, seen = 0, True
    for by_label in by_scene.values():
        for pair in ensembles.pairs(by_label):
            scenes[pair.verdict][pair.label] = scenes[pair.verdict].get(pair.label, 0) + 1
            count += 1
            if pair.label == PLANTED:
                seen &= pair.verdict != EQUIVALENT
    if not count:
        return None
    said = [
        f"{word}: {listed(f'{label} on {on}' if len(by_scene) > 1 else label for label, on in of.items())}"
        for word, of in scenes.items()
        if of
    ]
    on = f"on {len(by_scene)} scenes" if len(by_scene) > 1 else f"on {next(iter(by_scene))}"
    text = (
        f"{{equivalent}} of {{count}} ensembles {on} are equivalent to the reference implementation's by two "
        f"one-sided tests ({'; '.join(said)})."
    )
    values = {"equivalent": Number(float(sum(scenes[EQUIVALENT].values()))), "count": Number(float(count))}
    return Finding("ensembles", text, **values).require(seen)


def _differences(found: Sequence[Pair]) -> Drawing:
    """Return the differences of all quantities in units of their margins, a panel for each ensemble."""
    drawing, axes = grid(len(found), height_in=2.4)
    for ax, pair in zip(axes, found, strict=True):
        ax.axvspan(-1, 1, color=GREY, alpha=0.25, linewidth=0)
        words = [QUANTITIES[name].split(" [")[0] for name in pair.quantities]
        if pair.verdict != TOO_FEW:
            mean, low, high = (np.clip(each, -REACH, REACH) for each in pair.differences)
            places = np.arange(len(words))
            ends = zip(words, pair.differences.low, pair.differences.high, strict=True)
            notes = [f"{name}: {least:.2f} to {most:.2f} margins" for name, least, most in ends]
            mark(ax.plot(mean, places, "o", color=BLACK), pair.label, notes)
            ax.hlines(places, low, high, color=BLACK, linewidth=1.6)
        spec = ax.get_subplotspec()
        ax.set_yticks(range(len(words)), words if spec is None or spec.is_first_col() else [])
        ax.set(
            xlim=(-1.03 * REACH, 1.03 * REACH), ylim=(len(words) - 0.5, -0.5), xlabel="difference / margin"
        )
        ax.set_title(f"{pair.label}:\n{pair.verdict}", fontsize=8)
    return drawing


# Sweeps over clearance and crank speed


def _diagram_finding(results: Results) -> Finding | None:
    """Return where the motion over clearance and over speed is chaotic by exponents that have converged."""
    said, values = [], dict[str, Number]()
    for part, unit in ((sweeps.OVER_CLEARANCE, "m"), (sweeps.OVER_SPEED, "rad/s")):
        members = sweeps.members(results, part)
        if members is None:
            continue
        chaotic = sweeps.chaotic(members)
        at = members.loc[chaotic.index[chaotic], sweeps.FIELDS[part]]
        name = sweeps.VARIED[part].replace(" ", "_")
        values |= {f"{name}_chaotic": Number(float(len(at))), f"{name}_all": Number(float(len(chaotic)))}
        text = f"over {sweeps.VARIED[part]} at {{{name}_chaotic}} of {{{name}_all}} values"
        if len(at):
            values |= {f"{name}_low": Number(at.min(), unit), f"{name}_high": Number(at.max(), unit)}
            text += f", from {{{name}_low}} to {{{name}_high}}"
        said.append(text)
    text = "The Lyapunov exponent has converged and is above 1 per revolution "
    return Finding("diagrams", f"{text}{'; '.join(said)}.", **values) if said else None


def _diagrams(results: Results) -> Iterator[View]:
    """Yield the strobe and the exponent over each field that was varied."""
    for part, varied in sweeps.VARIED.items():
        members = sweeps.members(results, part)
        if members is None:
            continue
        field = sweeps.FIELDS[part]
        picture = draw_over_field(members, field, ["strobe_m", sweeps.EXPONENT])
        if part != sweeps.CHAIN:
            (line,) = (each for each in picture.axes[1].get_lines() if each.get_linestyle() == "None")
            measured = members.dropna(subset=[sweeps.EXPONENT])
            style: Style = {"color": BLUE, "fillstyle": "none", "markersize": 4, "zorder": 1}
            (half,) = picture.axes[1].plot(line.get_xdata(), measured[sweeps.HALF], "o", **style)
            line.set(markersize=5, label="exponent from all revolutions")
            half.set(label="from half of them")
            explain(picture, [line, half])
            for each in (line, half):
                mark([each], str(each.get_label()))
        yield View((varied,), picture)


def _maps(results: Results) -> Iterator[View]:
    """Yield the maps of exponent and force over clearance and speed, and of the motion over the start."""
    if (members := sweeps.members(results, sweeps.MAP)) is not None:
        fields = (sweeps.CLEARANCE, sweeps.SPEED)
        yield View(("Lyapunov exponent",), draw_map(members, fields, sweeps.EXPONENT))
        yield View(("largest contact force",), draw_map(members, fields, sweeps.FORCE))
    if (members := sweeps.members(results, sweeps.BASINS)) is not None:
        yield View(("motion by the start of the slider",), draw_basins(members, sweeps.START))


# The chapter


def findings(studies: Studies) -> Iterator[Finding]:
    """Yield what the study found."""
    results = studies[STUDY]
    rows = ensembles.prepared(results.rows)
    found = (
        _horizon_finding(rows),
        _exponent_finding(exponents(rows)),
        _ensemble_finding(ensembles.by_scene(rows)),
        _diagram_finding(results) if results.has_curves else None,
    )
    yield from (each for each in found if each is not None)
    yield reliability(rows)


def figures(studies: Studies) -> Iterator[Figure | None]:
    """Yield the figures; those of curves where the study has them."""
    results = studies[STUDY]
    rows = ensembles.prepared(results.rows)
    with mpl.rc_context(RC):
        if results.has_curves and len(followed := horizons(rows)):
            yield Figure.of(
                f"{STUDY}-growth",
                "How fast does a small change of the start grow?",
                "Distance of the slider from the unperturbed run, the largest up to each time. Diamonds mark "
                "the horizons of 1 nm, 1 µm and 100 µm, bars the first and the last of all perturbed starts.",
                STUDY,
                draw([_growth(results, row) for _, row in followed.iterrows()], height_in=2.3),
            )
        if results.has_curves and (views := tuple(_diagrams(results))):
            yield Figure(
                f"{STUDY}-diagram",
                "Where does the motion repeat, and where is it chaotic?",
                "Above: the slider's deviation from ideal joints once a turn, after a transient. Below: the "
                "finite-time Lyapunov exponent per revolution, positive where neighbouring motions diverge.",
                STUDY,
                views,
                ("varied",),
            )
        by_scene = {
            scene: found for scene, of in ensembles.by_scene(rows).items() if (found := ensembles.pairs(of))
        }
        if by_scene:
            yield Figure(
                f"{STUDY}-ensembles",
                "Do ensembles have the same statistics beyond the horizon?",
                "Differences of means from the reference implementation's, in units of the margin, with "
                f"{PERCENT} intervals. Equivalent: all lie in the grey band; the axis is cut at {REACH:g}.",
                STUDY,
                tuple(View((scene,), _differences(found)) for scene, found in by_scene.items()),
                ("scene",),
            )
        if results.has_curves and (views := tuple(_maps(results))):
            yield Figure(
                f"{STUDY}-maps",
                "How do exponent and force depend on clearance and speed, and the motion on the start?",
                "A cell is a member. Motions are told apart by the slider once a turn.",
                STUDY,
                views,
                ("shown",),
                more=True,
            )


def tables(studies: Studies) -> Iterator[Table | None]:
    """Yield horizons and exponents, the ensembles of each scene, settings and failures."""
    rows = ensembles.prepared(studies[STUDY].rows)
    if len(followed := horizons(rows)):
        yield _horizon_table(followed).on_page()
    if by_scene := exponents(rows):
        yield _exponent_table(by_scene).on_page()
    for scene, by_label in ensembles.by_scene(rows).items():
        yield ensembles.means_table(by_label, scene)
        if found := ensembles.pairs(by_label):
            yield ensembles.tests_table(found, scene)
    yield from runs_tables(rows, STUDY)


CHAPTER = Chapter(STUDY, "Predictability", (STUDY,), INTRODUCTION, findings, figures, tables)
