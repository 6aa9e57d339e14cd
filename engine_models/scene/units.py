"""Quantities as text with a unit: ``"50 mm"`` is 0.05 in a field whose name ends with ``_m``.

A plain number is in the unit that the field's name ends with.
"""

import math
import re
from collections.abc import Mapping
from decimal import Decimal
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pint import UnitRegistry

#: Units of fields by what their names end with; the longest that fits counts.
UNITS = {name: name for name in ("m", "kg", "s", "rad", "Hz", "N", "Pa")} | {
    "kg_m2": "kg m^2",
    "m_s": "m/s",
    "m_s2": "m/s^2",
    "rad_s": "rad/s",
    "N_m": "N m",
    "spring_N_m": "N/m",
    "stiffness_N_m": "N/m",
    "N_m_rad": "N m/rad",
    "N_s_m": "N s/m",
    "N_m_s": "N m s",
    "end_slopes": "rad/s",  # of a table
    "stiffness": "N/m^exponent",
}
#: A number as it is typed: int() and float() also take 1_0, the digits of all scripts and blanks around.
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
#: A unit as it is typed, of a few characters, and a quantity: a number, then its unit.
UNIT = r"(?:1/)?[A-Za-zµμ°][\w°²³·*/^(). -]{0,29}"
QUANTITY = re.compile(rf"\s*(?P<number>{NUMBER.pattern})\s*(?P<unit>{UNIT})")


@cache
def _end(name: str) -> str:
    """Return the longest end of a field's name that tells its unit, "" if none does."""
    return max((end for end in UNITS if f"_{name}".endswith(f"_{end}")), key=len, default="")


def unit_of(name: str) -> str | None:
    """Return the unit in which a field of this name has its numbers, None if it has none."""
    return UNITS.get(_end(name))


def converted(name: str, other: str) -> float:
    """Return by what numbers of a column ``other`` become those of a field: 1e-3 of time_ms for time_s.

    It is 0 where they are not the same but for the unit.
    """
    stem = name.removesuffix(_end(name))
    if name == other or not other.startswith(stem):
        return float(name == other)
    factor = in_unit(f"1 {other.removeprefix(stem).replace('_', ' ')}", UNITS[_end(name)])
    return factor if isinstance(factor, float) else 0.0


def in_own_units(data: Mapping[str, Any], **units: str) -> dict[str, Any]:
    """Return fields with numbers in place of text with a unit, in lists and mappings too.

    ``units`` are those of fields whose names have none. Text that is no quantity of the field's kind stays
    text, and is refused later.
    """
    fields = ((name, value, units.get(name) or unit_of(name)) for name, value in data.items())
    return {name: in_unit(value, unit) if unit else value for name, value, unit in fields}


def in_unit(value: Any, unit: str) -> Any:
    """Return a value with every quantity in it as a number in a unit."""
    if isinstance(value, list | tuple):
        return [in_unit(each, unit) for each in value]
    if isinstance(value, Mapping):
        return {name: in_unit(each, unit) for name, each in value.items()}
    if not (isinstance(value, str) and (typed := QUANTITY.fullmatch(value))):
        return value
    registry = _registry()
    try:
        quantity = registry.Quantity(Decimal(typed["number"]), registry.parse_units(typed["unit"].strip()))
        number = float(quantity.to(registry.parse_units(unit)).magnitude)
    except Exception:  # pint raises errors of many kinds for what is no unit, AssertionError among them
        return value
    return number if math.isfinite(number) else value


@cache
def _registry() -> "UnitRegistry[Decimal]":
    """Return the units that may be typed; converted in decimal numbers, so that 50 mm are 0.05 m."""
    import pint  # which takes a moment, and most scenes have plain numbers

    return pint.UnitRegistry(Path(__file__).with_name("units.txt"), non_int_type=Decimal)
