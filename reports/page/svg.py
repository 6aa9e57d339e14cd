"""An SVG of Matplotlib's as a part of a page: small, and in colours that follow the page."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np

#: Colours of figures that the page gives its own, in the light and in the dark.
NAMED = {
    "#000000": "ink",
    "#ffffff": "paper",
    "#e6e6e6": "grid",
    "#595959": "quiet",
    "#0072b2": "blue",
    "#d55e00": "vermillion",
    "#009e73": "green",
    "#6a3d9a": "purple",
}
#: What a page has no use for: provenance, names of namespaces, comments, links to a glyph's group.
_AROUND = re.compile(r'<metadata>.*?</metadata>|<!--.*?-->| xmlns(:\w+)?="[^"]*"|<defs>\s*</defs>', re.DOTALL)
_STYLE, _COLOUR = re.compile(r' style="([^"]*)"'), re.compile(r"#[0-9a-f]{6}\b")
#: How Matplotlib names the fonts that stand in for its own; a page has one list for all.
_FONTS = re.compile(r"font-family: [^;\"]*|font: ([\d.]+px) '[^;\"]*")
#: Ids of groups that nobody refers to, and groups that say nothing.
_ID = re.compile(r' id="(?!series-)([\w.-]+)"')
#: Attributes whose numbers are places or sizes; numbers in text stay as they are.
_PLACES = re.compile(r' (?:d|[xy][12]?|c[xy]|r[xy]?|width|height|points|transform|viewBox)="[^"]*"')
_DECIMALS, _BLANKS = re.compile(r"(-?\d+\.\d)\d+"), re.compile(r"\s*\n\s*")


@dataclass(frozen=True)
class Inline:
    """An SVG in a page: its ``markup``, in which a class is the place of one of its ``styles``."""

    markup: str
    styles: tuple[str, ...]

    def placed(self, prefix: str, classes: Mapping[str, str]) -> str:
        """Return the markup with ``prefix`` before its names and with the ``classes`` of its styles."""
        names = [classes[style] for style in self.styles]
        named = re.sub(r' class="(\d+)"', lambda m: f' class="{names[int(m[1])]}"', self.markup)
        return re.sub(r'( id="| href="#|url\(#)', rf"\1{prefix}", named)


def classes_of(pictures: Iterable[Inline]) -> dict[str, str]:
    """Return the classes of a page with these pictures, by their styles."""
    styles = dict.fromkeys(style for each in pictures for style in each.styles)
    return {style: f"s{np.base_repr(place, 36).lower()}" for place, style in enumerate(styles)}


def inline(svg: str, alt: str, *, recoloured: bool) -> Inline:
    """Return an SVG for a page; ``alt`` says what is to be seen."""
    plain = _AROUND.sub("", svg[svg.index("<svg") :]).replace("xlink:href", "href")
    plain = re.sub(
        r'<svg[^>]*?( viewBox="[^"]*")[^>]*>', rf'<svg role="img" aria-label={_quoted(alt)}\1>', plain
    )
    used = set(re.findall(r'(?:href="#|url\(#)([\w.-]+)', plain))
    plain = _ID.sub(lambda m: m[0] if m[1] in used else "", plain)
    styles: dict[str, int] = {}

    def classed(found: re.Match[str]) -> str:
        style = _FONTS.sub(lambda m: f"font-size: {m[1]}" if m[1] else "", found[1])
        if recoloured:
            style = _COLOUR.sub(lambda m: f"var(--{NAMED[m[0]]})" if m[0] in NAMED else m[0], style)
        if "url(" in style:
            return f' style="{style}"'
        return f' class="{styles.setdefault(style, len(styles))}"'

    short = _PLACES.sub(lambda m: _DECIMALS.sub(r"\1", m[0]), _STYLE.sub(classed, plain))
    markup = _BLANKS.sub("\n", short)
    return Inline(markup, tuple(styles))


def _quoted(text: str) -> str:
    """Return an attribute's text as a replacement of ``re.sub``."""
    return quoteattr(text).replace("\\", r"\\")
