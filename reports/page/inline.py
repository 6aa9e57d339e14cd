"""An SVG of Matplotlib's as a part of a page: small, with its own names, in colours that follow the page."""

import re
from dataclasses import dataclass
from zlib import crc32

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
#: How Matplotlib names the fonts that stand in for its own; a page has one list for all.
_FONTS = re.compile(r"font-family: [^;\"]*|font: ([\d.]+px) '[^;\"]*")
_NAME, _BARE = re.compile(r' id="([^"]*)"'), re.compile(r"<g>\s*(<(?:use|path)[^>]*/>)\s*</g>")


@dataclass(frozen=True)
class Inline:
    """An SVG in a page: its ``markup``, and the ``styles`` of it by their classes.

    What had the name of a series has it with ``prefix`` before it.
    """

    markup: str
    styles: dict[str, str]
    prefix: str


def inline(svg: str, name: str, alt_id: str, *, recoloured: bool) -> Inline:
    """Return an SVG for a page on which no other figure is called ``name``."""
    prefix = f"f{_short(name)}-"
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->", "", svg, flags=re.DOTALL)
    head = rf'<svg role="img" aria-labelledby="{alt_id}" \1>'
    svg = re.sub(r"<svg [^>]*?(viewBox=\"[^\"]*\")[^>]*>", head, svg, count=1, flags=re.DOTALL)
    svg = svg.replace("xlink:href", "href")
    used = set(re.findall(r"(?:href=\"#|url\(#)([^\")]*)", svg))
    svg = _NAME.sub(lambda m: m[0] if m[1] in used or m[1].startswith("series-") else "", svg)
    svg = re.sub(r'(id="|href="#|url\(#)', rf"\1{prefix}", svg)
    svg = _FONTS.sub(lambda m: f"font-size: {m[1]}" if m[1] else "", svg)
    if recoloured:
        svg = re.sub(r"#[0-9a-f]{6}\b", lambda m: f"var(--{NAMED[m[0]]})" if m[0] in NAMED else m[0], svg)
    styles: dict[str, str] = {}
    svg = re.sub(r' style="([^"]*)"', lambda m: f' class="{_worn(m[1], styles)}"', svg)
    while (flat := _BARE.sub(r"\1", svg)) != svg:
        svg = flat
    svg = re.sub(r"\s*\n\s*", "\n", svg)
    return Inline(svg, styles, prefix)


def _worn(style: str, styles: dict[str, str]) -> str:
    """Return the class of a style, which is the same on all figures."""
    name = f"s{_short(style)}"
    styles[name] = style
    return name


def _short(text: str) -> str:
    return f"{crc32(text.encode()):x}"
