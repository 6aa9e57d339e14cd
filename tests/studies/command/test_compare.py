"""``crankslider compare``: two real engines on a short scene of the user's, and a second call resumes."""

import re
from html import unescape
from pathlib import Path

import pytest

import crankslider as cs
from studies.running.store import Store
from tests.helpers.command import Finished, crankslider

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
    assert sum(file.endswith(".svg") for file in files) == 2
    assert [file for file in files if not (folder / file).is_file()] == []


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
