"""All settings of several solvers within a time, and what to take of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter
from typing import NamedTuple

from grasp_ros.accuracy.measure import NOT_INSTALLED, Contender, Effort, Record, Truth, attempt
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene

QUICK = Effort(patience=0.8, budget=0.03, most=5)
SECONDS = 40.0
OTHERS = 3
TIME, ERROR, ERROR_THEN_TIME = attrgetter("time"), attrgetter("error"), attrgetter("error", "time")


class Advice(NamedTuple):
    """The best choice, what comes after it, and what was possible at all."""

    choice: Record | None
    others: list[Record]  # the best of other methods, the fastest first
    closest: Record  # the most accurate of all for an error, the fastest for a budget


def compare(scene: Scene, contenders: Sequence[Contender], truth: Truth, effort: Effort = QUICK,
            seconds: float = SECONDS, progress: Callable[[float], object] | None = None
            ) -> tuple[list[Record], list[str]]:
    """Measure solvers from their coarsest setting on; the next is the solver that has used the least time.

    A solver that has not begun counts as having used `effort.patience`, so that fast ones finish first; a solver whose
    run takes longer than that gets no finer setting. No measurement begins after `seconds`; `progress` gets the
    seconds used. Also returned: the names of solvers with settings not measured for lack of time.
    """
    begin = time.monotonic()
    records: list[Record] = []
    climbing = {contender: list(contender.ladder) for contender in contenders if contender.ladder}
    spent: dict[Contender, float] = {}
    while climbing and time.monotonic() - begin <= seconds:
        contender = min(climbing, key=lambda one: spent.get(one, effort.patience))
        record = attempt(contender, scene, climbing[contender].pop(0), truth, effort)
        records.append(record)
        least = record.first if record.least is None else record.least  # a first run may have compiled
        spent[contender] = spent.get(contender, 0.0) + least * (record.repeats + 1)
        slow = record.status == NOT_INSTALLED or least > effort.patience
        if slow or not climbing[contender]:
            del climbing[contender]
        if progress is not None:
            progress(min(time.monotonic() - begin, seconds))
    names = [contender.name for contender in contenders]
    return (sorted(records, key=lambda record: names.index(record.method)),
            [contender.name for contender in contenders if contender in climbing])


def by_method(records: Iterable[Record]) -> dict[str, list[Record]]:
    """Records of each method, in the order of their settings."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record.method, []).append(record)
    return groups


def fastest(records: Iterable[Record], error: float) -> Record | None:
    """The sound record that reaches an error in the least time."""
    return min((record for record in records if record.sound and ERROR(record) <= error), key=TIME, default=None)


def advise(records: Iterable[Record], error: float | None = None, budget: float | None = None) -> Advice:
    """The fastest setting that reaches an error in m and m/s, or the most accurate one within a budget in s.

    Runs of one scene are given; those that count touches wrongly or stop early are no choice.
    """
    check_wish(error, budget)
    sound = [record for record in records if record.sound]
    if not sound:
        raise Refused("no method has a result on this scene")
    limit, limited, best = (error, ERROR, TIME) if error is not None else (budget, TIME, ERROR_THEN_TIME)
    fit = [record for record in sound if limited(record) <= limit]
    found = sorted((min(group, key=best) for group in by_method(fit).values()), key=best)
    return Advice(found[0] if found else None, found[1 : 1 + OTHERS], min(sound, key=limited))


def check_wish(error: float | None, budget: float | None) -> None:
    """Refuse a wish that is not one positive number."""
    for name, wish in (("error", error), ("budget", budget)):
        if wish is not None and not wish > 0.0:
            raise Refused(f"{name} {wish!r} is not allowed; allowed: a number > 0")
    if (error is None) == (budget is None):
        raise Refused("error, budget: allowed: exactly one of them")
