"""The page of a comparison: one file with its figures and tables inside."""

from base64 import b64encode
from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure as Drawing

from reports.chapters.comparison.sections import sections
from reports.results import Results
from reports.run.picture import picture_bytes
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
    environment.filters["embedded"] = _embedded
    with mpl.rc_context(RC):
        parts = sections(results, pictures, given)
    return environment.get_template("page.html.jinja").render(
        name=results.rows["scene"].iloc[0], sections=parts, scene=scene
    )


def _embedded(drawing: Drawing) -> str:
    """Return a figure as the address of an image that is in it."""
    return f"data:image/svg+xml;base64,{b64encode(picture_bytes(drawing, '.svg')).decode('ascii')}"
