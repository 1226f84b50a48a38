"""`python -m grasp_ros.graph plant`: starts a node, as `ros2 run grasp_ros plant` does.

Importing rclpy and NumPy takes a while, and a Ctrl-C in it would end in a traceback. So the signal handlers come
first and everything else after them.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from itertools import chain, pairwise
from typing import Any

from grasp_ros.graph.host import check_reach, environment, remove_left
from grasp_ros.graph.parameters import NODES, PARAMETERS, TOOLS, usage
from grasp_ros.graph.stopping import STOP_SIGNALS, end_late_by_force, end_with_parent, note_signals
from grasp_ros.physics.errors import Refused, needing


def main(name: str, child: bool = False) -> int:
    """Run the node of that name; returns the exit status of the process.

    A child ends with the process that holds the other end of its standard input. "graph" runs several in one thread:
    those that stand on the command line before `--ros-args`; their parameters as `-p node:name:=value`.
    """
    words = _own_words()
    if {"-h", "--help"} & set(words):
        print(usage(name))
        return 0
    check_reach(os.environ, alone=name == "graph")
    if words and name != "graph":
        raise Refused(f"{' '.join(words)}: not allowed; allowed: --help, or --ros-args -p NAME:=VALUE ...")
    received: list[int] = []
    note_signals(received)
    end_late_by_force(name, received)
    gc.disable()  # until the nodes are there: imports make little garbage and much to look through
    if child:
        end_with_parent(received, name)
    else:
        remove_left()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)  # `grasp run` starts us with all blocked
    os.environ.update(environment(os.environ))  # before rclpy looks
    if name == "plant":
        # Numba is not to find what it would import beside itself, which takes half as long as all else: scipy has BLAS,
        # which no kernel uses. A plant runs no code but the package's own.
        for module in ("coverage", "scipy"):
            sys.modules.setdefault(module, None)  # type: ignore[arg-type]
    names = sys.argv[1 : sys.argv.index("--ros-args")] if name == "graph" else [name]
    makes = {each: partial(_maker(each), cli_args=_arguments_of(each)) for each in names}
    status: int = import_module("grasp_ros.graph.ros.executor").run(makes, received)
    return status


def _maker(name: str) -> Callable[..., Any]:
    """What makes the node of that name: its class, that of `monitor` is `nodes.monitor.Monitor`."""
    kind = "controller" if name.endswith("controller") else name
    module = import_module(f"grasp_ros.graph.{'tools' if name in TOOLS else 'nodes'}.{kind}")
    make: Callable[..., Any] = getattr(module, kind.capitalize())
    return partial(make, name) if kind == "controller" else make


def _arguments_of(name: str) -> list[str]:
    """What `-p name:...` says, for that node alone: ROS's own rule of that form knows no node in a namespace."""
    words = [word.removeprefix(f"{name}:") for flag, word in pairwise(sys.argv)
             if flag == "-p" and word.startswith(f"{name}:")]
    return ["--ros-args", *chain(*(("-p", word) for word in words))]


def _own_words() -> list[str]:
    """Words of the command line that are not ROS's."""
    words = sys.argv[1:]
    if "--ros-args" not in words:
        return words
    begin = words.index("--ros-args")
    end = words.index("--", begin) + 1 if "--" in words[begin:] else len(words)
    return words[:begin] + words[end:]


def start() -> int:
    """Start the node that the first word names; `child` before it marks a child of `grasp run`."""
    is_child = sys.argv[1:2] == ["child"]
    del sys.argv[1 : 1 + is_child]
    name = sys.argv.pop(1) if len(sys.argv) > 1 else "--help"
    if name in ("-h", "--help"):
        print(f"usage: python -m grasp_ros.graph NODE [--help] [--ros-args ...]; NODE is one of {', '.join(NODES)}")
        return 0
    if name not in PARAMETERS and not (is_child and name == "graph"):
        print(f"{name!r} is no node; allowed: {', '.join(NODES)}", file=sys.stderr)
        return 2
    try:
        with needing("this"):
            return main(name, is_child)
    except Refused as error:
        print(f"{name}: {error}", file=sys.stderr)
        return error.exit_status


if __name__ == "__main__":
    sys.exit(start())
