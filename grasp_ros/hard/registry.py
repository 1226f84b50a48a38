"""All hard cases."""

from __future__ import annotations

from functools import lru_cache

from grasp_ros.hard import flights, horizons, impacts, loops, relations, rest, switching, touches
from grasp_ros.hard.case import Case


@lru_cache(maxsize=1)
def cases() -> tuple[Case, ...]:
    """Every case, family by family."""
    files = (impacts, touches, switching, rest, flights, horizons, loops, relations)
    found = [case for file in files for case in file.cases()]
    families = list(dict.fromkeys(case.family for case in found))
    return tuple(sorted(found, key=lambda case: families.index(case.family)))
