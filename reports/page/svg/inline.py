"""An SVG of Matplotlib's as a part of a page: small, in colours that follow the page."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from reports.page.svg import paths
from reports.page.svg.merging import markers_of, merge
from reports.page.svg.sharing import gather, named_in, number_styles, rename

#: What a page has no use for: provenance, and names of namespaces.
_AROUND = re.compile(r'<metadata>.*?</metadata>| xmlns(:\w+)?="[^"]*"', re.DOTALL)
_DECIMAL = re.compile(r"-?\d+\.\d+")


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


def inline(svg: str, alt_id: str, *, recoloured: bool) -> Inline:
    """Return an SVG for a page on which the text with ``alt_id`` says what is to be seen."""
    plain = _AROUND.sub("", svg[svg.index("<svg") :]).replace("xlink:href", "href")
    root = ElementTree.fromstring(plain)
    things = {each.get("id", ""): each for defs in root.iter("defs") for each in defs}
    drawing = next(each for each in root if each.tag == "g")
    merge(drawing, things)
    markers = markers_of(drawing)
    defs, whole = Element("defs"), Element("svg", {"role": "img", "aria-labelledby": alt_id})
    defs.extend([*(things[name] for name in named_in(drawing) if name in things), *markers])
    whole.set("viewBox", root.attrib["viewBox"])
    whole.extend([defs, drawing])
    styles = number_styles(whole, recoloured)
    gather(drawing, styles)
    _shorten(whole)
    rename(whole)
    markup = re.sub(r"\s*\n\s*", "\n", ElementTree.tostring(whole, "unicode"))
    return Inline(markup.replace(" />", "/>"), styles)


def _shorten(whole: Element) -> None:
    """Round every place to what a screen shows, and write it in few letters."""
    for each in whole.iter():
        if (data := each.get("d")) and not each.get("style", "").startswith("marker"):
            each.set("d", paths.compact(data))
        if re.match(r"rotate\(-?0 ", turn := each.get("transform", "")):
            del each.attrib["transform"]
        elif re.match("rotate|translate", turn):
            each.set("transform", _DECIMAL.sub(lambda m: paths.shortest(float(m[0])), turn))
        for name in ("x", "y", "width", "height"):
            if each.tag != "image" and (value := each.get(name)):
                each.set(name, paths.shortest(float(value)))
