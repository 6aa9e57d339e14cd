"""Fewer elements in a drawing: no groups that say nothing, neighbours that look the same as one, markers."""

import re
from collections.abc import Mapping, Sequence
from itertools import groupby
from xml.etree.ElementTree import Element

import numpy as np

from reports.page.svg import paths

#: A filled cell; two that meet leave no hole.
_BOX = re.compile(r"M [\d. ]+(L [\d. ]+){3,4}z? ?")
#: What lies on an axis from below to above: lines of the grid, ticks, and then letters.
_ON_AXIS = {"path": 0, "use": 1}


def merge(drawing: Element, things: Mapping[str, Element]) -> None:
    """Write a drawing with as few elements as can be; ``things`` are what it uses, by their names."""
    for use in drawing.iter("use"):
        shape = things[use.attrib.pop("href")[1:]].attrib["d"]
        if paths.is_small(shape):
            use.set("shape", shape)
        else:
            use.tag = "path"
            use.set("d", paths.moved(shape, float(use.attrib.pop("x", 0)), float(use.attrib.pop("y", 0))))
    _flatten(drawing)


def markers_of(drawing: Element) -> list[Element]:
    """Return the markers of a drawing, each once, and write what has them as paths that name them."""
    markers: dict[tuple[str, str], str] = {}
    for use in drawing.iter("use"):
        look = (use.attrib.pop("shape"), use.attrib.pop("style", ""))
        name = markers.setdefault(look, f"marker-{len(markers)}")
        places = np.array([[float(number) for number in use.attrib.pop(name).split()] for name in "xy"]).T
        use.tag = "path"
        # A path of one point has no marker, and one that goes nowhere has it at either end.
        use.set("d", paths.points(places) + "h0" * (len(places) == 1))
        use.set("style", f"marker{'-start' * (len(places) == 1)}:url(#{name})")
    return [_marker(name, *look) for look, name in markers.items()]


def _marker(name: str, shape: str, style: str) -> Element:
    marker = Element("marker", {"id": name, "markerUnits": "userSpaceOnUse"})
    marker.append(Element("path", {"d": shape, "style": style}))
    return marker


def _flatten(group: Element) -> None:
    parts = []
    for part in (part for part in group if part.tag != "defs"):
        if part.tag == "g":
            _flatten(part)
        parts += _freed(part)
    if group.get("id", "").startswith("matplotlib.axis"):
        parts.sort(key=lambda part: _ON_AXIS.get(part.tag, 2))
    group[:] = []
    for look, run in groupby(parts, _look):
        same = list(run)
        group.extend([_as_one(same)] if look else same)
    if not group.get("id", "").startswith("series-"):
        group.attrib.pop("id", None)


def _freed(part: Element) -> list[Element]:
    """Return what a group is made of if nothing is lost without it, a clip path being theirs, else itself."""
    if part.tag == "text" and not len(part) and not (part.text or "").strip():
        return []
    if part.tag != "g" or part.attrib.keys() - {"clip-path"}:
        return [part]
    clip = part.get("clip-path")
    if clip and any(each.attrib.keys() & {"clip-path", "transform"} for each in part):
        return [part]
    for each in part if clip else ():
        each.set("clip-path", str(clip))
    return list(part)


def _look(part: Element) -> tuple[str | None, ...]:
    """Return what neighbours have in common that can be one part, nothing of what stays by itself."""
    style, data = part.get("style", ""), part.get("d", "")
    alike = part.tag == "use" or (
        part.tag == "path"
        and not part.attrib.keys() & {"id", "transform"}
        and "opacity" not in style
        and ("fill: none" in style or bool(_BOX.fullmatch(data)))
    )
    return (part.tag, part.get("shape"), style, part.get("clip-path")) if alike else ()


def _as_one(parts: Sequence[Element]) -> Element:
    """Return parts that look the same as one: lines one after the other, or markers at several places."""
    first = parts[0]
    for name in ("d",) if first.tag == "path" else ("x", "y"):
        first.set(name, " ".join(part.get(name, "0") for part in parts))
    return first
