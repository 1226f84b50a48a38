"""What a controller of the user's own may ask for beside its arm, by the names of its parameters.

All of it belongs to the state that is answered, whether the controller runs without ROS or as a node.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from grasp_ros.physics.control import ControlLaw
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.system import COLUMN, NAMES, System

OWN = 4  # parameters of every law: tick, time, x and v


class Observation(NamedTuple):
    """What can be seen of a state by the controller of one arm; its properties are what a law may ask for."""

    system: System
    laws: Mapping[int, ControlLaw]  # in force, by side
    side: int
    tick: int
    state: Sequence[float]  # (6,), m and m/s

    @property
    def x_object(self) -> float:
        """Position of the object, m."""
        return self.state[COLUMN[OBJECT]]

    @property
    def v_object(self) -> float:
        """Velocity of the object, m/s."""
        return self.state[COLUMN[OBJECT] + 1]

    @property
    def x_other(self) -> float:
        """Position of the other arm, m, as its own sensor measures it."""
        return self._other[0]

    @property
    def v_other(self) -> float:
        """Velocity of the other arm, m/s, as its own sensor measures it."""
        return self._other[1]

    @property
    def impact(self) -> float:
        """Impact force between the arm and the object, N."""
        return self.system.impact(self.side, self.state)

    @property
    def impact_other(self) -> float:
        """Impact force between the other arm and the object, N."""
        return self.system.impact(opposite(self.side), self.state)

    @property
    def set_point(self) -> float:
        """Set-point of the feedback of the scene that the law replaces, m."""
        return self.laws[self.side].set_point

    def values(self, names: Sequence[str]) -> dict[str, float]:
        """What some names ask for."""
        return {name: getattr(self, name) for name in names}

    @property
    def _other(self) -> tuple[float, float]:
        other = opposite(self.side)
        x, v = self.state[COLUMN[other]], self.state[COLUMN[other] + 1]
        law = self.laws.get(other)
        return law.measured(self.tick, x, v) if law else (x, v)


OBSERVABLES = tuple(name for name, value in vars(Observation).items()
                    if isinstance(value, property) and not name.startswith("_"))
CALLABLE = f"a callable of tick, time, x and v, and by name of any of {', '.join(OBSERVABLES)}"
_OF_OBJECT, _OF_OTHER = ("x_object", "v_object", "impact", "impact_other"), ("x_other", "v_other", "impact_other")


def opposite(side: int) -> int:
    """The other side."""
    return RIGHT if side == LEFT else LEFT


def asked(law: Callable[..., float]) -> tuple[str, ...]:
    """What a law asks for beside its arm: names of `OBSERVABLES` among its parameters after the first four.

    TypeError if it cannot be called with these.
    """
    try:
        signature = inspect.signature(law)
    except ValueError:  # some built-in callables do not tell what they take
        return ()
    names = tuple(name for name in [*signature.parameters][OWN:] if name in OBSERVABLES)
    signature.bind(0, 0.0, 0.0, 0.0, **dict.fromkeys(names, 0.0))
    return names


def check(names: Sequence[str], system: System, side: int, what: str) -> None:
    """Refuse a law that asks for what the scene does not have; `what` is what the refusal begins with."""
    far = opposite(side)
    for body, name_of_it, needing in ((OBJECT, "object", _OF_OBJECT), (far, f"{NAMES[far]} arm", _OF_OTHER)):
        lacking = [name for name in names if name in needing and body in system.absent]
        if lacking:
            raise Refused(f"{what}: asks for {', '.join(lacking)}; the scene has no {name_of_it}")
