"""HTML of the gallery from its templates; every piece stands in any page and asks for no network."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined


def rendered(template: str, **values: Any) -> str:
    """Return a template of this folder with its values."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)


def equations_html() -> str:
    """Return the box of the paper's equations (1) to (10) (Grigore, Stanescu and Pandrea 2008) as MathML."""
    return rendered("equations.html.jinja")
