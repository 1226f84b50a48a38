"""Least squares with exact derivatives, over a horizon that grows, so that a wrong start does not end far away.

A motion through many contacts has a sum of squares with many minima: contacts that come too late or too early look
alike. Over a short horizon it has one, and what is found there starts the next horizon (a form of multiple shooting,
H. G. Bock, Recent advances in parameter identification techniques for O.D.E., 1983, without states of its own).
Beside the measurement each number is expected near its start, with a standard deviation of y = 1, a factor of ten: what
the data do not see stays there. At last each is expected where it was found, and sought from there as it is, not by its
logarithm: so that what the data see is where they see it, 0 included.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.identification.measured import CHANNELS, FEWEST, Measured
from grasp_ros.identification.numbers import Number, acts
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import Entry, Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene, compose
from grasp_ros.sensitivity.directions import directions
from grasp_ros.sensitivity.run import Carrier
from grasp_ros.simulation.differentiate import complete
from grasp_ros.simulation.sampled_plant import SampledPlant, tick_of

GROWTHS = (2.0, math.sqrt(2.0))  # of the horizon; the second where the first does not lead to a fit
FIRST = 16.0  # part of the motion that is the first horizon
GOOD = 4.0  # mean square of residuals, in those of the noise, above which a search has not found the motion
FAR, PART = 10.0, 0.2  # of the scatter, and of the motion: residuals above both are those of another motion
ROUGH, FINE = 1e-3, 1e-6  # relative change of the sum of squares at which a search ends, on the way and at last
SHORTEST = 1e-10  # step of y, relative
MOST = 30  # motions of one horizon
WORK, WORK_OF_TICK = 2 * 10**5, 10  # budget of a motion, some seconds, and more for each of its control periods
FLOOR = 1e-9  # of the spread of a channel, or of others of its kind where it stands still: the least noise


class FitProblem(NamedTuple):
    """What is searched: numbers of the scene of the data that let its motion be the measured one."""

    data: Measured
    numbers: tuple[Number, ...]
    noise: Array  # (6,) standard deviation of each channel

    def values(self, y: Array) -> dict[str, float]:
        """The free numbers by key."""
        return {number.key: float(number.at(own)) for number, own in zip(self.numbers, y.tolist(), strict=True)}

    def linear_from(self, y: Array) -> FitProblem:
        """The problem that begins at y, see `Number.linear_from`."""
        values = self.values(y).values()
        return self._replace(numbers=tuple(map(Number.linear_from, self.numbers, values)))

    def fixed(self, key: str, value: float) -> FitProblem:
        """The problem in which one of the numbers has a value."""
        return self._replace(numbers=tuple(
            number._replace(start=value, width=0.0, least=-np.inf) if number.key == key else number
            for number in self.numbers))

    def scene_at(self, y: Array) -> Scene:
        """The scene with the free numbers; outside its domain it is refused."""
        values = self.values(y)
        return self.data.scene.changed(
            {number.key: values[number.key] for number in self.numbers if number.channel is None})

    def predict(self, y: Array, rows: int) -> tuple[Array, Array, Array]:
        """What is measured of the motion (rows, 6), its derivatives by y (rows, 6, n), and its touches.

        Numbers outside the domain, and a run that does not get there, are refused.
        """
        indices = [i for i, number in enumerate(self.numbers) if number.channel is None]
        keys = [self.numbers[i].key for i in indices]
        states, found, touches = motion(self.data, self.scene_at(y), keys, rows)
        rates, values = np.zeros((*states.shape, len(y))), self.values(y)
        rates[:, :, indices] = found
        for i, number in enumerate(self.numbers):
            if number.channel is not None:
                states[:, number.channel] += values[number.key]
                rates[:, number.channel, i] = 1.0
            rates[:, :, i] *= number.slope(values[number.key])
        return states, rates, touches

    def residuals(self, y: Array, rows: int) -> tuple[Array, Array]:
        """Residuals (rows k,) of the k channels in standard deviations, row by row, and their derivatives by y."""
        states, rates, _ = self.predict(y, rows)
        seen = self.data.channels
        scaled = (states[:, seen] - self.data.state[:rows, seen]) / self.noise[seen]
        return scaled.ravel(), (rates[:, seen] / self.noise[seen, None]).reshape(scaled.size, -1)


def search(problem: FitProblem) -> Array:
    """The free numbers (n,) as y, from their starts; a scene that cannot be run as it is is refused."""
    begin = np.zeros(len(problem.numbers))
    problem.residuals(begin, FEWEST)  # a start that is refused says why
    best, least = begin, math.inf
    for growth in GROWTHS:
        y, rows = begin, len(problem.data.t)
        for step in range(math.ceil(math.log(FIRST, growth) - 1e-9), -1, -1):
            before, y = y, refine(problem, y, max(round(rows * growth**-step), min(FEWEST, rows)), ROUGH)
            if y is before:  # nor does it get farther
                break
        size = mean_square(problem, y)
        if size < least:
            best, least = y, size
        if least <= GOOD:
            break
    if not math.isfinite(least):
        start = ", ".join(f"{key} {value:g}" for key, value in problem.values(begin).items())
        raise Refused(f"{problem.data.name}: {start}: with these starts no run of {problem.data.scene.name} reaches its"
                      " end; allowed: others")
    return best


def mean_square(problem: FitProblem, y: Array) -> float:
    """Mean square of the residuals in variances of the noise; infinite if the motion does not get to its end."""
    try:
        return float(np.mean(problem.residuals(y, len(problem.data.t))[0] ** 2))
    except Refused:
        return math.inf


def refine(problem: FitProblem, begin: Array, rows: int, enough: float = FINE) -> Array:
    """The next minimum of the sum of squares over the first rows, from y = begin (n,).

    It is `begin` itself if no motion gets there. It ends where the sum changes by no more than `enough`, relative.
    """
    from scipy.optimize import least_squares

    seen, n = len(problem.data.channels), len(begin)

    @lru_cache(maxsize=1)
    def both(step: bytes) -> tuple[Array, Array]:
        y = begin + np.frombuffer(step)
        try:
            values, slopes = problem.residuals(y, rows)
        except Refused:  # no motion there: the next step is shorter
            values, slopes = np.full(rows * seen, np.nan), np.zeros((rows * seen, n))
        return np.concatenate([values, y]), np.concatenate([slopes, np.eye(n)])

    nowhere = np.zeros(n)  # from 0 scipy tries steps up to 1 at first, from elsewhere up to as far as that is from 0
    if not np.isfinite(both(nowhere.tobytes())[0]).all():
        return begin
    with np.errstate(all="ignore"):  # of motions far off, and of numbers that are fixed
        away, width = np.array([(number.least - number.start, number.width) for number in problem.numbers]).T
        least = away / width - begin
        found = least_squares(
            lambda step: both(step.tobytes())[0], nowhere, lambda step: both(step.tobytes())[1], (least, np.inf), "trf",
            ftol=enough, xtol=SHORTEST, gtol=None, max_nfev=MOST)
    return np.asarray(begin + found.x)


def first_noise(data: Measured) -> Array:
    """Noise (6,) of each channel before any fit: the median distance of samples from the line of their neighbours."""
    t, state = data.t, data.state
    part = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    away = np.abs(state[1:-1] - (1.0 - part) * state[:-2] - part * state[2:])
    away /= np.sqrt(1.0 + part**2 + (1.0 - part) ** 2)
    return _at_least(np.median(away, axis=0) / 0.6745, data)  # of a normal distribution


def _at_least(noise: Array, data: Measured) -> Array:
    spread = np.ptp(data.state, axis=0)
    others = np.tile(np.fmax.reduce(spread.reshape(3, 2)), 3)
    return np.asarray(np.maximum(noise, FLOOR * np.where(spread == 0.0, others, spread)))


def missed(data: Measured, noise: Array) -> tuple[str, ...]:
    """Channels whose residuals, of a size (6,), are far above the scatter of samples, and a part of the motion itself.

    It is the largest motion of a channel of the kind, position or velocity, because that of one may be little.
    """
    spread = np.tile(np.fmax.reduce(np.std(data.state, axis=0).reshape(3, 2)), 3)
    far = (noise > FAR * first_noise(data)) & (noise > PART * spread)
    return tuple(CHANNELS[i] for i in data.channels if far[i])


def fitted(problem: FitProblem) -> FitProblem:
    """The problem with its free numbers, at y = 0, and the noise of their residuals; refused as in `search`."""
    problem = problem.linear_from(search(problem))
    rows, nothing = len(problem.data.t), np.zeros(len(problem.numbers))
    for _ in range(2):  # the weights of the channels, and the minimum that belongs to them
        problem = problem.linear_from(refine(problem, nothing, rows))
        residuals = problem.predict(nothing, rows)[0] - problem.data.state
        problem = problem._replace(noise=_at_least(np.sqrt(np.mean(residuals**2, axis=0)), problem.data))
    return problem.linear_from(refine(problem, nothing, rows))


def motion(data: Measured, scene: Scene, keys: Sequence[str], rows: int) -> tuple[Array, Array, Array]:
    """States (rows, 6) at the first times of a measurement, their derivatives (rows, 6, n), and touches (k, 2).

    A touch is its time in s and its side. Recorded inputs act as they were; without them the controllers of the scene.
    A run that does not get there is refused.
    """
    times = data.t[:rows]
    if data.inputs is None:  # up to the first tick behind the last of these times
        if (ticks := int(tick_of(scene, times[-1:])[0]) + 1) < scene.ticks:
            scene = scene.changed({"time.duration_s": scene.time_of(ticks)})
    else:  # all that acts from outside is known: of the scene bodies and contacts are left
        kept = [section for section in scene.values if not acts(scene, section) and section != "loop"]
        scene = compose(scene.name, {section: scene.values[section] for section in kept})
    integrator = Integrator(scene.system, continuous=not data.sampled, max_work=WORK + WORK_OF_TICK * scene.ticks)
    carrier = Carrier(scene, integrator, directions(scene, keys, data.sampled), times, data.sampled)
    if data.inputs is None:
        states = complete(scene, integrator, data.sampled, times)
    else:
        plant = SampledPlant(scene.system, scene.period_ns, integrator)
        states = np.vstack([plant.follow(data.inputs[: rows - 1]), plant.state])
        if plant.status is not Status.DONE:
            raise Refused(f"{scene.name}: {plant.stop}")
    carrier.finish()
    events = integrator.event_table
    return states, carrier.out, events[events[:, Entry.KIND] == Transition.TOUCH][:, [Entry.TIME, Entry.BODY]]
