"""All hard cases."""

from __future__ import annotations

from functools import lru_cache

from grasp_ros.hard import flights, horizons, impacts, loops, relations, switching, touches
from grasp_ros.hard.case import Case


@lru_cache(maxsize=1)
def cases() -> tuple[Case, ...]:
    """Every case of every family, in the order of the table."""
    families = (impacts, touches, switching, flights, horizons, loops, relations)
    return tuple(case for family in families for case in family.cases())
