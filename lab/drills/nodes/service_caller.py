"""Steers a running plant, for `python -m lab steering`: its services, one after the other.

Each line of JSON on the standard input is a call, each line on the standard output its answer.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

SERVICES = ("pause", "resume", "step", "reset", "status")
ANSWER_SECONDS = 60.0


class Pilot:
    """Clients of the services of a plant."""

    def __init__(self) -> None:
        self._node = rclpy.create_node("pilot")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._clients = {name: self._node.create_client(Trigger, f"plant/{name}") for name in SERVICES}
        self._set = self._node.create_client(SetParameters, "plant/set_parameters")
        deadline = time.monotonic() + ANSWER_SECONDS
        for client in (*self._clients.values(), self._set):
            if not client.wait_for_service(max(0.0, deadline - time.monotonic())):
                raise RuntimeError(f"{client.srv_name}: nobody offers this service")

    def call(self, service: str, steps: int | None = None) -> tuple[bool, str]:
        """Whether a service did what it is for, and its words; `steps` is set before, where it may be."""
        if steps is not None:
            request = SetParameters.Request(parameters=[Parameter("steps", value=steps).to_parameter_msg()])
            [result] = self._answer(self._set.call_async(request), "steps").results
            if not result.successful:
                return False, str(result.reason)
        answer = self._answer(self._clients[service].call_async(Trigger.Request()), service)
        return bool(answer.success), str(answer.message)

    def _answer(self, future: Any, name: str) -> Any:
        self._executor.spin_until_future_complete(future, timeout_sec=ANSWER_SECONDS)
        if not future.done():
            raise RuntimeError(f"{name}: no answer")
        return future.result()


def main() -> None:
    """Call what the lines say until there are no more."""
    rclpy.init()
    pilot = Pilot()
    print(json.dumps([True, "ready"]), flush=True)
    for line in sys.stdin:
        print(json.dumps(pilot.call(**json.loads(line))), flush=True)


if __name__ == "__main__":
    main()
