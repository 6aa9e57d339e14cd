"""The pages of columns name every column that there is, and none that there is not."""

import re
from collections.abc import Iterator
from itertools import product

import crankslider as cs
from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from reports.results import published_rows
from studies.case import STUDIES
from studies.judges.columns import impact_columns, sample_columns
from tests.docs.pages import ROOT, table
from tests.scenes import scene

LOADED = {"force_N": -1.0, "viscous_N_s_m": 1.0, "spring_N_m": 10.0, "free_position_m": 0.1}
#: Between them these have every kind of part; ends are in s.
SCENES = [
    *(cs.scenes[name] for name in ("ideal-torque", "ideal-compressor", "clearance-pendulum")),
    cs.scenes["clearance-driven-damped"].replace(
        "clearance.A", cs.scenes["clearance-driven-A"].clearances["A"]
    ),
    cs.scenes["ideal-free"].replace("load.slider", LOADED),
    *map(scene, ("everything", "yoke", "loop")),
]
END_S, STEP_S = 1e-4, 2e-5
PAGE = "docs/columns.md"
#: Columns that rows of the full set alone have, which is not published.
OF_THE_FULL_SET = {
    "crank_angle_{error,uncertainty,scale,model_difference}_rad",
    "crank_speed_{error,uncertainty,scale,model_difference}_rad_s",
    *("slider_{force,viscous,spring,gas}_work_J", "direction"),
    *("contact_{O,A,B}_friction_force_N", "radial_clearance_m", "crank_speed_rpm"),
}
PUBLISHED = ROOT / "reports/published/results"


def names(page: str, first: str) -> list[str]:
    """Return the names in the first column of a page's tables, written out."""
    cells = " ".join(row[first] for row in table(page, first))
    return [name for pattern in re.findall(r"`([^`]+)`", cells) for name in written_out(pattern)]


def written_out(pattern: str) -> Iterator[str]:
    """Yield the names that a pattern such as ``joint_{O,A,B}_force_{x,y}_N`` stands for."""
    parts = [part.split(",") for part in re.split(r"[{}]", pattern)]
    yield from ("".join(choice) for choice in product(*parts))


def test_the_columns_of_runs_are_those_on_the_page() -> None:
    """Names of bodies and so on are as they are written there; joints O, A and B stand for each other."""
    page = {name for first in ("column", "of a mechanism") for name in names(PAGE, first)}
    page = {re.sub("^(joint|clearance|contact)_[OAB]_", r"\1_JOINT_", name) for name in page}
    unseen, engine = set(page), make_engine("reference")
    for of in SCENES:
        short = of.replace("end_time_s", END_S)
        columns = set(sample_columns(short, engine.simulate(short, RunSettings(STEP_S, 2))))
        parts = [guide.name for guide in of.mechanism.guides] + [s.name for s in of.mechanism.springs]
        parts += [it.name for it in of.mechanism.torsions]
        observed = [str(of.observed.name).replace(".", "_")]
        words = {
            "OBSERVED": observed,
            "BODY": of.mechanism.names,
            "JOINT": [pin.name for pin in of.mechanism.pins],
            "NAME": parts,
            "MARKER": of.markers,
        }
        known = set[str]()
        for pattern in page:
            word = next((word for word in words if word in pattern), "")
            written = {pattern.replace(word, own) for own in words[word]} if word else {pattern}
            unseen -= {pattern} if written & columns else set()
            known |= written
        assert columns <= known, of.name
    assert unseen == set()
    assert [*impact_columns({})] == names(PAGE, "impact")


def test_the_columns_of_published_rows_are_those_on_the_page() -> None:
    """Joints, directions, loads and limits stand for each other; some have no row of theirs."""
    published = {name for study in STUDIES for row in published_rows(PUBLISHED, study) for name in row}
    known = set(names("docs/rows.md", "column"))
    assert {name for name in published if not name.startswith("setting_")} - known == set()
    cells = " ".join(row["column"] for row in table("docs/rows.md", "column"))
    patterns = re.findall(r"`([^`]+)`", cells)
    unseen = {p for p in patterns if p != "setting_*" and not published & set(written_out(p))}
    assert unseen <= OF_THE_FULL_SET
