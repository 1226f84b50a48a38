"""A law of the user's own in place of the scene's, `module:object`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from grasp_ros.physics.control import answered, limited
from grasp_ros.physics.errors import Refused, place_of
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
        with self._own_up("when it was imported"):
            self._found = find_law(words, f"law: {words}")
        self.reset()

    def reset(self) -> None:
        """Begin anew, without memory."""
        with self._own_up("when it began"):
            self._law = begin(self._found, f"law: {self.words}")
        self.asks = asked(self._law)

    def check(self, system: System, side: int) -> None:
        """Refuse a scene that does not have what the law asks for."""
        check(self.asks, system, side, f"law: {self.words}")

    def command(self, system: System, side: int, tick: int, time: float, state: Sequence[float]) -> float:
        """Command in N that answers the state (6,) of a tick, through the stages of the scene."""
        stages, seen = system.laws[side], Sight(system, system.laws, side, tick, state).seen(self.asks)
        x, v = stages.measured(tick, *state[COLUMN[side] :][:2])
        with self._own_up(f"at tick {tick}"):
            answer = self._law(tick, time, x, v, **seen)
        return float(limited(stages.row.tolist(), answered(answer, f"law: {self.words}", tick, time)))

    @contextmanager
    def _own_up(self, when: str) -> Iterator[None]:
        """Refuse whatever a user's code raises, an exit and an interrupt too: a node notes signals, they raise none."""
        try:
            yield
        except Refused:
            raise
        except BaseException as error:
            words = ": ".join(filter(None, (type(error).__name__, str(error))))
            raise Refused(f"law: {self.words}: {words}, {when}, {place_of(error)}") from error
