"""``crankslider compare``: two real engines on a short scene of the user's, and a second call resumes."""

import csv
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest

import crankslider as cs
from studies.store import Store
from tests.helpers.command import Finished, crankslider
from tests.studies.truth.closed_forms.crank_slider import exact

pytestmark = pytest.mark.system

#: Two turns of a quick crank, in s, and how a user asks for them.
END_S = 0.02
SHORT = ("--with", f"end_time_s={END_S}")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a scene of the user's."""
    folder = tmp_path_factory.mktemp("comparison")
    (folder / "mine.toml").write_text(crankslider("show", "ideal-free").stdout)
    return folder


@pytest.fixture(scope="module")
def done(folder: Path) -> Finished:
    engines = ("--engine", "reference", "--engine", "pymunk")
    return crankslider("compare", folder / "mine.toml", *SHORT, *engines, "--out", folder)


def test_it_ends_in_a_recommendation_and_says_where_the_page_is(done: Finished, folder: Path) -> None:
    assert done.code in (0, None), done.stderr
    assert "Use reference" in done.stdout
    assert f"note: the page is {folder / 'index.html'}" in done.stderr
    assert "time [ms]" in done.stdout


def test_the_page_has_the_recommendation_its_figures_and_its_tables(done: Finished, folder: Path) -> None:
    page = (folder / "index.html").read_text("utf-8")
    assert f"crankslider simulate {folder / 'mine.toml'} {' '.join(SHORT)} --engine reference" in page
    assert done.stdout.splitlines()[-1].strip() in unescape(page)
    files = set(re.findall(r'(?:src|href)="([^"#]+)"', page))
    assert sum(file.endswith(".svg") for file in files) >= 3
    assert [file for file in files if not (folder / file).is_file()] == []


@pytest.mark.usefixtures("done")
def test_the_error_in_the_rows_is_that_of_the_run_at_its_settings(folder: Path) -> None:
    short = cs.load(folder / "mine.toml").replace("end_time_s", END_S)
    with (folder / "rows.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["arm"] == "projection" and not row["round"]]
    row = max(rows, key=lambda row: float(row["step_s"]))
    samples = int(float(row["samples"]))
    run = cs.simulate(
        short, step=float(row["step_s"]), samples=samples, settings={"stabilisation": "projection"}
    )
    truth = exact(short, samples).position[:, -1, 0]
    error = np.abs(run.frame["slider_position_m"].to_numpy() - truth).max()
    assert float(row["slider_position_error_m"]) == pytest.approx(error, rel=1e-6)


@pytest.mark.usefixtures("done")
def test_a_second_call_from_python_runs_nothing_again(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    short = cs.load(folder / "mine.toml").replace("end_time_s", END_S)
    with Store(folder) as store:
        before = store.statuses()
    found = cs.compare(short, engines=["reference"], out=folder)
    with Store(folder) as store:
        assert store.statuses() == before
    assert set(found.frame["engine"]) == {"reference"}
    assert "Next best engine" not in found.recommendation
    assert "unsupported" not in capfd.readouterr().err


def test_other_mechanisms_are_compared_by_what_they_observe(tmp_path: Path) -> None:
    short, engine = ("--with", "end_time_s=0.004"), ("--engine", "reference")
    done = crankslider("compare", "four-bar-clearance", *short, *engine, "--out", tmp_path)
    assert done.code in (0, None), done.stderr
    assert re.search(r"^B x error: .*; asked for: 5 µm\.$", done.stdout, re.MULTILINE)
    page = (tmp_path / "index.html").read_text("utf-8")
    assert "B x error" in page
    assert "slider position" not in page
