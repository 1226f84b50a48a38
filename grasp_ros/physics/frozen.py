"""Records that are frozen all through: arrays that nobody can write to, mappings that nobody can change."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np


@cache
def _freezer(kind: type) -> Callable[[Any], Any] | None:
    """What freezes values of a type, found once for each type, for speed; None: the value is kept."""
    if issubclass(kind, np.ndarray):
        return _read_only
    if hasattr(kind, "items"):
        return lambda mapping: MappingProxyType({key: frozen(entry) for key, entry in mapping.items()})
    if issubclass(kind, tuple) and hasattr(kind, "_fields"):
        return lambda record: kind(*map(frozen, record))
    return None


def _read_only(array: Any) -> Any:
    view = array.view()
    view.setflags(0)  # write=False; by its place it takes half the time
    return view


def frozen(value: Any) -> Any:
    """The same value, read-only: arrays as a view, mappings as a copy."""
    freeze = _freezer(type(value))  # type: ignore[arg-type] # a type is hashable
    return freeze(value) if freeze else value


def _thawed(value: Any) -> Any:
    """What `frozen` has made of mappings, as `pickle` takes them."""
    return {key: _thawed(entry) for key, entry in value.items()} if isinstance(value, Mapping) else value


def _values(record: Any) -> tuple[Any, ...]:
    """What the fields of a record hold."""
    return tuple(getattr(record, own.name) for own in fields(record))


def _same(one: Any, other: Any) -> bool:
    """Whether two values are equal all through; NaN equals NaN."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        alike = type(one) is type(other) and one.dtype == other.dtype
        return alike and np.array_equal(one, other, one.dtype.kind == "f")
    if isinstance(one, Mapping):
        return isinstance(other, Mapping) and one.keys() == other.keys() and all(_same(one[k], other[k]) for k in one)
    if isinstance(one, tuple):
        return isinstance(other, tuple) and len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other or (one != one and other != other))


class Frozen:
    """Base of dataclasses with `frozen=True, eq=False` whose content is frozen as well.

    They can be copied, pickled and hashed; two are equal if all their fields are.
    """

    def __eq__(self, other: object) -> bool:
        """Whether all fields are equal."""
        return type(other) is type(self) and all(map(_same, _values(self), _values(other)))

    def __hash__(self) -> int:
        """By the texts among the fields: variants of a scene have one hash, and are told apart by their numbers."""
        return hash(tuple(text for text in _values(self) if isinstance(text, str)))

    def __post_init__(self) -> None:
        """Freeze all fields."""
        own = vars(self)
        own.update({name: frozen(value) for name, value in own.items()})

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        """A new record of the same fields."""
        return type(self), tuple(map(_thawed, _values(self)))
