"""The page of a comparison: one file with its figures and tables inside."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure as Drawing

from reports.chapters.comparison.sections import sections
from reports.page.figures import draw
from reports.page.svg import classes_of
from reports.results import Results
from reports.style import RC

#: Where the page's template is, and the style that it shares with the report.
FOLDERS = (Path(__file__).parent, Path(__file__).parents[2] / "page")


def page(results: Results, pictures: Mapping[str, Drawing], scene: str, given: str) -> str:
    """Return the page of the results on one scene as HTML that needs no other file.

    ``pictures`` are of the run that is recommended, by their titles; ``scene`` is the scene as TOML, and
    ``given`` how it is typed in a command.
    """
    environment = Environment(
        loader=FileSystemLoader(FOLDERS),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    with mpl.rc_context(RC):
        parts = sections(results, pictures, given)
    drawn = {figure.name: draw(figure).svg for part in parts for figure in part.figures}
    return environment.get_template("page.html.jinja").render(
        name=results.rows["scene"].iloc[0],
        sections=parts,
        scene=scene,
        drawn=drawn,
        classes=classes_of(drawn.values()),
    )
