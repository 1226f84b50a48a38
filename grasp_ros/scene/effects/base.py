"""What an effect is: everything that one section of a scene brings, in one record; and what each of its numbers is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np

from grasp_ros.physics.domain import SMALLEST
from grasp_ros.physics.given import plain
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, System, Target
from grasp_ros.scene.topics import Topic

Numbers = Mapping[str, Any]  # one section of a scene: its keys and values
Sections = Mapping[str, Numbers]  # a whole scene
SIDES = {"left": LEFT, "right": RIGHT}
BODIES = {"left_arm": LEFT, "object": OBJECT, "right_arm": RIGHT}  # by section
NANOSECONDS = 1_000_000_000
UNITS = {  # endings of keys; the longest that fits counts
    "_kg": "kg", "_m": "m", "_s": "s", "_N": "N", "_Hz": "Hz", "_rad": "rad", "_m_per_s": "m/s", "_m_per_s2": "m/s^2",
    "_N_per_m": "N/m", "_Ns_per_m": "N s/m", "_N_per_m1_5": "N/m^1.5", "_s_per_m": "s/m", "_ticks": "control periods",
    "_seed": "1",
}


@cache
def ending_of(key: str) -> str:
    """The ending of a key that says its unit; empty if none does."""
    return max((ending for ending in UNITS if key.endswith(ending)), key=len, default="")


def _short(number: float) -> str:
    """A bound in few digits, but all that it has."""
    text = f"{number:g}"
    return text if float(text) == number else repr(number)


class Parameter(NamedTuple):
    """One number of a scene, or one list of numbers."""

    key: str  # ends with its unit
    low: float
    high: float
    text: str
    open_low: bool = False  # whether low itself is excluded
    optional: bool = False  # without it, what it describes is not there
    live: bool = False  # whether it may be set while the graph runs
    whole: bool = False
    several: bool = False
    smallest: float = SMALLEST  # of what is not 0
    target: tuple[str, int] | None = None  # array of a system and column, where it goes straight into one

    @property
    def unit(self) -> str:
        """The unit of the key's ending."""
        return UNITS[ending_of(self.key)]

    @property
    def allowed(self) -> str:
        """The range in words."""
        kind = "a whole number" if self.whole else "a number"
        span = f"{kind} {'>' if self.open_low else '>='} {_short(self.low)} and <= {_short(self.high)}"
        if self.has_smallest:
            span += f", of a size >= {self.smallest:g}" + ("" if self.open_low and self.low == 0.0 else " or 0")
        return f"a list of at least one entry, each {span}" if self.several else span

    @property
    def has_smallest(self) -> bool:
        """Whether numbers in the range may come close to 0."""
        return not self.whole and self.smallest > max(self.low, 0.0)

    def accepts(self, value: Any) -> bool:
        """Whether a value from a file, or from Python, is of the right kind and in the range; NaN is in no range."""
        if self.several:
            row = isinstance(value, (list, tuple)) or (hasattr(value, "__array__") and getattr(value, "ndim", 0) == 1)
            return row and len(value) > 0 and all(map(self._replace(several=False).accepts, value))
        number = plain(value)
        return number is not None and bool(self.holds(number))

    def read(self, value: Any) -> Any:
        """An accepted value as float, int or tuple of floats."""
        if self.several:
            return tuple(float(entry) for entry in value)
        return int(value) if self.whole else float(value)

    def holds(self, values: Any) -> Any:
        """Whether a number, or each of some in an array, is in the range; NaN is in none."""
        within = (self.low < values if self.open_low else self.low <= values) & (values <= self.high)
        if self.whole:  # 7.0 is whole: messages carry nothing else
            within = within & (values % 1 == 0)
        return within & ((values == 0.0) | (abs(values) >= self.smallest)) if self.has_smallest else within


class Output(NamedTuple):
    """A force that the plant publishes at every tick."""

    topic: Topic
    value: Callable[[System, int, Array], float]  # system, tick, state (6,) to N


class Relation(NamedTuple):
    """What numbers of a scene must obey together, each of which is in its range."""

    text: str  # for the page of the domain
    why: str
    problems: Callable[[Sections], Iterable[str]]  # how a scene breaks it, see `problem`


def problem(key: str, value: object, allowed: str) -> str:
    """Why numbers that are each in their range do not go together."""
    return f"{key}: {value!r} is not allowed; allowed: {allowed}"


def oddity(key: str, value: object, why: str, meant: str) -> str:
    """What is suspicious about a setting that is valid."""
    return f"{key}: {dict(value) if isinstance(value, Mapping) else value!r} {why}; meant: {meant}"


def nothing(*_: object) -> Any:
    """For effects whose numbers go straight into arrays, go together in any way, and always do something."""
    return ()


@dataclass(frozen=True)
class Effect:
    """One section of a scene."""

    section: str  # its name in a scene; the effect is there if the scene names it
    text: str  # what it simulates, in one line
    parameters: tuple[Parameter, ...]
    build: Callable[[Sections, System], None]  # adds to the system what is more than numbers in their places
    certificate: str  # what it does to V_c, in words
    needs: tuple[str, ...] = ()  # sections that must be there as well
    row: int = 0  # of the numbers that have a target: a side or a body
    node: str = "plant"  # the executable that declares its parameters
    commands: Topic | None = None  # topic of the controller that it brings
    outputs: tuple[Output, ...] = ()  # what the plant publishes about it
    relations: tuple[Relation, ...] = ()  # what its numbers must obey beyond their ranges
    oddities: Callable[[Sections, System], Iterable[str]] = nothing  # suspicious settings
    acts_by: tuple[str, ...] = ()  # keys of numbers without which, or where all are 0, it does nothing
    example: Numbers = field(default_factory=dict)  # keys to add to a scene to see what it does; none: the paper has it

    @cached_property
    def targets(self) -> dict[str, Target]:
        """Where numbers go that enter in one number of the arrays alone, by key."""
        return {own.key: _target(self.row, *own.target) for own in self.parameters if own.target is not None}

    def warnings(self, sections: Sections, system: System) -> Iterable[str]:
        """Suspicious settings."""
        if self.acts_by and not any(np.any(sections[self.section].get(key, 0.0)) for key in self.acts_by):
            return [f"{self.section}: has no effect without {' or '.join(self.acts_by)}; meant: a number that is not 0"]
        return self.oddities(sections, system)


def _target(row: int, array: str, column: int) -> Target:
    if array == "state":
        return array, COLUMN[row] + column, 0
    return array, 0 if array == "coulomb" else int(row), int(column)
