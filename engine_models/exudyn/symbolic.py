"""Functions that Exudyn evaluates by itself: recorded once as expressions, they take no Python in a run."""

from collections.abc import Sequence
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from numpy.typing import NDArray
from scipy.interpolate import PPoly

#: The constructors and functions of expressions; they carry no types.
symbolic: Any = exu.symbolic  # type: ignore[attr-defined]


def user_function(mbs: exu.MainSystem, item: str, name: str, arguments: Sequence[Any], value: Any) -> Any:
    """Return an item's user function of a name: a value, recorded of the arguments behind the system itself.

    The item that gets it keeps it. Exudyn's own ``CreateSymbolicUserFunction`` records vectors without
    entries, of which nothing can be taken, and the system among the arguments: then neither is ever freed.
    """
    kinds, _, (result, *_), *_ = itemInterface.userFunctionArgsDict[f"{item},{name}"]
    recorded = {
        "functionName": name,
        "argList": [None, *arguments],
        "argTypeList": kinds,
        "returnValue": value,
        "returnType": result,
    }
    function = symbolic.UserFunction()
    function.SetUserFunctionFromDict(mbs, recorded, name, None, item)
    return function


def piecewise(x: Any, spline: PPoly) -> Any:
    """Return a piecewise polynomial of an expression; the first and the last piece go on beyond the knots.

    The piece is found by halving: of n pieces, an evaluation compares log2(n) knots.
    """
    return _pieces(x, spline.x[:-1], spline.c.T)


def _pieces(x: Any, begins: NDArray[np.float64], coefficients: NDArray[np.float64]) -> Any:
    """Return the pieces (k,) that begin at knots, with coefficients (k, degree + 1), the highest first."""
    middle = len(begins) // 2
    if middle == 0:
        value, since = symbolic.Real(float(coefficients[0, 0])), x - float(begins[0])
        for coefficient in coefficients[0, 1:]:
            value = value * since + float(coefficient)
        return value
    return symbolic.IfThenElse(
        x < float(begins[middle]),
        _pieces(x, begins[:middle], coefficients[:middle]),
        _pieces(x, begins[middle:], coefficients[middle:]),
    )
