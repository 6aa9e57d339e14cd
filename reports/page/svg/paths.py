"""Path data of an SVG, short: to a tenth of a point, and without points that nobody would miss."""

import itertools
import re
from collections.abc import Iterator

import numpy as np

from reports.results import FloatArray

#: How far from where it was a line may lie, in points: a fifth of a pixel of a screen.
TOLERANCE = 0.1
#: A shape no larger than this is a marker, and drawn ten times as finely.
SMALL = 20.0
_COMMAND, _NUMBER = re.compile(r"([A-Za-z])([^A-Za-z]*)"), re.compile(r"-?[\d.]+")
_BLANK = re.compile(r" (?=-)|(?<=\.\d) (?=\.)|(?<=\.\d\d) (?=\.)")


def compact(data: str) -> str:
    """Return path data that draw the same: straight lines thinned, numbers rounded and short."""
    commands = [(letter, _numbers(told)) for letter, told in _COMMAND.findall(data)]
    digits = 2 if is_small(data) else 1
    if any(letter not in "MLz" for letter, _ in commands):
        told = [letter + " ".join(shortest(v, digits) for v in of) for letter, of in commands]
        return _BLANK.sub("", "".join(told))
    tolerance = TOLERANCE * 10 ** (1 - digits)
    return "".join(_line(thinned(line, tolerance), digits) + z for line, z in _lines(commands))


def is_small(data: str) -> bool:
    """Return whether path data are of a marker."""
    return bool(np.ptp(_numbers(data)) < SMALL)


def moved(data: str, across: float, up: float) -> str:
    """Return path data at another place."""
    by = itertools.cycle((across, up))
    return _NUMBER.sub(lambda m: f"{float(m[0]) + next(by):.2f}", data)


def points(places: FloatArray) -> str:
    """Return path data of points (n, 2) of which each counts."""
    return _line(places, 1)


def thinned(line: FloatArray, tolerance: float) -> FloatArray:
    """Return a line (n, 2) without points that lie within a tolerance of what is left (Douglas, Peucker)."""
    kept = np.zeros(len(line), bool)
    kept[[0, -1]] = True
    parts = [(0, len(line) - 1)]
    while parts:
        first, last = parts.pop()
        if last - first < 2:
            continue
        off = _distances(line[first + 1 : last], line[first], line[last])
        if off.max() > tolerance:
            middle = first + 1 + int(off.argmax())
            kept[middle] = True
            parts += [(first, middle), (middle, last)]
    return line[kept]


def shortest(value: float, digits: int = 1) -> str:
    """Return a number to some digits in as few letters as can be: -.5, 12, 12.3."""
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return re.sub(r"^(-?)0\.", r"\1.", text) if text != "-0" else "0"


def _numbers(text: str) -> FloatArray:
    return np.array(_NUMBER.findall(text), float)


def _lines(commands: list[tuple[str, FloatArray]]) -> Iterator[tuple[FloatArray, str]]:
    """Yield the lines of path data, each with a z if it is closed."""
    starts = [k for k, (letter, _) in enumerate(commands) if letter == "M"]
    for start, end in itertools.pairwise([*starts, len(commands)]):
        of = commands[start:end]
        yield np.concatenate([numbers for _, numbers in of]).reshape(-1, 2), "z" * (of[-1][0] == "z")


def _line(line: FloatArray, digits: int) -> str:
    """Return the path data of a line: where it starts, and each step from there."""
    places = np.rint(line * 10**digits) / 10**digits
    text, letter = f"M{shortest(places[0, 0], digits)} {shortest(places[0, 1], digits)}", "M"
    for step in np.diff(places, axis=0):
        across, up = (shortest(v, digits) for v in step)
        last, letter = letter, "h" if up == "0" else "v" if across == "0" else "l"
        told = {"h": across, "v": up, "l": f"{across} {up}"}[letter]
        text += (" " if letter == last else letter) + told
    return _BLANK.sub("", text)


def _distances(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return how far points (n, 2) are from the straight line between two."""
    along = end - start
    share = np.clip((points - start) @ along / (float(along @ along) or 1.0), 0.0, 1.0)
    off: FloatArray = np.hypot(*(points - start - share[:, None] * along).T)
    return off
