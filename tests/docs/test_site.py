"""The site is built without a warning, and its pages need nothing from a network."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from engine_models.engines import ENGINES, engine_class
from engine_models.scene.library import SCENES
from engine_models.scene.plain_words import fields
from tests.docs.pages import DOCS

pytestmark = pytest.mark.system


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the built pages."""
    folder = tmp_path_factory.mktemp("site")
    places = ["-d", str(folder / "trees"), str(DOCS), str(folder / "html")]
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", *places]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "html"


def test_no_page_loads_anything_from_elsewhere(site: Path) -> None:
    loaded = re.compile(r"<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=[\"'](?:https?:)?//[^\"']*")
    found = {path.name: loaded.findall(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    assert {name: hits for name, hits in found.items() if hits} == {}


@pytest.mark.parametrize("engine", ENGINES)
def test_an_engines_page_has_all_its_settings(site: Path, engine: str) -> None:
    page = (site / "engines" / f"{engine}.html").read_text(encoding="utf-8")
    assert [name for name in fields(engine_class(engine)) if f">{name}<" not in page] == []


def test_the_page_of_scenes_has_the_whole_library(site: Path) -> None:
    page = (site / "reference" / "scenes.html").read_text(encoding="utf-8")
    assert [name for name in SCENES if f">{name}<" not in page] == []


def test_formulas_are_there_without_scripts(site: Path) -> None:
    page = (site / "laws.html").read_text(encoding="utf-8")
    assert page.count("<math") > 20
    assert "MathJax" not in page
