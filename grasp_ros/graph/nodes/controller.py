"""The controllers: linear state feedback of one arm, (4), (5), from state to command."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from grasp_ros import scene as scenes
from grasp_ros.graph.nodes import messages
from grasp_ros.graph.nodes.node import GraspNode, run
from grasp_ros.physics.control import ControlLaw
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS, SIDES
from grasp_ros.scene.topics import CHANGES, COMMANDS, JOINT_STATES, LYAPUNOV, SCENE
from grasp_ros.scene.validation import SceneError


class Controller(GraspNode):
    """Node `left_controller` or `right_controller`; parameter wait_for_monitor, and those of the scene.

    It takes its law from the scene that the plant announces and answers every state with a command of the same
    stamp. Numbers that are set while it runs act from the next state on: it announces them with that stamp, and the
    frame_id of its commands counts them.
    """

    why_read_only = "it is fixed for a run, so that the bag and a replay agree; set it in the scene"

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._executable = name  # the node may have been given another name
        self._side = name.removesuffix("_controller")
        self._monitored = self.read_only("wait_for_monitor", False, "answer only once a monitor listens")
        self._commands = self.publisher(COMMANDS[self._side])
        self._announcements = self.publisher(CHANGES[self._side])
        self._scene: Scene | None = None
        self._law: ControlLaw | None = None
        self._staged: dict[str, float] = {}
        self._revision = 0
        self.counters["answered states"] = 0
        self.subscribe(SCENE, self._on_scene)
        self.when(self._ready, self._start)

    def _on_scene(self, message: Any) -> None:
        if self._scene is not None:  # one run, one scene
            return
        scene = scenes.parse(message.data, SCENE.name, f"topic {SCENE.name}")
        name = self._executable
        if name not in scene.controllers:
            raise SceneError(f"{SCENE.name}: has no {name}; allowed: {', '.join(scene.controllers) or 'none'}")
        self._staged = self.declare_scene(scene, name)
        scene.changed(self._staged)  # refuses what was given at the start and cannot be run
        self._scene = scene
        self._law = scene.system.laws[SIDES[self._side]]
        self.add_on_set_parameters_callback(self._on_set)

    def _on_set(self, parameters: list[Parameter]) -> SetParametersResult:
        assert self._scene is not None
        wanted = {parameter.name: parameter.value for parameter in parameters if "." in parameter.name}
        try:
            self._scene.changed({**self._staged, **wanted})
        except SceneError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._staged.update(wanted)
        return SetParametersResult(successful=True)

    def _ready(self) -> bool:
        listeners = [JOINT_STATES, LYAPUNOV] if self._monitored else [JOINT_STATES]
        return self._scene is not None and self.linked(self._commands, listeners)

    def _start(self) -> None:
        # Listening is what tells the plant that this controller is ready, so it comes last.
        self.state = "running"
        self.subscribe(JOINT_STATES, self._on_state)

    def _apply(self, time_ns: int) -> None:
        assert self._scene is not None
        before, self._scene = self._scene, self._scene.changed(self._staged)
        for warning in self._scene.warnings:
            if warning not in before.warnings:
                self.get_logger().warning(warning)
        self._law = self._scene.system.laws[SIDES[self._side]]
        self._revision += 1
        names, values = list(self._staged), list(self._staged.values())
        self._announcements.publish(messages.named_list(time_ns, names, values, str(self._revision)))
        self._staged.clear()

    def _on_state(self, message: Any) -> None:
        assert self._scene is not None
        assert self._law is not None
        time_ns = messages.to_ns(message.header.stamp)
        if self._staged:
            self._apply(time_ns)
        row = message.name.index(self._side)
        force = self._law.command(time_ns // self._scene.period_ns, message.position[row], message.velocity[row])
        if not math.isfinite(force):  # the plant would not take it, and all would wait
            self._fail(f"the command is no longer finite, t = {time_ns / NANOSECONDS} s")
            return
        self._commands.publish(messages.wrench(time_ns, force, str(self._revision) if self._revision else ""))
        self.count("answered states")

    def _fail(self, reason: str) -> None:
        self.state = reason
        self.get_logger().fatal(reason)
        self.exit_code = 1
        self.finished = True


def main(name: str, received: Sequence[int]) -> int:
    """Run `left_controller` or `right_controller`."""
    return run(partial(Controller, name), received)
