"""The energy study: how well each configuration keeps the energy balance, and how its constraints drift.

The energy-balance error of a run is what bodies and contacts store, less what driver and loads give, plus
what contacts dissipate: zero if exact, positive where the method gains energy. Numerical dissipation is the
rate at which the method loses energy, in W: the negative of the rows' hidden power. The energy in play is the
largest of kinetic energy, change of potential energy, and the works of driver and loads.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import pandas as pd

from reports.parts import Chapter, Figure, Finding, Number, Studies, Table
from reports.plots.energy_balance import TERMS, balance_drawing
from reports.plots.panels import MOST_LINES, against, draw
from reports.quantities import finished, knobs, tolerances
from reports.results import Results, with_columns
from reports.shared_tables import head, order_cells, reliability, runs_tables
from reports.style import axis_label, labels
from reports.tables import ABSENT, listed, number, on_scenes, setting

STUDY = "energy"
INTRODUCTION = (
    "The energy-balance error is what energy stored, work of driver and loads, and contact losses, all of an "
    "engine's own motion and forces, do not add up to. Numerical dissipation is the rate of its loss."
)
#: The column of the largest energy-balance error of a run, as a part of its energy in play.
UNACCOUNTED = "unaccounted_energy_part"
#: Up to this part an energy balance counts as kept: a hundredth of what contacts dissipate, or less.
KEPT = 1e-4
#: A run whose error is above this part of the energy in play shows no order of convergence.
FAR_OFF = 0.01
#: How far an exponent of time may be from the whole number that theory gives, and still be that.
EXPONENT = 0.1
#: How names of scenes end whose runs are longer than those of the scene named before it.
LONGER = r"-(?:long|\d+-turns)$"
#: The configurations of the reference of which theory says how constraints drift.
PLAIN, BAUMGARTE, PROJECTED = "reference (none)", "reference (Baumgarte)", "reference (projection)"
#: The table on the page has no more scenes than these, and half widths from this part of their number on.
MOST_SCENES, NARROW = 6, 0.01


@dataclass(frozen=True)
class EnergyPart:
    """The largest energy-balance error of a configuration, as a ``part`` of the energy in play, >= 0.

    It is that of the worst of the ``scenes`` (how many) that the configuration finished; any configuration
    finished ``of_scenes``. Its runs are ``fewest_turns`` to ``most_turns`` revolutions long.
    """

    engine: str
    label: str
    setting: str
    part: float
    scenes: int
    of_scenes: int
    fewest_turns: float
    most_turns: float


def energy_parts(rows: pd.DataFrame) -> list[EnergyPart]:
    """Return the largest energy-balance error of each configuration at the middle setting, the least first.

    ``rows`` are the study's, or those of some of its scenes, such as ``rows[has_contact(rows)]``.
    """
    ran = finished(at_middle(prepared(rows))).dropna(subset=UNACCOUNTED)
    parts = []
    for label, of in ran.groupby("label", observed=True):
        values, engine = of["tolerance"].fillna(of["step_s"]), str(of["engine"].iloc[0])
        at = setting(of["knob"].iloc[0], values.min(), values.max())
        scenes = of["scene"].nunique(), ran["scene"].nunique()
        turns = float(of["turns"].min()), float(of["turns"].max())
        part = float(of[UNACCOUNTED].max())
        parts.append(EnergyPart(engine, str(label), at, part, *scenes, *turns))
    return sorted(parts, key=lambda each: each.part)


def has_contact(rows: pd.DataFrame) -> pd.Series:
    """Return of each row whether its scene has contacts, which dissipate, by any run on it."""
    dissipates = with_columns(rows, "dissipated_power_W")["dissipated_power_W"].notna()
    return dissipates.groupby(rows["scene"]).transform("any")


def prepared(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with what the chapter asks of them.

    ``tolerance`` is that of a method that chooses its steps, NaN of others; ``knob`` names what resolves a
    run. ``half_width_W`` is half of the 95 % confidence interval of the numerical dissipation, ``resolved``
    whether that leaves zero out; ``contact`` is whether the scene has contacts, ``kind`` its name without an
    ending that tells the length.
    """
    rows = with_columns(
        rows,
        *("hidden_power_W", "hidden_power_low_W", "hidden_power_high_W", "turns"),
        *("stabilisation_power_W", UNACCOUNTED, "driver_work_J"),
        *("largest_numerical_gain_J", "energy_balance_residual_J"),
        *("constraint_violation_m", "constraint_violation_exponent"),
        *("constraint_speed_m_s", "constraint_speed_exponent"),
    )
    half_width_W = (rows["hidden_power_high_W"] - rows["hidden_power_low_W"]) / 2
    return rows.assign(
        tolerance=tolerances(rows),
        knob=knobs(rows),
        dissipation_W=-rows["hidden_power_W"],
        half_width_W=half_width_W,
        resolved=rows["hidden_power_W"].abs() > half_width_W,
        contact=has_contact(rows),
        kind=rows["scene"].str.replace(LONGER, "", regex=True),
    )


