"""All hard cases."""

from __future__ import annotations

from functools import lru_cache

from grasp_ros.verification import relations
from grasp_ros.verification.cases import flights, found, horizons, impacts, loops, modes, rest, touches
from grasp_ros.verification.cases.case import Case
from grasp_ros.verification.cases.families import ORDER


@lru_cache(maxsize=1)
def cases() -> tuple[Case, ...]:
    """Every case, family by family."""
    files = (impacts, touches, modes, rest, flights, horizons, loops, relations, found)
    every = [case for file in files for case in file.cases()]
    return tuple(sorted(every, key=lambda case: ORDER.index(case.family)))
