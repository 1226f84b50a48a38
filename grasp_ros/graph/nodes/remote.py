"""`grasp ctl`: asks the services of a running plant, and waits for what they promise."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from grasp_ros.graph.host import place
from grasp_ros.graph.nodes.life import run
from grasp_ros.graph.nodes.node import GraspNode

PATIENCE_SECONDS = 5.0
LOOK_SECONDS = 0.005


class Remote(GraspNode):
    """Node `remote`; parameters action, steps, plant and patience_s.

    Parameters
    ----------
    options
        As in `rclpy.node.Node`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("remote", **options)
        self._action = self.read_only("action", "status")
        self._steps = self.read_only("steps", 1)
        plant = self.read_only("plant", "plant")
        self._patience = self.read_only("patience_s", PATIENCE_SECONDS)
        self._asks = {
            name: self.create_client(Trigger, f"{plant}/{name}") for name in {self._action, "status"}
        }
        self._set = self.create_client(SetParameters, f"{plant}/set_parameters")
        self._goal: dict[str, Any] = {}
        self._seen: Any = None
        self._nobody = f"no plant answers {place(os.environ, self.get_namespace())}"
        self._progress()
        self._begun = False
        self.wall_timer(LOOK_SECONDS, self._look)

    def _progress(self) -> None:
        self._deadline = time.monotonic() + self._patience

    def _look(self) -> None:
        if time.monotonic() > self._deadline:
            self._end(1, self._nobody if self._seen is None else f"the plant does not go on: {self._seen}")
        elif not self._begun and all(client.service_is_ready() for client in (*self._asks.values(), self._set)):
            self._begun = True
            if self._action == "step":
                request = SetParameters.Request()
                request.parameters = [Parameter("steps", value=self._steps).to_parameter_msg()]
                self._set.call_async(request).add_done_callback(self._on_set)
            else:
                self._ask(self._action)

    def _on_set(self, future: Any) -> None:
        [result] = future.result().results
        if result.successful:
            self._ask("step")
        else:
            self._end(1, result.reason)

    def _ask(self, name: str) -> None:
        self._asks[name].call_async(Trigger.Request()).add_done_callback(
            self._on_status if name == "status" else self._on_answer
        )

    def _on_answer(self, future: Any) -> None:
        answer = future.result()
        if not answer.success or self._action in ("pause", "resume"):
            self._end(0 if answer.success else 1, answer.message)
            return
        self._seen = answer.message
        if self._action == "step":
            self._goal = {"tick": int(answer.message.split()[-1]), "state": "paused"}
        else:
            self._goal = {"resets": int(answer.message.split()[2].rstrip(",")), "resetting": False}
        self._ask("status")

    def _on_status(self, future: Any) -> None:
        status = json.loads(future.result().message)
        if status != self._seen:
            self._progress()
        self._seen = status
        if all(status[key] == value for key, value in self._goal.items()):
            self._end(0, f"{status['scene']}: {status['state']} at tick {status['tick']} of {status['ticks']},"
                         f" t = {status['time_s']:g} s, {status['resets']} resets")
        else:
            self._ask("status")

    def _end(self, code: int, words: str) -> None:
        if not self.finished:
            print(words, file=sys.stderr if code else sys.stdout)
        self.exit_code, self.finished = code, True


def main(_: str, received: Sequence[int]) -> int:
    """Run one action."""
    return run([Remote], received)
