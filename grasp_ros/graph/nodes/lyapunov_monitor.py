"""What the monitor computes at a tick: V of laws that are known, the energy of the plant alone, and its balance."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from grasp_ros.graph.lockstep.synchronizer import Tick
from grasp_ros.graph.serialization import raw_force, raw_stamp_ns
from grasp_ros.physics.control import is_due
from grasp_ros.physics.energy import energy, energy_balance
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.topics import CHANGES, COMMANDS, WINDOW, Numbers, Topic

MOST_WAITING = WINDOW + 100  # announcements of a controller: it makes at most one for a command
MOST_BYTES = 2**16  # of a message beside the states
EXPLAINED = 1e-9  # of the sizes of its terms: two ways of rounding one law


class LyapunovMonitor:
    """V, the energy balance and the mode of each tick, by the laws that were announced."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        # What each controller has announced of its law: time in ns from which it acts, numbers, the message as it came.
        self._waiting: dict[str, deque[tuple[int, dict[str, float], bytes]]] = {side: deque() for side in SIDES}
        self._held: dict[int, float] = {}  # last commands in N, by side
        self._acting: dict[str, int] = {}  # time in ns of the last announcement that acts, where one is known
        self._numbers = {side: Numbers(late=True) for side in SIDES}
        self.lost = 0  # announcements that never came
        self._before: tuple[int, Array, Array] | None = None  # time in ns, state and external forces

    @property
    def unknown(self) -> list[str]:
        """Sides whose controllers have announced no law so far."""
        sides = (name.removesuffix("_controller") for name in self._scene.controllers)
        return [side for side in sides if side not in self._acting]

    def announce(self, side: str, cdr: bytes) -> None:
        """Take note of a law that will act, by its serialized message."""
        if len(cdr) > MOST_BYTES:
            raise Refused(f"{side}/parameters: {len(cdr)} bytes; allowed: at most {MOST_BYTES}")
        message = deserialize_message(cdr, JointState)
        self.lost += self._numbers[side].take(message)
        if len(message.name) != len(message.position):
            raise Refused(f"{side}/parameters: {len(message.name)} names, {len(message.position)} numbers")
        stamp, numbers = raw_stamp_ns(cdr), dict(zip(message.name, message.position, strict=True))
        wanted = set(self._scene.numbers_of(f"{side}_controller"))
        if set(numbers) != wanted:
            raise Refused(f"{side}/parameters: {', '.join(numbers) or 'nothing'}; allowed: exactly"
                          f" {', '.join(sorted(wanted)) or 'nothing, this scene has no such controller'}")
        self._scene.changed(numbers)
        if self._before is None and not self._acting:  # what came before is of the run before: topics keep the last one
            self._waiting[side].clear()
        if len(self._waiting[side]) >= MOST_WAITING:
            raise Refused(f"{side}/parameters: {MOST_WAITING} changes wait for their tick; allowed: at most that")
        self._waiting[side].append((stamp, numbers, cdr))

    def restart(self) -> None:
        """Let laws act that were announced for the beginning: time went back."""
        self._acting.clear()
        for waiting in self._waiting.values():
            while waiting and waiting[0][0] > 0:  # it came after the last tick of the run before
                waiting.popleft()

    def _is_due(self, side: str, time_ns: int) -> bool:
        waiting = self._waiting[side]
        return bool(waiting) and self._acting.get(side, -1) < waiting[0][0] <= time_ns

    def changes(self, time_ns: int) -> bool:
        """Whether a law begins to act at a time."""
        return any(self._is_due(side, time_ns) for side in self._waiting)

    def begin(self, time_ns: int) -> list[tuple[Topic, bytes]]:
        """Let the laws act that were announced up to a time; returns their announcements.

        Their times ascend; one that does not was announced after a reset that is still to come.
        """
        begun = []
        for side, waiting in self._waiting.items():
            while self._is_due(side, time_ns):
                self._acting[side], numbers, cdr = waiting.popleft()
                if numbers != self._scene.numbers_of(f"{side}_controller"):
                    self._scene = self._scene.changed(numbers)
                begun.append((CHANGES[side], cdr))
        return begun

    def evaluate(self, ticks: Sequence[Tick]) -> list[list[float]]:
        """What `lyapunov` publishes at some ticks in a row, see `topics.LYAPUNOV_NAMES`.

        The laws are the same for all of them. Many at once cost little more than one.
        """
        system, period = self._scene.system, self._scene.period_ns
        times = np.array([tick.time_ns for tick in ticks])
        external = system.external_over(times // period)
        states, inputs = (np.array(rows) for rows in zip(*(tick.state[1:] for tick in ticks), strict=True))
        work, residual, alarm = self._balance(times, states, inputs, external)
        alone = energy(system, states, external, feedback=False)
        known = not self.unknown
        closed = np.array([self._explains(tick) and known for tick in ticks])
        V = np.full((3, len(ticks)), np.nan)
        if closed.any():
            V[:, closed] = [part[closed] for part in energy(system, states, external)[:3]]
        rows: list[list[float]] = np.column_stack(
            [*V, alone.mode, residual, alarm, alone.V_c, work, closed]
        ).tolist()
        return rows

    def _balance(
        self, times: np.ndarray, states: Array, inputs: Array, external: Array
    ) -> tuple[Array, Array, Array]:
        """Work, residual and alarm of the periods before some ticks; 0 where the tick before is not known.

        `inputs` (n, 3) are the forces of the controllers over these periods, N by body.
        """
        time_ns, state, pushed = self._before or (-self._scene.period_ns - 1, states[0], external[0])
        self._before = int(times[-1]), states[-1], external[-1]
        follows = np.diff(times, prepend=time_ns) == self._scene.period_ns
        held = inputs + np.vstack([pushed, external[:-1]])
        balance = energy_balance(self._scene.system, np.vstack([state, states[:-1]]), states, held)
        return (np.where(follows, balance.work, 0.0), np.where(follows, balance.residual, 0.0),
                np.where(follows, balance.alarm, 0.0))

    def _explains(self, tick: Tick) -> bool:
        """Whether the commands that answer a state are those of the laws that were announced, but for rounding."""
        for side, topic in COMMANDS.items():
            if topic not in tick.found:
                continue
            body, force = SIDES[side], raw_force(tick.found[topic])
            law = self._scene.system.laws[body]
            before, self._held[body] = self._held.get(body, force), force
            if not is_due(law.row, tick.time_ns // self._scene.period_ns):
                if force != before:
                    return False
                continue
            x, v = tick.state.numbers[COLUMN[body] :][:2]
            expected = law.command(tick.time_ns // self._scene.period_ns, x, v)
            if force != expected:
                position_gain, velocity_gain, set_point, feed_forward, *_ = law.row.tolist()
                size = abs(position_gain) * (abs(x) + abs(set_point)) + abs(velocity_gain * v)
                if not abs(force - expected) <= EXPLAINED * (size + abs(feed_forward)):
                    return False
        return True
