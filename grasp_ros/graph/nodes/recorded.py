"""How far the monitor is, which a plant that waits for it must not outrun: what nobody takes in time is lost."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from grasp_ros.graph.nodes import messages
from grasp_ros.graph.nodes.stepped import SteppedNode
from grasp_ros.scene.topics import LYAPUNOV, WINDOW


class Recorded:
    """The last tick that the monitor has complete, as it says itself.

    Parameters
    ----------
    plant : SteppedNode
    then : callable
        Called when there is a new one.

    Attributes
    ----------
    tick : int
        -1: none of this run.
    heard : float, s
        Wall time at which that was said; -inf: never.
    """

    def __init__(self, plant: SteppedNode, then: Callable[[], None]) -> None:
        self._plant, self._then = plant, then
        self.tick, self.heard = -1, -math.inf
        plant.counters["refused records"] = 0
        if plant.monitored:
            plant.subscribe(LYAPUNOV, self._on_lyapunov, raw=True)

    def forget(self) -> None:
        """Begin anew: the plant was reset."""
        self.tick = -1

    def outrun(self, lead: int = WINDOW) -> bool:
        """Whether the plant has to wait for its monitor: it is more than some ticks ahead."""
        return self._plant.monitored and self._plant.tick - self.tick > lead

    def _on_lyapunov(self, cdr: bytes) -> None:
        stamp = messages.raw_stamp_ns(cdr) if len(cdr) >= messages.SHORTEST else -1
        tick, rest = divmod(stamp, self._plant.scene.period_ns)
        if rest or not max(self.tick, 0) <= tick <= self._plant.tick:
            self._plant.refuse("refused records", LYAPUNOV)
            return
        self.tick, self.heard = tick, time.monotonic()
        self._then()
