"""The life of nodes in a process: one or several of them in one thread, until they have finished."""

from __future__ import annotations

import gc
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

import rclpy
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from grasp_ros.graph.parameters import TOOLS
from grasp_ros.graph.ros.node import GraspNode
from grasp_ros.graph.ros.parameter_node import words_of
from grasp_ros.graph.stopping import end_by_force, note_signals, on_signals, tell_parent
from grasp_ros.physics.errors import Refused, described

# A spin without a time limit burns a core and can hang; one until a future is complete, which does not return between
# messages, takes less time, and has corrupted the heap of a process.
POLL_SECONDS = 0.2
NOT_OURS = {Warning: "PYTHONWARNINGS makes it an error", MemoryError: "there is not enough memory"}
INTERRUPTED = 130  # of a tool that a signal ends before it is through; nodes of a graph are meant to end by one


def run(makes: Mapping[str, Callable[..., GraspNode]], received: list[int]) -> int:
    """Run nodes in this process until they have finished or a signal has been received; returns the exit status.

    0 after a finished run or a signal, which interrupts a tool (130); 2 if ROS does not start or a node refuses its
    parameters, otherwise the first status of a node that is not 0. The signal handlers are ours, see `main`: those of
    rclpy invalidate the context under a callback, which then raises.
    """
    nodes: list[GraspNode] = []
    context = Context()  # not the default one, which is that of a user's law: to begin, and to shut down
    rclpy.install_signal_handlers = lambda _: None  # of a law's `rclpy.init`: a signal would shut down this one as well
    status = _live(context, makes, nodes, received)
    if received and not status and TOOLS.keys() & makes.keys():
        status = INTERRUPTED
    on_signals(signal.SIG_IGN)  # a second Ctrl-C must not hit the end of the interpreter
    end_by_force(", ".join(makes), status)  # the end of DDS can hang, and a thread of a law keeps the interpreter
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()
    return status


def _live(
    context: Context, makes: Mapping[str, Callable[..., GraspNode]], nodes: list[GraspNode], received: list[int]
) -> int:
    """Make the nodes, run them until there is nothing left to do, and close them; returns the exit status."""
    names = together = ", ".join(makes)
    try:
        try:
            rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        except RuntimeError as error:  # the base of what rcl raises
            raise Refused(f"ROS does not start: {words_of(error)}") from None
        try:
            for names, make in makes.items():  # noqa: B007 - which one is refused
                nodes.append(make(context=context))
                nodes[-1].refuse_unknown()
            note_signals(received)  # again: a law may have put its own reactions in their place
            names = together
            gc.freeze()  # what is there now stays; to look through it again and again costs a tick 0.1 s now and then
            gc.enable()
            if not nodes[0].work(received):
                _spin(nodes, received, names)
        finally:
            for node in nodes:
                node.guarded(node.close)
    except Refused as error:
        if not tell_parent(names, str(error), 2):  # which says it
            with suppress(OSError):  # nobody reads it
                print(error, file=sys.stderr)
        return 2
    except Exception as error:  # in one line, and where
        whose = next((text for kind, text in NOT_OURS.items() if isinstance(error, kind)), "a fault of this package")
        words = f"{whose}: {described(error)}"
        tell_parent(names, words)
        with suppress(OSError):
            print(f"{names}: {words}", file=sys.stderr)
        return 1
    return next((node.exit_code for node in nodes if node.exit_code), 0)


def _spin(nodes: Sequence[GraspNode], received: Sequence[int], names: str) -> None:
    """Run nodes in this thread until plant and monitor, or whatever there is, have finished, or a signal has come.

    Controllers go on for the next plant and end when nothing else is left.
    """
    executor = EventsExecutor(context=nodes[0].context)
    for node in nodes:
        executor.add_node(node)
    waited_for = [node for node in nodes if not node.stays] or list(nodes)
    while not received:
        finished = [node for node in nodes if node.finished]  # a list is quicker than `any`
        if finished and (set(waited_for) <= set(finished) or any(node.exit_code for node in finished)):
            break
        executor.spin_once(timeout_sec=POLL_SECONDS)
    if received:
        tell_parent(names, f"was ended by {signal.Signals(received[0]).name}")
    executor.shutdown()
