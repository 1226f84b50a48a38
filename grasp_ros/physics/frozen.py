"""Records that are frozen all through: arrays that nobody can write to, mappings that nobody can change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any

import numpy as np


def frozen(value: Any) -> Any:
    """The same value, read-only: arrays as a view, mappings as a copy."""
    if isinstance(value, np.ndarray):
        view = value.view()
        view.setflags(write=False)
        return view
    if hasattr(value, "items"):  # a mapping; to ask for its abstract class would cost a short run a tenth
        return MappingProxyType({key: frozen(entry) for key, entry in value.items()})
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*map(frozen, value))
    return value


def _thawed(value: Any) -> Any:
    """What `frozen` has made of mappings, as `pickle` takes them."""
    return {key: _thawed(entry) for key, entry in value.items()} if isinstance(value, Mapping) else value


class Frozen:
    """Base of dataclasses with `frozen=True` whose content is frozen as well; they can be copied and pickled."""

    def __post_init__(self) -> None:
        """Freeze all fields."""
        own = vars(self)
        own.update({name: frozen(value) for name, value in own.items()})

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        """A new record of the same fields."""
        return type(self), tuple(_thawed(getattr(self, field.name)) for field in fields(self))  # type: ignore[arg-type]
