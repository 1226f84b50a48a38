"""The plant: owner of time. It integrates the collision dynamics and publishes the states.

Lockstep: publish state k, wait for both commands stamped k, advance exactly one period with them. The result does
not depend on the load of the machine.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from functools import partial
from typing import Any

from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.nodes import messages
from grasp_ros.nodes.node import GraspNode, run
from grasp_ros.physics.integrator import ACCURACY, Integrator, Status, compile_kernels
from grasp_ros.physics.jit import COMPILING, kernels_on_disk
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import impact_forces
from grasp_ros.topics import (
    CLOCK,
    JOINT_STATES,
    LEFT_COMMAND,
    LEFT_CONTACT,
    LYAPUNOV,
    RIGHT_COMMAND,
    RIGHT_CONTACT,
    SCENE,
    WINDOW,
)


class Plant(GraspNode):
    """Node `plant`; parameters scene, accuracy, wait_for_monitor, progress."""

    def __init__(self) -> None:
        super().__init__("plant")
        scene = self.read_only("scene", "case_01", "name of a scene of the package, or path of a .yaml file")
        accuracy = self.read_only("accuracy", ACCURACY, "relative size of the first neglected term of a contact")
        self._monitored = self.read_only("wait_for_monitor", False, "start with a monitor and never outrun it")
        progress = self.read_only("progress", False, "show a progress bar on the terminal")
        self._scene = scenes.load(scene)
        if not kernels_on_disk():
            self.get_logger().info(COMPILING)
        compile_kernels()
        self._integrator = Integrator(
            self._scene.grasp, self._scene.initial_state, continuous=False, accuracy=accuracy
        )
        self._tick = 0
        self._recorded = -1  # last tick that the monitor has complete
        self._commands: list[float | None] = [None, None]
        self._applied = (0.0, 0.0)
        self._begin = math.nan
        self.counters.update(tick=0, **{"stale commands": 0, "repeated commands": 0, "refused commands": 0})
        self._bar = tqdm(total=self._scene.ticks, unit="tick", desc=self._scene.name, disable=not progress)
        self._states = self.publisher(JOINT_STATES)
        self._contacts = (self.publisher(LEFT_CONTACT), self.publisher(RIGHT_CONTACT))
        self._simulated = self.publisher(CLOCK)
        self._description = self.publisher(SCENE)
        self._description.publish(messages.text(self._scene.to_yaml()))
        self.subscribe(LEFT_COMMAND, partial(self._on_command, LEFT))
        self.subscribe(RIGHT_COMMAND, partial(self._on_command, RIGHT))
        if self._monitored:
            self.subscribe(LYAPUNOV, self._on_lyapunov, raw=True)
        if progress:
            self.wall_timer(0.1, self._show)
        self.when(self._ready, self._start)

    def report(self) -> None:
        """Publish the counters, and see to it that nobody else plays the plant."""
        super().report()
        self._insist()

    def _insist(self) -> None:
        if self.count_publishers(self._states.topic_name) > 1:
            topic = self._states.topic_name
            self._fail(f"{topic}: another plant publishes here; use another ROS_DOMAIN_ID or namespace")

    def _ready(self) -> bool:
        self._insist()
        monitor = [LYAPUNOV] if self._monitored else []
        return self.linked(self._states, [LEFT_COMMAND, RIGHT_COMMAND, *monitor]) and all(
            self.linked(publisher, monitor) for publisher in self._contacts
        )

    def _start(self) -> None:
        self.state = "running"
        self._begin = time.monotonic()
        self._publish()

    def _publish(self) -> None:
        time_ns = self._tick * self._scene.period_ns
        state = self._integrator.state
        self._simulated.publish(messages.clock(time_ns))
        for publisher, force in zip(self._contacts, impact_forces(self._scene.grasp, state), strict=True):
            publisher.publish(messages.wrench(time_ns, float(force)))
        self._states.publish(messages.joint_state(time_ns, state, self._applied))

    def _on_command(self, side: int, message: Any) -> None:
        force = message.wrench.force.x
        if messages.to_ns(message.header.stamp) != self._tick * self._scene.period_ns:
            self.count("stale commands")
        elif not math.isfinite(force):
            self.count("refused commands")
        elif self._commands[side] is not None:
            self.count("repeated commands")
        else:
            self._commands[side] = force
            self._advance()

    def _on_lyapunov(self, cdr: bytes) -> None:
        self._recorded = max(self._recorded, messages.raw_stamp_ns(cdr) // self._scene.period_ns)
        self._advance()

    def _advance(self) -> None:
        left, right = self._commands
        last = self._tick == self._scene.ticks
        lead = 0 if last else WINDOW
        if left is None or right is None or (self._monitored and self._tick - self._recorded > lead):
            return
        if last:
            self._finish()
            return
        self._integrator.hold(left, right)
        self._integrator.advance(self._scene.period_ns / scenes.NANOSECONDS, start=self._scene.time_of(self._tick))
        if self._integrator.status is not Status.DONE:
            state = self._integrator.state.tolist()
            self._fail(f"{self._integrator.status.value}, t = {self._scene.time_of(self._tick)} s, state {state}")
            return
        self._applied = (left, right)
        self._commands = [None, None]
        self._tick += 1
        self.counters["tick"] = self._tick
        self._publish()

    def _finish(self) -> None:
        self.state = "finished"
        self.finished = True
        speed = self._scene.ticks / (time.monotonic() - self._begin)
        self.get_logger().info(f"finished {self._scene.ticks} ticks at {speed:.1f} ticks/s")

    def _fail(self, reason: str) -> None:
        self.state = reason
        self.get_logger().fatal(reason)
        self.exit_code = 1
        self.finished = True

    def _show(self) -> None:
        self._bar.update(self._tick - self._bar.n)

    def close(self) -> None:
        """End the progress bar, and deliver what a finished run has published."""
        self._show()
        self._bar.close()
        if self.finished:
            self.flush(self._states, *self._contacts)


def main(_: str, received: Sequence[int]) -> int:
    """Run the plant."""
    return run(Plant, received)
