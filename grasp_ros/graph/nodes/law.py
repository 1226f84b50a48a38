"""A law of the user's own in place of the scene's, `module:object`."""

from __future__ import annotations

from collections.abc import Sequence

from grasp_ros.physics.control import answered, limited
from grasp_ros.physics.errors import Refused, described
from grasp_ros.physics.sight import Sight, asked, check
from grasp_ros.physics.system import COLUMN, System
from grasp_ros.scene.own_law import begin, find_law


class OwnLaw:
    """A law of the user's own, between the sensors and the actuator of the scene.

    Parameters
    ----------
    words : str
        "module:object", see `scene.own_law`.
    """

    def __init__(self, words: str) -> None:
        self.words = words
        try:
            self._found = find_law(words, f"law: {words}")
        except KeyboardInterrupt as error:  # of the module itself: a node notes signals, they raise none
            raise Refused(f"law: {words}: {described(error)}") from error
        self.reset()

    def reset(self) -> None:
        """Begin anew, without memory."""
        self._law = begin(self._found, f"law: {self.words}")
        self.asks = asked(self._law)

    def check(self, system: System, side: int) -> None:
        """Refuse a scene that does not have what the law asks for."""
        check(self.asks, system, side, f"law: {self.words}")

    def command(self, system: System, side: int, tick: int, time: float, state: Sequence[float]) -> float:
        """Command in N that answers the state (6,) of a tick, through the stages of the scene."""
        stages, seen = system.laws[side], Sight(system, system.laws, side, tick, state).seen(self.asks)
        x, v = stages.measured(tick, *state[COLUMN[side] :][:2])
        try:
            answer = self._law(tick, time, x, v, **seen)
        except BaseException as error:  # an exit and an interrupt, too: a node notes signals, they raise none
            raise Refused(f"law: {self.words}: {described(error)}, at tick {tick}") from error
        return float(limited(stages.row.tolist(), answered(answer, f"law: {self.words}", tick, time)))
