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

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import ACCURACY, Integrator, Status, compile_kernels
from grasp_ros.exact.jit import COMPILING, kernels_on_disk
from grasp_ros.graph.nodes import messages
from grasp_ros.graph.nodes.node import GraspNode, run
from grasp_ros.physics.model import Array
from grasp_ros.scene.topics import CLOCK, JOINT_STATES, LYAPUNOV, SCENE, WINDOW
from grasp_ros.simulation.sampled_plant import SampledPlant

UNCONTROLLED_SECONDS = 1e-4  # wall time between the ticks of a scene without controllers


class Plant(GraspNode):
    """Node `plant`; parameters scene, accuracy, wait_for_monitor, progress, and those of the scene."""

    why_read_only = "it describes what is simulated, which does not change in a run; set it in the scene or with -p"

    def __init__(self) -> None:
        super().__init__("plant")
        name = self.read_only("scene", "case_01", "name of a scene of the package, or path of a .yaml file")
        accuracy = self.read_only("accuracy", ACCURACY, "relative size of the first neglected term of a contact")
        self._monitored = self.read_only("wait_for_monitor", False, "start with a monitor and never outrun it")
        progress = self.read_only("progress", False, "show a progress bar on the terminal")
        scene = scenes.load(name)
        self._scene = scene.changed(self.declare_scene(scene, "plant"))
        for warning in self._scene.warnings:
            self.get_logger().warning(warning)
        self._system = self._scene.system
        if not kernels_on_disk():
            self.get_logger().info(COMPILING)
        compile_kernels()
        integrator = Integrator(self._system, continuous=False, accuracy=accuracy)
        self._plant = SampledPlant(self._system, self._scene.period_ns, integrator)
        self._recorded = -1  # last tick that the monitor has complete
        self._commands: dict[int, float] = {}
        self._begin = math.nan
        self.counters.update(tick=0, **{"stale commands": 0, "repeated commands": 0, "refused commands": 0})
        self._bar = tqdm(total=self._scene.ticks, unit="tick", desc=self._scene.name, disable=not progress)
        self._states = self.publisher(JOINT_STATES)
        self._forces = [(self.publisher(output.topic), output.value) for output in self._scene.outputs]
        self._simulated = self.publisher(CLOCK)
        self._description = self.publisher(SCENE)
        self._description.publish(messages.text(self._scene.to_yaml()))
        for side, topic in zip(self._system.laws, self._scene.controllers.values(), strict=True):
            self.subscribe(topic, partial(self._on_command, side))
        self._unwatched = 0  # reports in a row without a monitor
        if self._monitored:
            self.subscribe(LYAPUNOV, self._on_lyapunov, raw=True)
        if progress:
            self.wall_timer(0.1, self._show)
        self.when(self._ready, self._start)

    def report(self) -> None:
        """Publish the counters, and see to it that nobody else plays the plant and that the monitor is still there."""
        super().report()
        self._insist()
        watched = not self._monitored or math.isnan(self._begin) or self.count_publishers(LYAPUNOV.name) > 0
        self._unwatched = 0 if watched else self._unwatched + 1
        if self._unwatched > 1 and not self.finished:  # at first its last value may still be on the way
            self._fail(f"{LYAPUNOV.name}: the monitor that this run waits for has ended")

    def _insist(self) -> None:
        if self.count_publishers(self._states.topic_name) > 1:
            topic = self._states.topic_name
            self._fail(f"{topic}: another plant publishes here; use another ROS_DOMAIN_ID or namespace")

    def _ready(self) -> bool:
        self._insist()
        monitor = [LYAPUNOV] if self._monitored else []
        return self.linked(self._states, [*self._scene.controllers.values(), *monitor]) and all(
            self.linked(publisher, monitor) for publisher, _ in self._forces
        )

    def _start(self) -> None:
        self.state = "running"
        self._begin = time.monotonic()
        self._publish()
        if not self._system.laws:  # no command will ever come
            self.wall_timer(UNCONTROLLED_SECONDS, self._advance)

    def _publish(self) -> None:
        tick, state = self._plant.tick, self._plant.state
        time_ns = tick * self._scene.period_ns
        self._simulated.publish(messages.clock(time_ns))
        for publisher, value in self._forces:
            publisher.publish(messages.wrench(time_ns, value(self._system, tick, state)))
        self._states.publish(messages.joint_state(time_ns, self._system.present, state, self._plant.effort))

    def _on_command(self, side: int, message: Any) -> None:
        force = message.wrench.force.x
        if messages.to_ns(message.header.stamp) != self._plant.tick * self._scene.period_ns:
            self.count("stale commands")
        elif not math.isfinite(force):
            self.count("refused commands")
        elif side in self._commands:
            self.count("repeated commands")
        else:
            self._commands[side] = force
            self._advance()

    def _on_lyapunov(self, cdr: bytes) -> None:
        self._recorded = max(self._recorded, messages.raw_stamp_ns(cdr) // self._scene.period_ns)
        self._advance()

    def _advance(self) -> None:
        tick = self._plant.tick
        last = tick == self._scene.ticks
        lead = 0 if last else WINDOW
        complete = len(self._commands) == len(self._system.laws)
        if self.finished or not complete or (self._monitored and tick - self._recorded > lead):
            return
        if last:
            self._finish()
            return
        self._plant.step(self._take_commands())
        if self._plant.status is not Status.DONE:
            self._fail(self._plant.stop)
            return
        self.counters["tick"] = self._plant.tick
        self._publish()

    def _take_commands(self) -> Array:
        forces = np.zeros(3)
        for side, force in self._commands.items():
            forces[side] = force
        self._commands.clear()
        return forces

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
        self._bar.update(self._plant.tick - self._bar.n)

    def close(self) -> None:
        """End the progress bar, and deliver what a finished run has published."""
        self._show()
        self._bar.close()
        if self.finished:
            self.flush(self._states, *(publisher for publisher, _ in self._forces))


def main(_: str, received: Sequence[int]) -> int:
    """Run the plant."""
    return run(Plant, received)
