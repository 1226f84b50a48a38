"""Free numbers of a scene within ranges, and the best choice of them: for one outcome, or what one costs of another.

Settling times jump from swing to swing, and the best choice often lies beside such a jump, where no derivative points
to it. So it is sought by what needs none, differential evolution (R. Storn and K. Price, J. Global Optim. 11, 1997):
each generation is one ensemble. It begins with the best of a sample, as an outcome may exist in a small part of the
ranges only. Of ten starts of SLSQP, with central differences as derivatives, none ended within 1e-6 of the two gains of
case 1 that settle fastest under a bound on the inputs; at a smallest peak of the impacts, which is smooth, all ten did,
each with a fiftieth of the runs.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from grasp_ros.maps.plan import Axis, Plan
from grasp_ros.observe.record import Wanted
from grasp_ros.physics.errors import Refused, need
from grasp_ros.physics.frozen import Frozen
from grasp_ros.physics.given import mapping, names, number, read_number, whole
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import NAMES
from grasp_ros.scene import Scene
from grasp_ros.simulation.chunk import Setup, check
from grasp_ros.simulation.ensemble import ensemble
from grasp_ros.simulation.outcomes import GROUPS, find, wanted_by
from grasp_ros.simulation.progress import Callback, showing

SAMPLE = 512  # choices, of which the best are members of the first generation
MEMBERS, GENERATIONS = 16, 500  # members of a population for each free number; generations at most
AGREE = 1e-14  # standard deviation of what a population reaches, relative, at which a search ends
BESIDE = 0.01  # part of a range, from whose end a choice is so far that it is tried, too
NEAR, PLATEAU = 1e-5, 50  # part of the ranges in which a population that agrees must lie, or for how many generations
FRONT = 12  # choices along two outcomes
BROKEN, NOTHING = 1e100, 1e140  # above every outcome: a bound is broken; there is no outcome; squares are finite


class Bound(NamedTuple):
    """A largest value of an outcome."""

    outcome: str
    most: float


class Found(NamedTuple):
    """Of n choices of the free numbers: outcomes by name, and what is wrong with them."""

    outcomes: dict[str, Array]  # (n,) each; inf where a run has none
    excess: Array  # (n,) by how much, relative, they break the bounds
    stops: list[str]  # why choices were refused or stopped


class DesignProblem:
    """A scene, its free numbers with their ranges, outcomes to make small, and bounds; what cannot be is refused.

    Keys of an axis that are joined have one value; the search takes logarithmic ranges as such. `minimise` names one
    outcome or two, see `simulation.outcomes`, of a group the largest of its columns; `units` has their units. `setup`
    says how rows are run; its outcomes are those that are needed.
    """

    def __init__(self, scene: Scene, axes: Sequence[Axis], minimise: Sequence[str], bounds: Sequence[Bound] = (),
                 setup: Setup | None = None) -> None:
        minimise = names("minimise", minimise)
        if not 1 <= len(minimise) <= 2 or len(set(minimise)) < len(minimise):
            raise Refused(f"minimise: {', '.join(minimise) or 'nothing'}; allowed: one outcome, or two different ones")
        self.scene, self.minimise, self.bounds = scene, minimise, tuple(bounds)
        for bound in self.bounds:
            if not math.isfinite(bound.most):
                raise Refused(f"{bound.outcome} <= {bound.most!r} is not allowed; allowed: a finite number")
        self.names = tuple(dict.fromkeys([*minimise, *(bound.outcome for bound in bounds)]))
        self._columns = {name: find([name]) for name in self.names}
        for name, columns in self._columns.items():
            if len({column.unit for column in columns}) > 1:
                raise Refused(f"outcome {name}: has several units; allowed: one of {', '.join(GROUPS[name])}")
        self.units = {name: columns[0].unit for name, columns in self._columns.items()}
        self.setup, _ = check(scene, setup, self.names)
        absent = [f"_{NAMES[body]}" for body in scene.system.absent]
        for name in self.names:
            if any(body in name for body in absent):
                raise Refused(f"outcome {name}: {scene.name} has no such body; allowed: outcomes of those it has")
        self.axes = Plan(scene, self.setup, tuple(axes), sample=1).axes

    def numbers(self, parts: Array) -> dict[str, Array]:
        """Free numbers (n,) by their keys, at parts (n, k) of the ranges in [0, 1]."""
        return {key: axis.at(parts[:, i]) for i, axis in enumerate(self.axes) for key in axis.keys}

    def found(self, numbers: Mapping[str, Array]) -> Found:
        """Simulate choices, given as free numbers (n,) by their keys."""
        table = ensemble(self.scene, numbers, self.names, setup=self.setup)
        worst = {name: np.fmax.reduce([table.columns[column.name] for column in columns])  # nan: an absent body
                 for name, columns in self._columns.items()}
        outcomes = {name: np.where(np.isnan(own), np.inf, own) for name, own in worst.items()}  # none: as bad as can be
        excess: Array = np.zeros(len(table.status))
        for bound in self.bounds:
            excess += np.maximum(outcomes[bound.outcome] - bound.most, 0.0) / (abs(bound.most) or 1.0)
        return Found(outcomes, excess, [*table.stops.values()])

    def along(self, axis: Axis, numbers: Mapping[str, float], count: int) -> tuple[Array, Found]:
        """Values (count,) over the range of one free number, and what is found of them with the others as they are."""
        values = axis.at(np.linspace(0.0, 1.0, count))
        others = {key: np.full(count, value) for key, value in numbers.items()}
        return values, self.found({**others, **dict.fromkeys(axis.keys, values)})


def read_bound(text: str) -> Bound:
    """A bound from "OUTCOME<=NUMBER"; another text is refused."""
    name, _, most = re.sub(r"\s", "", text).partition("<=")
    try:
        return Bound(name, read_number(most))
    except ValueError:
        raise Refused(f"subject_to: {text}: not understood; allowed: OUTCOME<=NUMBER") from None


@dataclass(frozen=True, eq=False)
class Design(Frozen):
    """A choice of the free numbers.

    Attributes
    ----------
    scene : Scene
        With the numbers that were chosen.
    numbers : dict of str to float
        The free numbers by "section.key".
    outcomes : dict of str to float
        What comes of this scene, by a run of its own.
    runs : int
        Simulations that the search took.
    """

    scene: Scene
    numbers: dict[str, float]
    outcomes: dict[str, float]
    runs: int


def design(
    scene: Scene, free: Mapping[str, tuple[float, float]], minimise: str, subject_to: Mapping[str, float] | None = None,
    *, setup: Setup | None = None, seed: int = 0, progress: Callback | bool | None = None,
) -> Design:
    """Choose parameters of a scene that minimise an outcome.

    Parameters
    ----------
    scene : Scene
    free : mapping of str to (float, float)
        Parameters, "section.key", with their ranges (low, high); keys that share one value are joined by +.
    minimise : str
        One of `simulation.outcomes`; for a group, the largest of its columns.
    subject_to : mapping of str to float, optional
        Largest values of outcomes.
    setup : Setup, optional
        How each choice is simulated.
    seed
        See `search`.
    progress
        As in `ensemble`, but a callable gets the number of simulations so far.

    Raises
    ------
    Refused
        If a parameter, a range, an outcome or a bound is not allowed; and see `search`.
    """
    axes = []
    for name, ends in mapping("free", free).items():
        try:
            low, high = ends
        except (TypeError, ValueError):
            raise Refused(f"{name}: {ends!r} is not allowed; allowed: two numbers, low and high") from None
        axes.append(Axis(name, low, high))
    most = mapping("subject_to", {} if subject_to is None else subject_to)
    bounds = [Bound(name, number(name, value)) for name, value in most.items()]
    problem = DesignProblem(scene, axes, [minimise], bounds, setup)
    with showing(progress, None, "run", scene.name) as report:
        return search(problem, seed, report)


def search(problem: DesignProblem, seed: int = 0, progress: Callback | None = None) -> Design:
    """Find the choice whose first outcome is smallest within the bounds.

    Where the best choice is unique every seed ends there. `progress` gets the number of simulations so far. Refused:
    no choice was found that keeps the bounds and has the outcome, all have the same one, or scipy is not installed.
    """
    need("`grasp design`", "scipy")
    from scipy.optimize import differential_evolution

    runs, seed, worst = 0, whole("seed", seed, 0), -np.inf

    def function(parts: Array) -> Array:
        """The outcome; above all outcomes what breaks a bound, the less the better."""
        nonlocal runs, worst
        runs += parts.shape[1]
        if progress is not None:
            progress(runs)
        tried = problem.found(problem.numbers(np.ascontiguousarray(parts.T)))
        outcome = np.minimum(tried.outcomes[problem.minimise[0]], NOTHING)
        reached = np.where(tried.excess > 0.0, np.minimum(BROKEN * (1.0 + tried.excess), NOTHING), outcome)
        worst = max(worst, float(reached.max()))
        return reached

    agreed = 0  # generations in a row

    def is_over(intermediate_result: Any) -> bool:
        """Where all members have the same outcome at different points, one that is better may lie between them."""
        nonlocal agreed
        reached, points = intermediate_result.population_energies, intermediate_result.population
        agreed = agreed + 1 if np.std(reached) <= AGREE * abs(np.mean(reached)) else 0
        done = np.ptp(points, axis=0).max() <= NEAR or reached.min() >= NOTHING
        return bool(agreed > (0 if done else PLATEAU))

    found = differential_evolution(
        function, [(0.0, 1.0)] * len(problem.axes), init=_first_members(function, len(problem.axes), seed), rng=seed,
        maxiter=GENERATIONS, tol=0.0, atol=-1.0, callback=is_over,  # never by its own rule
        polish=False, updating="deferred", vectorized=True)
    ends = np.where(np.abs(found.x - np.rint(found.x)) < BESIDE, np.rint(found.x), found.x)
    single = np.where(np.eye(len(ends), dtype=bool), ends, found.x)
    points = np.vstack([ends, single, found.x])  # a population may stop just before an end
    reached = function(points.T)
    least = float(reached.min())
    best = problem.numbers(points[[int(np.argmax(reached <= least + AGREE * abs(least)))]])
    tried = problem.found(best)
    if least >= BROKEN:
        wish = " and ".join(f"{name} <= {most:g}" for name, most in problem.bounds)
        raise Refused(f"{problem.scene.name}: none of {runs} choices has a finite {problem.minimise[0]}"
                      + (f" with {wish}" if wish else "") + _why_none(problem, tried))
    if worst - least <= AGREE * abs(least):
        raise Refused(f"{problem.scene.name}: nothing to choose: {problem.minimise[0]} is {least:.10g} for all"
                      f" {runs} choices; allowed: parameters and ranges that change it")
    outcomes = {name: float(values[0]) for name, values in tried.outcomes.items()}
    numbers = {key: float(values[0]) for key, values in best.items()}
    return Design(problem.scene.changed(numbers), numbers, outcomes, runs)


def _first_members(function: Callable[[Array], Array], axes: int, seed: int) -> Array:
    """Members (n, axes) of the first generation: half of them the best of a sample, half spread over the ranges.

    Where few choices have the outcome, as many again are tried beside them: a generation of copies would not move.
    """
    from scipy.stats.qmc import Sobol

    rng, half = np.random.default_rng(seed), MEMBERS * axes // 2
    sample = Sobol(axes, rng=rng).random(max(SAMPLE, 2 ** math.ceil(math.log2(2 * half))))
    spread, reached = sample[:half], function(sample.T)
    there = sample[reached < NOTHING]
    if 0 < len(there) < half:
        apart = rng.uniform(-1.0, 1.0, sample.shape) * len(sample) ** (-1.0 / axes)  # to the next choices of the sample
        neighbours = np.clip(there[rng.integers(len(there), size=len(sample))] + apart, 0.0, 1.0)
        sample, reached = np.vstack([sample, neighbours]), np.concatenate([reached, function(neighbours.T)])
    return np.vstack([sample[np.argsort(reached, kind="stable")[:half]], spread])


def _why_none(problem: DesignProblem, nearest: Found) -> str:
    """What keeps the choice that breaks the bounds least from being one."""
    if nearest.stops:
        return f"; {nearest.stops[0]}"
    if 0.0 < nearest.excess[0] < np.inf:
        return "; the nearest has " + ", ".join(f"{name} {value[0]:.6g}" for name, value in nearest.outcomes.items())
    if wanted_by(find(problem.names)) & Wanted.SETTLING:
        return f"; {problem.scene.why_unsettled(problem.setup.sampled)}; last_outside needs no proof"
    if wanted_by(find(problem.names)) & Wanted.BOUND:
        return ("; a mass is outside the bound at the end of every run; allowed: a longer time.duration_s, or ranges"
                " in which all come to rest")
    return ""


def front(problem: DesignProblem, seed: int = 0, progress: Callback | None = None) -> list[Design]:
    """The Pareto front of the two outcomes of a problem, from the first outcome's best on.

    Each has the smallest first outcome for a bound on the second one; the bounds are even between the two ends. One
    under which no choice has the first outcome gives none. Of equal choices the first is kept. See `search`.
    """
    if len(problem.minimise) != 2:
        raise Refused(f"minimise: {', '.join(problem.minimise)}; allowed: two outcomes for a curve")
    first, second = problem.minimise
    choices: list[Design] = []

    def add(name: str, bounds: Sequence[Bound]) -> Design:
        before = sum(own.runs for own in choices)
        report = None if progress is None else lambda runs: progress(before + runs)
        names = (name, *(other for other in problem.minimise if other != name))  # one to make small, both to look at
        choices.append(search(DesignProblem(problem.scene, problem.axes, names, bounds, problem.setup), seed, report))
        return choices[-1]

    most, least = add(first, problem.bounds).outcomes[second], add(second, problem.bounds).outcomes[second]
    if not math.isfinite(most):  # the best choice of those that have the second outcome
        most = add(first, (*problem.bounds, Bound(second, sys.float_info.max))).outcomes[second]
    for level in np.linspace(most, least, FRONT)[1:]:
        with suppress(Refused):
            add(first, (*problem.bounds, Bound(second, max(float(level), least))))
    best: list[Design] = []  # than which no other one is better in one outcome and as good in the other
    for own in sorted(choices, key=lambda own: (own.outcomes[first], own.outcomes[second])):
        if not best or own.outcomes[second] < best[-1].outcomes[second]:
            best.append(own)
    return best