def at_middle(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows at the middle one of their scene's settings, numbered from coarse to fine."""
    numbers = {scene: sorted(of.unique()) for scene, of in rows.groupby("scene")["rung"]}
    middle = {scene: each[len(each) // 2] for scene, each in numbers.items()}
    return rows[rows["rung"] == rows["scene"].map(middle)]


def shortest(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of scenes that are not longer runs of another scene that is there."""
    return rows[(rows["kind"] == rows["scene"]) | ~rows["kind"].isin(rows["scene"])]


def findings(studies: Studies) -> Iterator[Finding]:
    """Yield how the reference's constraints drift, which theory says, and how many runs finished."""
    rows = prepared(studies[STUDY].rows)
    yield from drift(rows)
    yield reliability(rows)


def drift(rows: pd.DataFrame) -> Iterator[Finding]:
    """Yield, checked, how the reference's constraints drift on ideal joints, by their stabilisation."""
    rows = finished(rows[~rows["contact"]])
    free, bounded, projected = (rows[rows["label"] == label] for label in (PLAIN, BAUMGARTE, PROJECTED))
    names = ["constraint_violation_exponent", "constraint_speed_exponent"]
    grows, stays = (of[names].dropna() for of in (free, bounded))
    if len(grows):
        off = (grows - [2, 1]).abs().max()
        yield Finding(
            "drift",
            f"Without stabilisation the reference's constraints drift as theory predicts for RK4 "
            f"{on_scenes(free['scene'][grows.index].nunique())}: gap speeds grow in proportion to time, gaps "
            "with its square. The exponents are within {speed} of 1 and within {gap} of 2.",
            gap=Number(off[names[0]]),
            speed=Number(off[names[1]]),
        ).require(bool((off < EXPONENT).all()))
    told, values, holds = [], {}, True
    if len(stays):
        largest = max(0.0, float(stays.max(axis=None)))
        told.append("with Baumgarte's stabilisation exponents of time are at most {exponent}")
        values["exponent"], holds = Number(largest), largest < EXPONENT
    if len(projected):
        told.append("with projection gaps are round-off, at most {gap}")
        values["gap"] = Number(projected["constraint_violation_m"].max(), "m")
        holds = holds and bool(projected[names[0]].isna().all())
    if told:
        yield Finding("drift-bounded", f"Stabilisation bounds the drift: {listed(told)}.", **values).require(
            holds
        )


def figures(studies: Studies) -> Iterator[Figure | None]:
    """Yield the energy balance over time, and its error against the step."""
    results, rows = studies[STUDY], prepared(studies[STUDY].rows)
    longest = rows["end_time_s"] == rows.groupby("kind")["end_time_s"].transform("max")
    ran = finished(at_middle(rows[longest]))
    if results.has_curves:
        yield _balance(results, ran[ran["contact"] & ran["driver_work_J"].notna()])
    yield _by_step(rows)


def _balance(results: Results, rows: pd.DataFrame) -> Figure | None:
    """Return the energy balance over time on the scene where most of it is not accounted for.

    Of more configurations than fit, the first of each engine are shown and those that are the furthest off.
    """
    if rows[UNACCOUNTED].isna().all():
        return None
    scene = rows["scene"][rows[UNACCOUNTED].idxmax()]
    later = rows[rows["scene"] == scene]
    later = later.assign(later=later["engine"].duplicated())
    shown = later.sort_values(["later", UNACCOUNTED], ascending=[True, False]).head(MOST_LINES)
    reading = (
        f"On {scene}. Losses are stacked; the line is the work of driver and loads that is not stored. "
        "A line above the stack is energy that the method loses, one below it is energy that it gains."
    )
    drawing = balance_drawing(results, shown.sort_values("label"))
    return Figure("energy-balance", "Where does the driver's work go?", reading, STUDY, drawing)


def _by_step(rows: pd.DataFrame) -> Figure | None:
    """Return the largest energy-balance error against the mean step, a panel for each scene."""
    rows = rows[rows.groupby("scene")["rung"].transform("nunique") > 1]
    # A run that chooses its steps and did not finish has none to stand at.
    rows = shortest(rows[(rows["status"] == "ok") | rows["tolerance"].isna()])
    panels = against(rows, "largest_numerical_gain_J", orders=(1, 3, 5))
    panels = [
        replace(panel, x="mean step [s]", y="largest error of the\nenergy balance [J]") for panel in panels
    ]
    title = "How does the energy-balance error fall with the step?"
    reading = "Grey lines have the slope of the order written at their left end."
    return Figure("energy-error-by-step", title, reading, STUDY, draw(panels)) if panels else None


def tables(studies: Studies) -> Iterator[Table | None]:
    """Yield numerical dissipation on the page, and as files all numbers of energy balance and drift."""
    rows = prepared(studies[STUDY].rows)
    middle = at_middle(rows)
    yield dissipation_by_scene(middle)
    yield dissipation_table(middle, rows)
    yield from (ledger_table(of_scene) for _, of_scene in middle.groupby("scene"))
    yield drift_table(middle, rows)
    yield from runs_tables(rows, STUDY)


def dissipation_by_scene(middle: pd.DataFrame) -> Table:
    """Return the numerical dissipation by configuration and scene, of rows at the middle setting."""
    rows = shortest(middle)
    ran = (rows["status"] == "ok").groupby(rows["scene"]).sum().sort_values(ascending=False, kind="stable")
    rows = rows[rows["scene"].isin(ran.index[:MOST_SCENES])]
    narrow = rows["half_width_W"] < NARROW * rows["dissipation_W"].abs()
    half = (" ± " + rows["half_width_W"].map(number)).mask(~rows["resolved"] | narrow, "")
    cells = (_resolved(rows) + half).where(rows["status"] == "ok", rows["status"])
    shown = rows.assign(label=rows["label"].astype(str), cell=cells)
    by_scene = shown.pivot_table("cell", "label", "scene", aggfunc="first").reindex(labels(rows))
    return Table.of(
        "energy-dissipation-by-scene",
        "Numerical dissipation in W, at the middle setting of each series",
        "Negative where the method gains energy. ± is half of the 95 % interval, left out below 1 %; “< x” "
        "is not resolved from zero.",
        STUDY,
        {"configuration": list(by_scene.index), **by_scene.fillna(ABSENT)},
    ).on_page()


def dissipation_table(middle: pd.DataFrame, rows: pd.DataFrame) -> Table:
    """Return the numerical dissipation at the ``middle`` setting, and orders of errors over all settings."""
    near = rows[UNACCOUNTED] <= FAR_OFF
    sized = rows.assign(
        size=rows["dissipation_W"].abs().where(rows["resolved"] & near),
        gain=rows["largest_numerical_gain_J"].where(near),
    )
    cells = {
        "numerical dissipation [W]": _resolved(middle),
        "± [W]": middle["half_width_W"].map(number),
        "order of the dissipation": order_cells(middle, sized, "size", "too few points"),
        "of it stabilisation [W]": (-middle["stabilisation_power_W"]).map(number),
        "largest error, of the energy in play": middle[UNACCOUNTED].map(number),
        "order of the largest error": order_cells(middle, sized, "gain", "too few points"),
    }
    reading = "The slope of the energy-balance error over time (Theil and Sen), ± half of its 95 % interval."
    title = "Numerical dissipation at the middle setting"
    return Table.of("energy-numerical-dissipation", title, reading, STUDY, _columns(middle, cells))


def ledger_table(middle: pd.DataFrame) -> Table:
    """Return the terms of the energy balance at the end of a scene's runs: those that its scene has."""
    scene, present = middle["scene"].iloc[0], middle.columns[middle.notna().any()]
    terms = [name for end in TERMS for name in present if name.endswith(end)]
    cells = {axis_label(name): middle[name].map("{:.6g}".format).replace("nan", ABSENT) for name in terms}
    cells["residual [J]"] = middle["energy_balance_residual_J"].map(number)
    columns = _columns(middle, cells).drop(columns=["scene", "mean step [s]"])
    title, reading = f"Energy balance on {scene} at the middle setting", "Residual: changes - works + losses."
    return Table.of(f"energy-ledger-{scene}", title, reading, STUDY, columns)


def drift_table(middle: pd.DataFrame, rows: pd.DataFrame) -> Table:
    """Return the largest gaps and gap speeds, how they grow with time, and their order in the step."""
    cells = {}
    for what, unit, name in (("gap", "m", "constraint_violation"), ("gap speed", "m/s", "constraint_speed")):
        column, exponent = f"{name}_{unit.replace('/', '_')}", middle[f"{name}_exponent"]
        order, grows = order_cells(middle, rows, column), exponent.notna()
        cells[f"largest {what} [{unit}]"] = middle[column].map(number)
        cells[f"{what}, exponent of time"] = exponent.abs().map("{:.2f}".format).where(grows, ABSENT)
        cells[f"{what}, order in the step"] = order.where(grows, ABSENT)
    reading = f"Exponent 0: bounded; 1: in proportion to time. {ABSENT}: round-off, or a scene with impacts."
    title = "Drift of the constraints at the middle setting"
    return Table.of("energy-drift", title, reading, STUDY, _columns(middle, cells))


def _resolved(rows: pd.DataFrame) -> pd.Series:
    """Return the numerical dissipation, or below what its size is if it is not resolved from zero."""
    below = "< " + (rows["dissipation_W"].abs() + rows["half_width_W"]).map(number)
    return rows["dissipation_W"].map(number).where(rows["resolved"], below)


def _columns(rows: pd.DataFrame, cells: Mapping[str, pd.Series]) -> pd.DataFrame:
    """Return what was run and the cells, the status in those of runs that did not finish.

    An unfinished run that chooses its steps has no mean step.
    """
    ok = rows["status"] == "ok"
    steps = rows["mean_step_s"].where(ok | rows["tolerance"].isna()).map(number)
    case = {**head(rows, "scene"), "mean step [s]": steps, **head(rows, "engine", "arm")}
    return pd.DataFrame({**case, **{name: of.where(ok, rows["status"]) for name, of in cells.items()}})


CHAPTER = Chapter(STUDY, "Energy", (STUDY,), INTRODUCTION, findings, figures, tables)
