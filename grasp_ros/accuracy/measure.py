"""What a solver must look like, the methods of `grasp simulate` in that shape, and one measurement against the truth.

A measurement is a solver at a setting, its first call apart from its repeats. The truth is the exact method at its
finest, with an estimate of its own error: a motion in double precision is known no better than the scene amplifies
roundings. So the estimate is the largest difference to runs that begin a rounding of the largest position beside the
initial state; or, if that is more, a tenth of the difference to a run with ten times the first neglected term.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import METHODS, check
from grasp_ros.physics.accuracy import FINEST
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import EPS, LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import BODIES
from grasp_ros.simulation.simulate import GRID_POINTS, simulate
from grasp_ros.simulation.trajectory import Trajectory

DONE = "done"
OURS = "grasp_ros"
NOT_INSTALLED = "not installed"
FINER = 10.0
SECONDS = 40.0
OTHERS = 3
TIME, ERROR, ERROR_THEN_TIME = attrgetter("time"), attrgetter("error"), attrgetter("error", "time")


class Truth(NamedTuple):
    """A motion that is known."""

    grid: Array  # (n,), s
    state: Array  # (n, 6), m and m/s
    touches: tuple[int, int]
    uncertainty: float = 0.0  # of the states, m and m/s


def finest(scene: Scene) -> Truth:
    """The motion of a scene to its end, and how well it is known."""
    grid = np.linspace(0.0, scene.duration, GRID_POINTS)
    run = simulate(scene, grid=grid, setting=FINEST)
    if run.status is not Status.DONE:
        raise Refused(f"{scene.name}: {run.stop}; allowed here: a scene that runs to its end")
    truth, rounding = Truth(grid, run.state, _touches(run)), EPS * float(np.nanmax(np.abs(run.state[:, 0::2])))
    apart = [distance(truth, simulate(scene, grid=grid, setting=FINER * FINEST).state) / FINER]
    for body in {*BODIES} & {*scene.values}:
        shifted = scene.changed({f"{body}.position_m": scene.values[body]["position_m"] + rounding})  # farther right
        apart.append(distance(truth, simulate(shifted, grid=grid, setting=FINEST).state))
    return truth._replace(uncertainty=max(apart))


def _touches(run: Trajectory) -> tuple[int, int]:
    return len(run.times(Transition.TOUCH, LEFT)), len(run.times(Transition.TOUCH, RIGHT))


def distance(truth: Truth, state: Array) -> float:
    """Largest difference of states (n, 6) to the last n of a motion that is known, m and m/s; without absent bodies."""
    known = truth.state[-len(state) :]
    return float(np.abs(state - known)[~np.isnan(known)].max(initial=0.0))


class Answer(NamedTuple):
    """What a solver delivers."""

    state: Array  # (n, 6), m and m/s; fewer rows than asked for if it failed
    touches: tuple[int, int] | None  # left and right; None: it does not look for them
    status: str  # DONE, or why it stopped
    steps: int | None = None  # None: the solver does not say
    right_hand_sides: int | None = None


Solve = Callable[[Array], Answer]  # from the output times, of which the last is the horizon


class Contender(NamedTuple):
    """A solver with the settings to try."""

    family: str  # the package that it comes from
    name: str
    knob: str
    ladder: tuple[float, ...]  # loose to tight
    build: Callable[[Scene, float], Solve]  # raises ImportError if the solver is not installed


def own_contenders(scene: Scene) -> tuple[list[Contender], dict[str, str]]:
    """The methods of `grasp simulate` that can treat a scene, and why the others cannot, by name."""
    found, others = [], {}
    for name in METHODS:
        try:
            check(name, scene, None, sampled=scene.sampled)
        except Refused as refusal:
            others[name] = str(refusal)
            continue
        own = contender_of(name)
        found.append(own._replace(ladder=tuple(setting for setting in own.ladder if setting <= scene.duration)))
    return found, others


def contender_of(name: str) -> Contender:
    """A method of `grasp simulate`."""
    method = METHODS[name]
    return Contender(method.package or OURS, name, method.knob, method.ladder, partial(simulated, name))


def simulated(name: str, scene: Scene, setting: float) -> Solve:
    """A method of `grasp simulate` as a contender builds it."""
    def solve(grid: Array) -> Answer:
        run = simulate(scene, grid=grid, method=name, setting=setting)
        touches, counts = _touches(run) if METHODS[name].events else None, run.counters
        steps = sum(counts.get(counter, 0) for counter in ("steps", "flights", "contact steps"))
        return Answer(run.state, touches,
                      DONE if run.status is Status.DONE else run.status.value, steps, counts.get("right hand sides"))

    return solve


class Effort(NamedTuple):
    """How much time measurements may take."""

    patience: float  # s; a solver that needs longer for one run climbs no further
    budget: float  # s, of the repeats of one setting
    most: int  # repeats


QUICK = Effort(patience=0.8, budget=0.03, most=5)


class Record(NamedTuple):
    """What was measured."""

    scene: str
    family: str
    method: str
    knob: str
    setting: float
    error: float | None  # largest, over all output times and states, m and m/s; None: no result
    seconds: float | None  # median of the warm runs
    least: float | None  # s
    repeats: int
    first: float  # s, of the first run, with what it compiles
    steps: int | None
    right_hand_sides: int | None
    found: tuple[int, int] | None  # touches
    there_are: tuple[int, int]
    status: str

    @property
    def missed(self) -> int | None:
        """Touches too few or too many; None: it does not look for them."""
        if self.found is None:
            return None
        return sum(abs(found - there) for found, there in zip(self.found, self.there_are, strict=True))

    @property
    def good(self) -> bool:
        """Whether there is a result, with its time."""
        return self.error is not None and self.seconds is not None and math.isfinite(self.error)

    @property
    def sound(self) -> bool:
        """Whether it has a result that may be used: to the end, and with the right number of touches."""
        return self.good and self.status == DONE and not self.missed

    @property
    def time(self) -> float:
        """Fastest warm run in s; infinite without one."""
        return math.inf if self.least is None else self.least


def attempt(contender: Contender, scene: Scene, setting: float, truth: Truth, effort: Effort) -> Record:
    """Build a solver, run it, and repeat it at least once, then as long as the effort lets it."""
    answer, error, begin = None, None, time.perf_counter()
    try:
        solve = contender.build(scene, setting)
        answer = solve(truth.grid)
    except ImportError:
        pass
    times = [time.perf_counter() - begin]
    if answer is not None and len(answer.state) == len(truth.grid):
        error = max(distance(truth, answer.state), truth.uncertainty)  # nothing is known better than that
        while len(times) == 1 or (sum(times[1:]) < effort.budget and len(times) <= effort.most):
            begin = time.perf_counter()
            solve(truth.grid)
            times.append(time.perf_counter() - begin)
    return record_of(contender, scene, setting, truth, NOT_INSTALLED if answer is None else answer.status, times,
                     answer, error)


def record_of(
    contender: Contender, scene: Scene, setting: float, truth: Truth, status: str, times: Sequence[float],
    answer: Answer | None = None, error: float | None = None,
) -> Record:
    """What was measured of a solver at a setting; `times` of its first run and of its warm ones, in s."""
    first, *warm = times
    return Record(
        scene.name, contender.family, contender.name, contender.knob, setting, error,
        statistics.median(warm) if warm else None, min(warm, default=None), len(warm), first,
        answer and answer.steps, answer and answer.right_hand_sides, answer and answer.touches, truth.touches, status)


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
