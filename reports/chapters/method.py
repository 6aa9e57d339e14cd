"""Method: the mechanism with its symbols, what names of configurations mean, and runs that did not finish."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from reports.look import in_legend_order
from reports.page import FINDINGS, Chapter, Claim, Figure, Part, Table, Text, versions
from reports.results import Studies, quality_failures, with_columns

HERE = Path(__file__).parent
#: Columns of a run that did not finish, or that fails the check after every run.
RUN = ["study", "scene", "label", "step_s", "status", "exception", "reason"]
INTRODUCTION = (
    "How the mechanism is modelled, what results are compared with, and how errors and run times are taken."
)


def parts(studies: Studies) -> Iterator[Part | None]:
    """Yield the mechanism, how many runs finished, what configurations are, and the runs that failed."""
    scenes = with_columns(studies["accuracy"].rows, "scene_json")["scene_json"].dropna()
    if len(scenes):
        title = "What is the mechanism, and what do the symbols mean?"
        caption = _numbers(json.loads(scenes.iloc[0]))
        yield Figure("mechanism", title, caption, "accuracy", HERE / "mechanism.svg")
    rows = pd.concat([results.rows.astype({"label": str}) for results in studies.values()], ignore_index=True)
    rows = with_columns(rows, *RUN).copy().assign(quality=quality_failures(rows))
    failed, failing = rows[rows["status"] != "ok"], rows[rows["quality"] != ""]
    text = "{finished} of {asked} runs finished; {failing} of those fail the check of energy and gaps."
    numbers = {"finished": len(rows) - len(failed), "asked": len(rows), "failing": len(failing)}
    yield Claim("reliability", text, {name: (count, "") for name, count in numbers.items()})
    yield configurations(rows, studies)
    for name, title, columns, of in (
        ("failures", "Runs that did not finish", RUN, failed),
        ("quality", "Finished runs that fail the check", [*RUN[:4], "quality"], failing),
    ):
        yield Table(name, title, "", "", of[columns].rename(columns={"label": "configuration"}), shown=False)
    yield _provenance(studies)
    told = f'<a href="{FINDINGS}">{FINDINGS}</a> has every claim with its numbers, units and intervals.'
    yield Text(f"{(HERE / 'method.html').read_text(encoding='utf-8')}<p>{told}</p>")


def _numbers(scene: Mapping[str, Any]) -> str:
    """Return the numbers of a scene; its row has the sections and fields of its file."""
    crank, rod, slider = (scene[name] for name in ("crank", "rod", "slider"))
    law = next(law for law in scene["clearance"].values() if law)
    lengths = {"r": crank["length_m"], "L": rod["length_m"]}
    lengths |= {"R": law["bearing_radius_m"], "c": law["radial_clearance_m"]}
    told = ", ".join(f"{name} = {1e3 * of:g} mm" for name, of in lengths.items())
    masses = ", ".join(f"{of['mass_kg']:g}" for of in (crank, rod, slider))
    inertias = f"{crank['inertia_kg_m2']:g}, {rod['inertia_kg_m2']:g} kg m²"
    name = scene["name"].removesuffix("-first-impact")
    return f"In {name}: {told}; masses {masses} kg; inertias {inertias}; contact law {law['law']}."


def _provenance(studies: Studies) -> Table:
    """Return of which set, commit, code and day each study's rows are."""
    keys = ("set", "commit", "code", "date")
    lines = [
        {"study": name, "runs": len(results.rows)} | {key: results.facts.get(key) for key in keys}
        for name, results in studies.items()
    ]
    caption = ", ".join(f"{name} {version}" for name, version in versions(studies).items())
    return Table("provenance", "Provenance", caption, "", pd.DataFrame(lines))


def configurations(rows: pd.DataFrame, studies: Studies) -> Table:
    """Return what each configuration of any study is, in a line, and what it sets."""
    meanings: dict[str, str] = {}
    for results in studies.values():
        meanings |= results.facts.get("configurations", {})
    names = sorted(name for name in rows if name.startswith("setting_"))
    by_label = rows.assign(label=in_legend_order(rows)).groupby("label", observed=True)[names]
    lines = [(label, meanings.get(str(label), ""), _settings(of)) for label, of in by_label]
    caption = (
        "What is not set has the default of the engine's model here. A setting that is varied has another "
        "value in each run of the configuration's series."
    )
    table = pd.DataFrame(lines, columns=["configuration", "what it is", "settings"])
    return Table("configurations", "Engines and configurations", caption, "", table)


def _settings(settings: pd.DataFrame) -> str:
    """Return the settings of one label's rows; what differs from run to run is varied."""
    told = []
    for name, column in settings.dropna(axis="columns", how="all").items():
        texts = {f"{of:.4g}" if isinstance(of, float) else str(of) for of in column}
        told.append(f"{str(name)[8:]} {'varied' if len(texts) > 1 else f'= {texts.pop()}'}")
    return ", ".join(told) or "the defaults"


CHAPTER = Chapter("method", "Method", ("accuracy",), INTRODUCTION, parts)
