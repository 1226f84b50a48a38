"""Which variants of a scene a map holds: a grid over two numbers or one, or a sample of any number of them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import number, read_number, text, truth, whole
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.targets import parameter_of
from grasp_ros.simulation.chunk import Setup, Variants, check

POINTS, MOST, MOST_AXES, DIGITS = 101, 10**9, 2, 15


class Axis(NamedTuple):
    """A range of one number of a scene."""

    name: str  # "section.key", or several joined by +, which have the same value
    low: float
    high: float
    points: int = POINTS
    log: bool = False

    def at(self, parts: Array) -> Array:
        """Values (n,) at parts of the range in [0, 1]; both ends are exact."""
        if self.log:
            values = np.exp((1.0 - parts) * math.log(self.low) + parts * math.log(self.high))
        else:
            values = (1.0 - parts) * self.low + parts * self.high
        return np.asarray(np.where(parts == 0.0, self.low, np.where(parts == 1.0, self.high, values)))

    @property
    def keys(self) -> list[str]:
        """The numbers, each "section.key"."""
        return self.name.split("+")

    @property
    def values(self) -> Array:
        """Values (points,) of a grid, decimals of 15 digits between its ends: 1.07, not 1.0699999999999998."""
        values = self.at(np.arange(self.points) / (self.points - 1))
        size = values if self.log else max(abs(self.low), abs(self.high))
        scale = 10.0 ** (DIGITS - np.ceil(np.log10(size)))
        return np.concatenate([[self.low], (np.round(values * scale) / scale)[1:-1], [self.high]])


def read_axis(option: str, text: str, grid: bool = True) -> Axis:
    """An axis from "section.key[+section.key]=low:high[:n[:log]]"; n only of a grid. Another text is refused."""
    then = f"; then :n for 2 to {MOST:,} values; then :log" if grid else "; then ::log"
    allowed = f"allowed: section.key=low:high, + between keys with one value{then} for a log scale"
    match = re.fullmatch(r"([\w.+]+)=([^:]+):([^:]+)(?::(\d*)(?::(log))?)?", text)
    if match is None:
        raise Refused(f"{option} {text}: not understood; {allowed}")
    name, low, high, points, log = match.groups()
    if points and not grid:
        raise Refused(f"{option} {text}: n={points} is for a map's axes; {allowed}")
    try:
        return Axis(name, read_number(low), read_number(high), int(points or POINTS), bool(log))
    except ValueError:
        raise Refused(f"{option} {text}: not understood; {allowed}") from None


@dataclass(frozen=True)
class Plan:
    """All that the numbers of a map depend on; refused where the scene has not the outcomes, the axes or their ends."""

    scene: Scene
    setup: Setup
    axes: tuple[Axis, ...]  # of a grid: y and x, or x alone; of a sample: any number
    sample: int = 0  # rows of a sample; 0: a grid
    seed: int = 0

    def __post_init__(self) -> None:
        """Check all, and take numbers of Python's own, which a file takes."""
        axes = tuple(
            Axis(text("axes", name), number(f"{name}: low", low), number(f"{name}: high", high),
                 whole(f"{name}: points", points, 2), truth(f"{name}: log", log))
            for name, low, high, points, log in self.axes)
        own = {"setup": check(self.scene, self.setup)[0], "axes": axes, "sample": whole("sample", self.sample, 0),
               "seed": whole("seed", self.seed, 0)}
        for name, value in own.items():
            object.__setattr__(self, name, value)
        names = [key for axis in self.axes for key in axis.keys]
        if not names or len(set(names)) < len(names):
            raise Refused(f"parameters to vary: {', '.join(names) or 'none'}; allowed: one or more keys, each once")
        if not self.sample and len(self.axes) > MOST_AXES:
            raise Refused(f"axes: {len(self.axes)}; allowed: {MOST_AXES} of a map, any number of a sample")
        if self.rows > MOST:
            raise Refused(f"{'sample' if self.sample else 'axes'}: {self.rows:,} runs; allowed: at most {MOST:,}")
        for axis, key in [(own, key) for own in self.axes for key in own.keys]:
            if not -math.inf < axis.low < axis.high < math.inf or (axis.log and axis.low <= 0.0):
                raise Refused(f"{key}: {axis.low!r} to {axis.high!r} is not allowed; allowed: low < high, and > 0 where"
                              " logarithmic")
            parameter = parameter_of(self.scene, key)
            if parameter.whole:
                raise Refused(f"{self.scene.name}: {key}: takes whole numbers; allowed: real-valued")
            for end in (axis.low, axis.high):
                if not parameter.accepts(end):
                    raise Refused(f"{self.scene.name}: {key}: {end!r} is not allowed; allowed: {parameter.allowed}")

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the outcomes: (n,) of a sample, (y, x) or (x,) of a grid."""
        return (self.sample,) if self.sample else tuple(axis.points for axis in self.axes)

    @property
    def rows(self) -> int:
        """Number of runs."""
        return math.prod(self.shape)

    def variants(self, first: int, last: int) -> Variants:
        """The rows from the first to before the last one."""
        if self.sample:
            columns = [np.ascontiguousarray(column) for column in self._sample[first:last].T]
        else:
            indices = np.unravel_index(np.arange(first, last), self.shape)
            columns = [axis.values[index] for axis, index in zip(self.axes, indices, strict=True)]
        pairs = zip(self.axes, columns, strict=True)
        return Variants(self.scene, {key: column for axis, column in pairs for key in axis.keys})

    @cached_property
    def _sample(self) -> Array:
        """Values (n, axes): a scrambled Sobol sequence."""
        from scipy.stats import qmc

        n = self.sample
        sequence = qmc.Sobol(len(self.axes), rng=np.random.default_rng(self.seed))
        parts = sequence.random(2 ** max(math.ceil(math.log2(n)), 0))[:n]
        return np.stack([axis.at(parts[:, i]) for i, axis in enumerate(self.axes)], axis=1)

    def to_document(self) -> dict[str, Any]:
        """Everything as JSON has it."""
        return {
            "scene_name": self.scene.name, "scene": self.scene.to_yaml(), "setup": self.setup._asdict(),
            "axes": [axis._asdict() for axis in self.axes], "sample": self.sample, "seed": self.seed,
        }

    @staticmethod
    def from_document(document: dict[str, Any]) -> Plan:
        """The plan of a document."""
        scene = scenes.parse(document["scene"], document["scene_name"], document["scene_name"])
        axes = tuple(Axis(**axis) for axis in document["axes"])
        return Plan(scene, Setup(**document["setup"]), axes, document["sample"], document["seed"])
