"""Method: the mechanism with its symbols, what names of configurations mean, and runs that did not finish."""

import json
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import pandas as pd

from reports.look import RC, in_legend_order
from reports.mechanism import draw_mechanism
from reports.page import FINDINGS, Chapter, Claim, Figure, Part, Table, Text, versions
from reports.results import Studies, quality_failures, with_columns

#: Columns of a run that did not finish, or that fails the check after every run.
RUN = ["study", "scene", "label", "step_s", "status", "exception", "reason"]


def parts(studies: Studies) -> Iterator[Part | None]:
    """Yield the mechanism, how many runs finished, what configurations are, and the runs that failed."""
    scenes = with_columns(studies["accuracy"].rows, "scene_json")["scene_json"].dropna()
    if len(scenes):
        scene = json.loads(scenes.iloc[0])
        caption = (
            "The crank-slider in proportion, and a joint, its clearance not to scale. Numbers are those of "
            f"{scene['name'].removesuffix('-first-impact')}."
        )
        with mpl.rc_context(RC):
            drawing = draw_mechanism(scene)
        yield Figure(
            "mechanism", "What is the mechanism, and what do the symbols mean?", caption, "accuracy", drawing
        )
    rows = pd.concat([results.rows.astype({"label": str}) for results in studies.values()], ignore_index=True)
    rows = with_columns(rows, *RUN).copy().assign(quality=quality_failures(rows))
    failed, failing = rows[rows["status"] != "ok"], rows[rows["quality"] != ""]
    text = "{finished} of {asked} runs finished; {failing} of those fail the check of energy and gaps."
    numbers = {"finished": len(rows) - len(failed), "asked": len(rows), "failing": len(failing)}
    yield Claim("reliability", text, {name: (count, "") for name, count in numbers.items()})
    yield configurations(rows, studies)
    title = "Runs that did not finish"
    yield Table(
        "failures", title, "", "", failed[RUN].rename(columns={"label": "configuration"}), shown=False
    )
    failing = failing[[*RUN[:4], "quality"]].rename(columns={"label": "configuration"})
    yield Table("quality", "Finished runs that fail the check", "", "", failing, shown=False)
    yield _provenance(studies)
    told = f'<a href="{FINDINGS}">{FINDINGS}</a> has every claim with its numbers, units and intervals.'
    yield Text(f"{Path(__file__).with_suffix('.html').read_text(encoding='utf-8')}<p>{told}</p>")


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
    meanings = {
        label: meaning
        for results in studies.values()
        for label, meaning in results.facts.get("configurations", {}).items()
    }
    names = sorted(name for name in rows if name.startswith("setting_"))
    lines = [
        {
            "configuration": str(label),
            "what it is": meanings.get(str(label), ""),
            "settings": _settings(of[names]),
        }
        for label, of in rows.assign(label=in_legend_order(rows)).groupby("label", observed=True)
    ]
    caption = (
        "What is not set has the default of the engine's model here. A setting that is varied has another "
        "value in each run of the configuration's series."
    )
    return Table("configurations", "Engines and configurations", caption, "", pd.DataFrame(lines))


def _settings(settings: pd.DataFrame) -> str:
    """Return the settings of one label's rows; what differs from run to run is varied."""
    texts = settings.dropna(axis="columns", how="all").map(
        lambda of: f"{of:.4g}" if isinstance(of, float) else str(of)
    )
    told = [
        f"{name.removeprefix('setting_')} {'varied' if len(of) > 1 else f'= {of[0]}'}"
        for name, of in ((name, texts[name].unique()) for name in texts)
    ]
    return ", ".join(told) or "the defaults"


INTRODUCTION = (
    "How the mechanism is modelled, what results are compared with, and how errors and run times are taken."
)
CHAPTER = Chapter("method", "Method", ("accuracy",), INTRODUCTION, parts)
