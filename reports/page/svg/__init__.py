"""Figures as parts of a page: SVG of Matplotlib's, small, with the names and colours of the page."""

from reports.page.svg.inline import Inline, classes_of, inline
from reports.page.svg.sharing import NAMED

__all__ = ["NAMED", "Inline", "classes_of", "inline"]
