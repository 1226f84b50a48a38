"""What an effect is: everything that one section of a scene brings, in one record."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, Place, System
from grasp_ros.scene.parameter import Parameter
from grasp_ros.scene.topics import Topic

Numbers = Mapping[str, Any]  # one section of a scene: its keys and values
Sections = Mapping[str, Numbers]  # a whole scene
SIDES = {"left": LEFT, "right": RIGHT}
NANOSECONDS = 1_000_000_000


class Output(NamedTuple):
    """A force that the plant publishes at every tick."""

    topic: Topic
    value: Callable[[System, int, Array], float]  # system, tick, state (6,) to N


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
    row: int = 0  # of the numbers that have a place in arrays: a side or a body
    node: str = "plant"  # the executable that declares its parameters
    commands: Topic | None = None  # topic of the controller that it brings
    outputs: tuple[Output, ...] = ()  # what the plant publishes about it
    problems: Callable[[Sections], Iterable[str]] = nothing  # what is wrong beyond ranges
    oddities: Callable[[Sections, System], Iterable[str]] = nothing  # suspicious settings
    acts_by: tuple[str, ...] = ()  # keys of numbers without which, or where all are 0, it does nothing
    example: Numbers = field(default_factory=dict)  # keys to add to a scene to see what it does; none: the paper has it

    @cached_property
    def places(self) -> dict[str, Place]:
        """Where numbers go that enter in one place of the arrays alone, by key."""
        return {own.key: _place(self.row, *own.place) for own in self.parameters if own.place is not None}

    def warnings(self, sections: Sections, system: System) -> Iterable[str]:
        """Suspicious settings."""
        if self.acts_by and not any(np.any(sections[self.section].get(key, 0.0)) for key in self.acts_by):
            return [f"{self.section}: has no effect without {' or '.join(self.acts_by)}; meant: a number that is not 0"]
        return self.oddities(sections, system)


def _place(row: int, array: str, column: int) -> Place:
    if array == "state":
        return array, COLUMN[row] + column, 0
    return array, 0 if array == "coulomb" else int(row), int(column)


def nanoseconds(seconds: float) -> int:
    """A time in ns, rounded."""
    return round(seconds * NANOSECONDS)


def period_ns(sections: Sections) -> int:
    """Control period of a scene in ns."""
    return nanoseconds(sections["time"]["control_period_s"])
