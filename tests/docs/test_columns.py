"""The pages of columns name every column that there is, and none that there is not."""

import re
from collections.abc import Iterator
from functools import cache
from itertools import product

import crankslider as cs
from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from reports.results import published_rows
from studies.judges.columns import impact_columns, sample_columns
from studies.registry import STUDIES
from tests.docs.pages import ROOT, table
from tests.scenes import scene

#: Between them these have every kind of joint, drive and load; ends are in s.
SCENES = {
    "ideal-torque": {},
    "ideal-compressor": {},
    "clearance-driven-damped": {"clearance.A": cs.scenes["clearance-driven-A"].clearances["A"]},
    "clearance-pendulum": {},
}
LOADED = {"force_N": -1.0, "viscous_N_s_m": 1.0, "spring_N_m": 10.0, "free_position_m": 0.1}
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


@cache
def real_columns() -> frozenset[str]:
    """Return the columns of short runs of all kinds of scenes."""
    made = [cs.scenes[name].replace(changes) for name, changes in SCENES.items()]
    made += [cs.scenes["ideal-free"].replace("load.slider", LOADED)]
    engine, columns = make_engine("reference"), set[str]()
    for each in made:
        short = each.replace("end_time_s", END_S)
        columns |= sample_columns(short, engine.simulate(short, RunSettings(STEP_S, 2))).keys()
    return frozenset(columns)


def test_the_columns_of_runs_are_those_on_the_page() -> None:
    """Names that differ in their joint alone stand for each other where a page names them."""
    page = names(PAGE, "column")
    assert real_columns() - set(page) == set()
    any_joint = {re.sub("_[OAB]_", "_O_", name) for name in real_columns()}
    assert {re.sub("_[OAB]_", "_O_", name) for name in page} - any_joint == set()
    assert [*impact_columns({})] == names(PAGE, "impact")


def test_the_columns_of_a_mechanism_are_on_the_page_and_no_others() -> None:
    """Of scenes with every kind of part; names of bodies and so on are as they are written there."""
    found, unseen = set[str](), set(names(PAGE, "of a mechanism"))
    for name in ("everything", "yoke", "loop"):
        of = scene(name).replace("end_time_s", END_S)
        columns = sample_columns(of, make_engine("reference").simulate(of, RunSettings(STEP_S, 2))).keys()
        parts = [guide.name for guide in of.mechanism.guides] + [
            spring.name for spring in of.mechanism.springs
        ]
        written = {"OBSERVED": [str(of.observed.name).replace(".", "_")], "BODY": [*of.mechanism.names]}
        written |= {"JOINT": [*of.joints], "NAME": parts}
        page = {re.sub("_[OAB]_", f"_{pin}_", name) for name in names(PAGE, "column") for pin in of.joints}
        for pattern in names(PAGE, "of a mechanism"):
            word = next((word for word in written if word in pattern), "")
            made = {pattern.replace(word, own) for own in written[word]} if word else {pattern}
            page |= made
            if made & columns:
                unseen.discard(pattern)
        found |= columns - page
    assert (found, unseen) == (set(), set())


def test_the_columns_of_published_rows_are_those_on_the_page() -> None:
    """Joints, directions, loads and limits stand for each other; some have no row of theirs."""
    published = {name for study in STUDIES for row in published_rows(PUBLISHED, study) for name in row}
    known = set(names("docs/rows.md", "column"))
    assert {name for name in published if not name.startswith("setting_")} - known == set()
    cells = " ".join(row["column"] for row in table("docs/rows.md", "column"))
    patterns = re.findall(r"`([^`]+)`", cells)
    unseen = {p for p in patterns if p != "setting_*" and not published & set(written_out(p))}
    assert unseen <= OF_THE_FULL_SET
