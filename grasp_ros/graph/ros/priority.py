"""Real-time priority, for processes that have to keep up with the wall clock."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from grasp_ros.graph.ros.node import GraspNode
from grasp_ros.physics.errors import Refused

MOST = 99  # of Linux
PARAMETER = "real_time_priority"


class Priority:
    """Parameter real_time_priority of a node: that of its process once it runs, SCHED_RR; 0: that of every process.

    Between equals a thread waits some milliseconds for its turn when all processors are busy, several periods of a fast
    loop. Linux gives this priority to whoever has the right, by CAP_SYS_NICE or a limit `rtprio`; without it the node
    says so and goes on.
    """

    def __init__(self, node: GraspNode) -> None:
        self._node = node
        self._wanted = node.read_only(PARAMETER, 0)
        if not 0 <= self._wanted <= MOST:
            raise Refused(f"{PARAMETER}: {self._wanted} is not allowed; allowed: 0 to {MOST}")

    def take(self) -> None:
        """Give it to all threads of this process; those that they start inherit it."""
        if not self._wanted:
            return
        try:
            for thread in Path("/proc/self/task").iterdir():
                with suppress(ProcessLookupError):  # it has just ended
                    os.sched_setscheduler(int(thread.name), os.SCHED_RR, os.sched_param(self._wanted))
        except OSError as error:
            self._node.get_logger().info(f"{PARAMETER}: {self._wanted} is not to be had here ({error.strerror}):"
                                         " goes on without, and commands get older on busy processors")
