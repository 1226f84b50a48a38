"""The law of one controller: from the state of its arm to its command.

What a scene adds to the paper's feedback, (4), (5), is a stage before it (sensing) or after it (actuation); without
stages the law is the paper's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

Sense = Callable[[int, float, float], tuple[float, float]]  # tick, x in m, v in m/s to what is measured
Actuate = Callable[[float], float]  # command in N to command in N


@dataclass
class ControlLaw:
    """Linear state feedback around a set-point.

    Attributes
    ----------
    position_gain : float, N/m
    velocity_gain : float, N s/m
    set_point, feed_forward : float, m and N
    sensing, actuation : lists of stages, in the order in which they act
    """

    position_gain: float
    velocity_gain: float
    set_point: float = 0.0
    feed_forward: float = 0.0
    sensing: list[Sense] = field(default_factory=list)
    actuation: list[Actuate] = field(default_factory=list)

    def command(self, tick: int, x: float, v: float) -> float:
        """Command in N that answers the state (x, v) of a tick."""
        for sense in self.sensing:
            x, v = sense(tick, x, v)
        force = -self.position_gain * (x - self.set_point) - self.velocity_gain * v
        if self.feed_forward:  # adding 0.0 would turn a command of -0.0 into another bit pattern
            force += self.feed_forward
        for actuate in self.actuation:
            force = actuate(force)
        return force
