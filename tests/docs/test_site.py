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


def test_the_site_is_built_and_has_all_settings_and_scenes_and_formulas_without_a_network(
    tmp_path: Path,
) -> None:
    places = ["-d", str(tmp_path / "trees"), str(DOCS), str(tmp_path / "html")]
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", *places]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    pages = {
        path.relative_to(tmp_path / "html").as_posix(): path.read_text(encoding="utf-8")
        for path in (tmp_path / "html").rglob("*.html")
    }
    loaded = re.compile(r"<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=[\"'](?:https?:)?//[^\"']*")
    assert {name: hits for name, page in pages.items() if (hits := loaded.findall(page))} == {}
    named = {f"engines/{engine}.html": [*fields(engine_class(engine))] for engine in ENGINES}
    named["reference/scenes.html"] = [*SCENES]
    for page, names in named.items():
        assert [name for name in names if f">{name}<" not in pages[page]] == [], page
    assert pages["laws.html"].count("<math") > 20
    assert "MathJax" not in pages["laws.html"]
