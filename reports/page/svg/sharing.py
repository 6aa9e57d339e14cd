"""What elements of a drawing have in common is written once: styles, what lies behind them, and names."""

import re
from collections.abc import Callable
from itertools import groupby
from xml.etree.ElementTree import Element

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
#: Of how many neighbours what they share is written at a group.
FEWEST = 3
#: Where an element names another one, and how.
_NAMED_IN, _NAME = ("clip-path", "style"), re.compile(r"url\(#([\w-]+)")
#: How Matplotlib names the fonts that stand in for its own; a page has one list for all.
_FONTS = re.compile(r"font-family: [^;\"]*|font: ([\d.]+px) '[^;\"]*")
_COLOUR = re.compile(r"#[0-9a-f]{6}\b")
#: A style that a group has as a whole, and not for each of its parts.
_WHOLE = re.compile(r"(?<!-)opacity")


def named_in(drawing: Element) -> list[str]:
    """Return the names of what elements of a drawing name, each once, in their order."""
    texts = (each.get(at, "") for each in drawing.iter() for at in _NAMED_IN)
    return list(dict.fromkeys(name for text in texts for name in _NAME.findall(text)))


def number_styles(whole: Element, recoloured: bool) -> tuple[str, ...]:
    """Give a class in place of its style to each element, and return the styles by the number of their class.

    A style that names something of the drawing stays where it is.
    """
    styles: dict[str, int] = {}
    for each in (each for each in whole.iter() if each.get("style")):
        style = _FONTS.sub(lambda m: f"font-size: {m[1]}" if m[1] else "", each.attrib.pop("style"))
        if recoloured:
            style = _COLOUR.sub(lambda m: f"var(--{NAMED[m[0]]})" if m[0] in NAMED else m[0], style)
        if "url(" in style:
            each.set("style", style)
        else:
            each.set("class", str(styles.setdefault(style, len(styles))))
    return tuple(styles)


def gather(drawing: Element, styles: tuple[str, ...]) -> None:
    """Write what neighbours have in common at a group of them."""
    for group in list(drawing.iter("g")):
        _share(group, "clip-path", lambda _: True)
    for group in list(drawing.iter("g")):
        _share(group, "class", lambda at: not _WHOLE.search(styles[int(at)]))


def _share(group: Element, name: str, of_each: Callable[[str], bool]) -> None:
    parts: list[Element] = []
    for value, run in groupby(group, lambda part: part.get(name) if part.get("transform") is None else None):
        same = list(run)
        everything = len(same) == len(group) and name not in group.attrib
        if value is None or not of_each(value) or not (everything or len(same) >= FEWEST):
            parts += same
            continue
        for part in same:
            del part.attrib[name]
        home = group if everything else Element("g")
        home.set(name, value)
        if not everything:
            home.extend(same)
        parts += same if everything else [home]
    group[:] = parts


def rename(whole: Element) -> None:
    """Give names as short as can be to what others name."""
    old = (each.attrib["id"] for each in whole.iter() if not each.get("id", "series-").startswith("series-"))
    names = {name: np.base_repr(place, 36).lower() for place, name in enumerate(old)}
    for each in whole.iter():
        if each.get("id") in names:
            each.set("id", names[each.attrib["id"]])
        for at in _NAMED_IN:
            if text := each.get(at):
                each.set(at, _NAME.sub(lambda m: f"url(#{names[m[1]]}", text))
