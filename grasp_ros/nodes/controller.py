"""The controllers: linear state feedback of one arm, (4), (5), from state to command."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from grasp_ros import scene as scenes
from grasp_ros.nodes import messages
from grasp_ros.nodes.node import GraspNode, run
from grasp_ros.physics.model import Arm, feedback
from grasp_ros.topics import JOINT_STATES, LEFT_COMMAND, LYAPUNOV, RIGHT_COMMAND, SCENE


class Controller(GraspNode):
    """Node `left_controller` or `right_controller`; parameter wait_for_monitor.

    It takes its gains from the scene that the plant announces and answers every state with a command of the same
    stamp.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._side = name.removesuffix("_controller")
        self._monitored = self.read_only("wait_for_monitor", False, "answer only once a monitor listens")
        self._commands = self.publisher(LEFT_COMMAND if self._side == "left" else RIGHT_COMMAND)
        self._arm: Arm | None = None
        self.counters["answered states"] = 0
        self.subscribe(SCENE, self._on_scene)
        self.when(self._ready, self._start)

    def _on_scene(self, message: Any) -> None:
        if self._arm is not None:  # one run, one scene
            return
        grasp = scenes.parse(message.data, SCENE.name, f"topic {SCENE.name}").grasp
        self._arm = grasp.left if self._side == "left" else grasp.right

    def _ready(self) -> bool:
        listeners = [JOINT_STATES, LYAPUNOV] if self._monitored else [JOINT_STATES]
        return self._arm is not None and self.linked(self._commands, listeners)

    def _start(self) -> None:
        # Listening is what tells the plant that this controller is ready, so it comes last.
        self.state = "running"
        self.subscribe(JOINT_STATES, self._on_state)

    def _on_state(self, message: Any) -> None:
        assert self._arm is not None
        index = message.name.index(self._side)
        force = feedback(self._arm, message.position[index], message.velocity[index])
        self._commands.publish(messages.wrench(messages.to_ns(message.header.stamp), force))
        self.count("answered states")


def main(name: str, received: Sequence[int]) -> int:
    """Run `left_controller` or `right_controller`."""
    return run(partial(Controller, name), received)
