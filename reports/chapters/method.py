"""Method: the mechanism with its symbols, the contact laws, and what names of configurations mean."""

import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd

from engine_models.arms import AS_IT_COMES, MEANINGS
from reports.parts import Chapter, Figure, Finding, Studies, Table
from reports.plots.mechanism import Scene, draw_mechanism
from reports.plots.panels import Line, Panel, draw
from reports.quantities import finished
from reports.results import Results, with_columns
from reports.shared_tables import runs_tables, settings_table
from reports.style import BLUE, GREY, RC, VERMILLION, in_legend_order

STUDY = "motions"
#: The chapter is of all studies.
STUDIES = (
    *(STUDY, "agreement", "clearance", "work-precision", "energy"),
    *("predictability", "stability", "extremes"),
)
#: The law without loss, which is drawn behind the others.
LOSSLESS = "hertz"
DEPTH, FORCE = "contact_B_penetration_m", "contact_B_normal_force_N"
UM, KN = 1e6, 1e-3


def crank_slider(rows: pd.DataFrame) -> Scene | None:
    """Return the crank-slider whose impact was run, as its file has it."""
    scenes = finished(with_columns(rows[rows["view"] == "impact"], "scene_json"))["scene_json"].dropna()
    return json.loads(scenes.iloc[0]) if len(scenes) else None


def _laws(results: Results) -> Figure | None:
    """Return force over penetration in the first impact under each contact law, by the energy lost."""
    rows = finished(results.rows[results.rows["view"] == "law"])
    if rows.empty:
        return None
    rows = rows.sort_values("dissipated_energy_J")
    lossless = [
        replace(line, label="without loss", style={"color": GREY, "linewidth": 0.8})
        for line in _ways(results, rows[rows["law"] == LOSSLESS])
    ]
    panels = []
    for law, of_law in rows.groupby("law", sort=False):
        behind = lossless if law != LOSSLESS else []
        lines = [*behind, *_ways(results, of_law)]
        panels.append(Panel(str(law), "penetration [µm]", "contact force [kN]", lines, log=""))
    restitution = rows["restitution"].dropna()
    at = f" at restitution {restitution.iloc[0]:g}" if len(restitution) else ""
    return Figure(
        "motions-laws",
        "How do contact laws differ?",
        f"The first impact under each law{at}, by the reference implementation. The area of a loop is the "
        "energy lost, which grows from panel to panel.",
        STUDY,
        draw(panels, height_in=1.9),
    )


def _ways(results: Results, rows: pd.DataFrame) -> list[Line]:
    """Return the loading and the unloading of the first run among rows, up to and from the deepest point."""
    if rows.empty:
        return []
    case = rows["case"].iloc[0]
    depth, force = results.curve(case, DEPTH) * UM, results.curve(case, FORCE) * KN
    touching = np.flatnonzero(depth >= 0)
    deepest = int(depth.argmax())
    ways: dict[str, tuple[Any, dict[str, Any]]] = {
        "loading": (touching[touching <= deepest], {"color": VERMILLION}),
        "unloading": (touching[touching >= deepest], {"color": BLUE, "linestyle": "--"}),
    }
    return [Line(way, depth[places], force[places], style) for way, (places, style) in ways.items()]


def findings(_: Studies) -> Iterator[Finding]:
    """Yield nothing: the method is not found in rows."""
    yield from ()


def figures(studies: Studies) -> Iterator[Figure | None]:
    """Yield the mechanism, and the contact laws where the study has curves."""
    results = studies.get(STUDY)
    if results is None:
        return
    with mpl.rc_context(RC):
        if (scene := crank_slider(results.rows)) is not None:
            yield Figure(
                "motions-mechanism",
                "What is the mechanism, and what do the symbols mean?",
                "The crank-slider in proportion, and a joint, its clearance not to scale. Numbers "
                f"are those of {scene['name']}.",
                STUDY,
                draw_mechanism(scene),
            )
        yield _laws(results) if results.has_curves else None


def tables(studies: Studies) -> Iterator[Table | None]:
    """Yield what every configuration is, and the drawn runs that did not finish."""
    if studies:
        yield configurations(studies)
    if STUDY in studies:
        yield from runs_tables(studies[STUDY].rows, STUDY)


def configurations(studies: Studies) -> Table:
    """Return what each configuration of any study is, in a line, and what it sets."""
    rows = pd.concat([results.rows.astype({"label": str}) for results in studies.values()])
    rows = rows[rows["label"].isin(MEANINGS) | (rows["arm"] == AS_IT_COMES)].reset_index(drop=True)
    table = settings_table(rows.assign(label=in_legend_order(rows)), "")
    cells = [(f"{engine} ({arm})", settings) for engine, arm, settings in table.rows]
    lines = tuple((label, MEANINGS.get(label, ""), settings) for label, settings in cells)
    head = ("configuration", "what it is", table.head[-1])
    return Table("configurations", table.title, table.reading, "", head, lines).on_page()


CHAPTER = Chapter(
    "method",
    "Method",
    STUDIES,
    "How the mechanism is modelled, what results are compared with, and how errors and run times are taken.",
    findings,
    figures,
    tables,
)
