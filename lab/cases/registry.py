"""All hard cases."""

from __future__ import annotations

from functools import lru_cache

from lab.cases import flights, horizons, impacts, loops, modes, touches
from lab.cases.case import Case
from lab.cases.families import ORDER
from lab.oracles import metamorphic


@lru_cache(maxsize=1)
def cases() -> tuple[Case, ...]:
    """Every case, family by family."""
    files = (impacts, touches, modes, flights, horizons, loops, metamorphic)
    every = [case for file in files for case in file.cases()]
    return tuple(sorted(every, key=lambda case: ORDER.index(case.family)))
