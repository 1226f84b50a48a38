"""What a user controller may observe besides its arm, by the names of its parameters.

All values are those of the state that it answers, whether it runs without ROS or as a node.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from grasp_ros.physics.control import Column, ControlLaw
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.system import COLUMN, NAMES, System

OWN = 4  # parameters of every law: tick, time, x and v


class Observation(NamedTuple):
    """What the controller of one arm may see of a state, see `OBSERVABLES`."""

    system: System
    laws: Mapping[int, ControlLaw]  # in force, by side
    side: int
    tick: int
    state: Sequence[float]  # (6,), m and m/s

    def values(self, names: Sequence[str]) -> dict[str, float]:
        """Values by the names of `OBSERVABLES`."""
        return {name: OBSERVABLES[name](self) for name in names}

    def other(self) -> tuple[float, float]:
        """Position in m and velocity in m/s of the other arm, as its own sensor measures them."""
        other = opposite(self.side)
        x, v = self.state[COLUMN[other]], self.state[COLUMN[other] + 1]
        law = self.laws.get(other)
        return law.measured(self.tick, x, v) if law else (x, v)


OBSERVABLES: dict[str, Callable[[Observation], float]] = {
    "x_object": lambda seen: seen.state[COLUMN[OBJECT]],  # position of the object, m
    "v_object": lambda seen: seen.state[COLUMN[OBJECT] + 1],  # its velocity, m/s
    "x_other": lambda seen: seen.other()[0],  # position of the other arm, as its own sensor measures it, m
    "v_other": lambda seen: seen.other()[1],  # its velocity, m/s
    "impact": lambda seen: seen.system.impact(seen.side, seen.state),  # force between the arm and the object, N
    "impact_other": lambda seen: seen.system.impact(opposite(seen.side), seen.state),  # of the other arm, N
    "set_point": lambda seen: float(seen.laws[seen.side].row[Column.SET_POINT]),  # of the feedback it replaces, m
}
CALLABLE = f"a callable of tick, time, x and v, and by name of any of {', '.join(OBSERVABLES)}"
_OF_OBJECT, _OF_OTHER = ("x_object", "v_object", "impact", "impact_other"), ("x_other", "v_other", "impact_other")


def opposite(side: int) -> int:
    """The other side."""
    return RIGHT if side == LEFT else LEFT


def observables_of(law: Callable[..., float]) -> tuple[str, ...]:
    """Names of `OBSERVABLES` among the parameters of a law after the first four.

    TypeError if it cannot be called with these.
    """
    try:
        signature = inspect.signature(law)
    except ValueError:  # some built-in callables have no signature
        return ()
    names = tuple(name for name in [*signature.parameters][OWN:] if name in OBSERVABLES)
    signature.bind(0, 0.0, 0.0, 0.0, **dict.fromkeys(names, 0.0))
    return names


def check(names: Sequence[str], system: System, side: int, what: str) -> None:
    """Refuse a law that observes what the scene does not have; `what` begins the refusal."""
    far = opposite(side)
    for body, name_of_it, needing in ((OBJECT, "object", _OF_OBJECT), (far, f"{NAMES[far]} arm", _OF_OTHER)):
        lacking = [name for name in names if name in needing and body in system.absent]
        if lacking:
            raise Refused(f"{what}: asks for {', '.join(lacking)}; the scene has no {name_of_it}")
