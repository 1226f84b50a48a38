"""Arguments of callers, converted and checked once: numbers and times of Python, numpy, pandas and xarray.

Whatever is a real number counts as one, whatever its type; texts, truth values and times where a number is meant do
not. What is not taken raises `Refused`, with the name of the argument, its value and what is allowed.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from datetime import timedelta
from numbers import Integral, Real
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.errors import Refused

SECOND = np.timedelta64(1, "s")


def plain(value: Any) -> int | float | None:
    """A real number as int or float; None for anything else."""
    if type(value) in (int, float):  # most are: the abstract classes of numbers are slow
        return value  # type: ignore[no-any-return]
    if isinstance(value, (bool, np.bool_, np.timedelta64)):
        return None
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value)
    if hasattr(value, "__array__") and getattr(value, "ndim", None) == 0 and not isinstance(value, np.generic):
        return plain(np.asarray(value)[()])
    return None


def number(name: str, value: Any) -> float:
    """A number."""
    found = plain(value)
    if found is None:
        raise Refused(f"{name}: {value!r} is not allowed; allowed: a number")
    return float(found)


def read_number(text: str) -> float:
    """A number from a text; otherwise a ValueError, also for 1_0, which Python takes."""
    if "_" in text:
        raise Refused(f"could not convert string to float: {text!r}")
    return float(text)


def whole(name: str, value: Any, low: int) -> int:
    """A whole number >= low; 1e7 is one."""
    if type(value) is int and value >= low:  # most are
        return value
    found = plain(value)
    if found is None or not math.isfinite(found) or found != math.floor(found) or found < low:
        raise Refused(f"{name}: {value!r} is not allowed; allowed: a whole number >= {low}")
    return int(found)


def truth(name: str, value: Any) -> bool:
    """True or False, 1 or 0: a text that says no would count as true."""
    if not isinstance(value, (bool, np.bool_)) and plain(value) not in (0, 1):
        raise Refused(f"{name}: {value!r} is not allowed; allowed: True or False")
    return bool(value)


def names(name: str, values: Any) -> tuple[str, ...]:
    """Texts in a row; one alone is a row of one."""
    several = isinstance(values, Iterable) and not isinstance(values, (str, Mapping))
    found = tuple(values) if several else (values,)
    if not all(isinstance(entry, str) for entry in found):
        raise Refused(f"{name}: {values!r} is not allowed; allowed: a list of texts")
    return tuple(map(str, found))


def instance(name: str, value: Any, kinds: type | tuple[type, ...], what: str) -> Any:
    """What is of some type."""
    if not isinstance(value, kinds):
        raise Refused(f"{name}: {type(value).__name__} is not allowed; allowed: {what}")
    return value


def text(name: str, value: Any) -> str:
    """A text, see `instance`."""
    return str(instance(name, value, str, "a text"))


def path(name: str, value: Any) -> Path:
    """A path, see `instance`; no empty text, which would be the working directory."""
    if instance(name, value, (str, os.PathLike), "a path") == "":
        raise Refused(f"{name}: '' is not allowed; allowed: a path")
    return Path(value)


def mapping(name: str, values: Any) -> dict[Any, Any]:
    """What a dict, or a table of columns, maps."""
    if not hasattr(values, "keys"):
        raise Refused(f"{name}: {values!r} is not allowed; allowed: a dict")
    return values.copy() if type(values) is MappingProxyType else dict(values)  # its own copy is faster


def column(name: str, values: Any) -> NDArray[np.float64]:
    """Numbers (n,) from anything that holds them in a row, a generator as well; always a new array."""
    return _row(name, _array(name, values))


def _row(name: str, array: NDArray[Any]) -> NDArray[np.float64]:
    if array.ndim != 1:
        raise Refused(f"{name}: shape {array.shape} is not allowed; allowed: (n,)")
    if array.dtype.kind not in "fiu":
        first = f"{array.flat[0]!r}, {array.dtype}," if array.size else array.dtype
        raise Refused(f"{name}: {first} is not allowed; allowed: numbers (n,)")
    return array.astype(np.float64)


def times(name: str, values: Any, several: bool = False) -> NDArray[np.float64]:
    """Times (n,) in s from numbers, one number, or lengths of time of Python, numpy or pandas; always a new array.

    `several`: of any shape, that of the values.
    """
    array = _array(name, values)
    if array.dtype.kind == "O" and array.size and all(isinstance(entry, timedelta) for entry in array.flat):
        array = array.astype("timedelta64[us]")
    if array.dtype.kind == "m":
        array = array / SECOND
    found = _row(name, array.ravel() if several or array.ndim == 0 else array)
    return found.reshape(array.shape) if several else found


def ascending(name: str, values: Any, end: float, strictly: bool = False) -> NDArray[np.float64]:
    """Times (n,) in s that ascend from 0 to an end, see `times`; strictly: each is there once."""
    found = times(name, values)
    after = np.greater if strictly else np.greater_equal
    within = not len(found) or (found.item(0) >= 0.0 and found.item(-1) <= end)  # of floats: a short run feels arrays
    if not (within and (len(found) < 2 or after(found[1:], found[:-1]).all())):
        i = int(np.argmin(np.append(found[:1] >= 0.0, after(found[1:], found[:-1])) & (found <= end)))
        late = f" after {float(found[i - 1])!r}" if i else ""
        once = ", each once" if strictly else ""
        raise Refused(f"{name}: {float(found[i])!r}{late} is not allowed; allowed: ascending from 0 to {end!r} s"
                      + once)
    return found


def forces(name: str, values: Any) -> NDArray[np.float64]:
    """Three finite forces (3,) in N, by body; always a new array."""
    array = column(name, values)
    if array.shape != (3,) or not all(map(math.isfinite, array.tolist())):  # faster than numpy, in a graph's every step
        raise Refused(f"{name}: {values!r} is not allowed; allowed: three finite numbers, N by body")
    return array


def rows(name: str, values: Any, width: int) -> NDArray[np.float64]:
    """Numbers (..., width)."""
    array = _array(name, values)
    if array.dtype.kind not in "fiu" or array.shape[-1:] != (width,):
        raise Refused(f"{name}: {array.dtype}, shape {array.shape}, is not allowed; allowed: numbers (..., {width})")
    return array.astype(np.float64, copy=False)


def check_rows(**arrays: NDArray[np.float64] | None) -> None:
    """Refuse arrays (..., k) that do not have equally many rows, or one, each."""
    shapes = {name: np.shape(array) for name, array in arrays.items() if array is not None}
    try:
        np.broadcast_shapes(*(shape[:-1] for shape in shapes.values()))
    except ValueError:
        shown = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise Refused(f"shape of {shown} is not allowed; allowed: as many rows in each, or one") from None


def _array(name: str, values: Any) -> NDArray[Any]:
    """What numpy makes of it."""
    if type(values) is np.ndarray and values.dtype.kind == "f":  # most are: what follows costs a short run its time
        return values
    try:
        array = np.asarray(list(values) if isinstance(values, Iterator) else values)
    except (TypeError, ValueError) as error:
        raise Refused(f"{name}: {error}; allowed: numbers (n,)") from None
    if isinstance(values, np.ma.MaskedArray) and np.ma.getmaskarray(values).any():
        raise Refused(f"{name}: some are masked; allowed: numbers (n,)")
    numbers = array.dtype.kind == "O" and all(plain(entry) is not None for entry in array.flat)
    return array.astype(np.float64) if numbers else array
