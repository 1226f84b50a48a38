"""Entry points of the nodes.

Importing rclpy and NumPy takes a while, and a Ctrl-C in it would end in a traceback. So the signal handlers come
first and everything else after them.
"""

from __future__ import annotations

import signal
import sys
from importlib import import_module

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def main(name: str) -> int:
    """Run the node of that name; returns the exit status of the process."""
    received: list[int] = []
    for number in STOP_SIGNALS:
        signal.signal(number, lambda which, _: received.append(which))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)  # `grasp run` starts us with both blocked
    module = import_module(f"grasp_ros.graph.nodes.{'controller' if name.endswith('controller') else name}")
    status: int = module.main(name, received)
    for number in STOP_SIGNALS:  # a second Ctrl-C must not hit the end of the interpreter
        signal.signal(number, signal.SIG_IGN)
    return status


def plant() -> int:
    """Entry point of `plant`."""
    return main("plant")


def left_controller() -> int:
    """Entry point of `left_controller`."""
    return main("left_controller")


def right_controller() -> int:
    """Entry point of `right_controller`."""
    return main("right_controller")


def monitor() -> int:
    """Entry point of `monitor`."""
    return main("monitor")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
