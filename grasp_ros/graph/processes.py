"""Starts the processes of the graph together, waits for them and stops them."""

from __future__ import annotations

import json
import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from grasp_ros.graph.host import hold, remove_left
from grasp_ros.graph.parameters import PEER_SECONDS, START_SECONDS, argument, check_timeouts
from grasp_ros.graph.stopping import GRACE_SECONDS, STOP_SIGNALS
from grasp_ros.physics.errors import Failed, Refused
from grasp_ros.scene import Scene
from grasp_ros.scene.files import new_directory

STOP_SECONDS = GRACE_SECONDS + 1.0  # a node says itself that it ends by force
TOGETHER_SECONDS = 15.0  # plant and monitor end within this time of each other
POLL_SECONDS = 0.02
# For the nodes to say it themselves, which know more; they cannot while a lock of shared memory is held by the one that
# was stopped.
NODES_SECONDS = 0.4
MONITOR_NICE, PRIORITY = 10, 1  # of Linux: the monitor of a free run may be late, the others may not
LONGEST = 2**16  # bytes of last words
NO_MEMORY = " (is /dev/shm full?)"
Values = Mapping[str, bool | float | str]  # of parameters, by name


def become(node: str, parameters: Values, namespace: str = "/") -> NoReturn:
    """Become the process of a node: signals and exit status are the node's own.

    It keeps no log file, which would need a home directory that can be written.
    """
    os.execv(sys.executable, [*_command([node], parameters, namespace), "--disable-external-lib-logs"])


def _command(nodes: Sequence[str], parameters: Values, namespace: str) -> list[str]:
    """Command line of a node, or of "graph" and the nodes of its process; after "child" it ends with this one."""
    words = [word for key, value in parameters.items() for word in ("-p", f"{key}:={argument(value)}")]
    root = namespace.rstrip("/")
    names = ["-r", f"__ns:={namespace}", "-r", f"/clock:={root}/clock"] if root else []
    # -P: a checkout in the working directory must not take the place of the package that is running.
    return [sys.executable, "-P", "-m", "grasp_ros.graph", *nodes, "--ros-args", *words, *names]


@dataclass
class Graph:
    """The processes of one scene: plant, monitor and a controller for every arm that has one."""

    scene: Scene
    directory: Path  # a new one, for the resolved scene and the bag
    accuracy: float
    errors: int | None = None  # where the processes' messages go, as in `subprocess.Popen`; None: to the terminal
    without: Sequence[str] = ()  # controllers that somebody else starts
    laws: Mapping[str, str] = field(default_factory=dict)  # of the user's own, "module:object", by controller
    plant: Values = field(default_factory=dict)  # further parameters of it
    one_process: bool = False  # whether all nodes run in one process and one thread
    namespace: str = "/"  # of all names, /clock too where it is not the root
    peer_timeout: float = PEER_SECONDS  # wall time without a heartbeat, or an answer, after which a node is silent
    on_silence: str = "end"  # what the others do then; or "wait"
    quiet: bool = False  # whether the nodes log errors alone
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    begun: float | None = None  # wall time at which the bag was there
    _stopped: dict[str, float] = field(default_factory=dict)  # since when
    # The children read the other end: when this one closes, however that comes, they end. They say there why they end.
    _lifeline: socket.socket | None = None
    _causes: list[tuple[float, str, int]] = field(default_factory=list)  # wall time, what was said then, status
    _hold: socket.socket | None = None  # see `host.hold`

    @property
    def bag(self) -> Path:
        """Directory of the bag."""
        return self.directory / "bag"

    def start(self) -> None:
        """Start the processes, each in a session of its own: a Ctrl-C reaches them through `stop`, once.

        They end when this process does, whatever ends it.

        Raises
        ------
        Refused
            If the directory exists or cannot be written, the scene has no such controller, the timeout can be none, or
            another graph runs here.
        Failed
            If a process cannot be started.
        """
        for name in (*self.without, *self.laws):
            if name not in self.scene.controllers:
                allowed = ", ".join(self.scene.controllers) or "none, this scene has no controller"
                raise Refused(f"{self.scene.name}: {name}: no such controller; allowed: {allowed}")
        for name in self.laws.keys() & {*self.without}:
            raise Refused(f"{name}: --controller and --without; allowed: one of the two")
        scene_file = self.directory / f"{self.scene.name}.yaml"
        commands = self._commands(scene_file)
        self._hold = hold(os.environ, self.namespace)
        try:
            with new_directory(self.directory):
                scene_file.write_text(self.scene.to_yaml(), encoding="utf-8")
        except Refused:
            self.stop()
            raise
        environment = {"ROS_LOG_DIR": str(self.directory / "log"), **os.environ, "PYTHONINSPECT": ""}  # none asks on
        # A child inherits the mask and lifts it when its handlers are in place: it cannot be interrupted half started.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
        remove_left()
        self._lifeline, end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._lifeline.setblocking(False)
        try:
            for name, command in commands.items():
                self.processes[name] = subprocess.Popen(
                    command, env=environment, start_new_session=True, stdin=end.fileno(), stderr=self.errors
                )
        except OSError as error:  # more processes than may be
            raise Failed(f"{name}: cannot be started: {error.strerror}") from None
        finally:
            end.close()
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _commands(self, scene: Path) -> dict[str, list[str]]:
        """Command lines by the names of the processes, with a scene's file; a law may leave the working directory."""
        patience = 0.0 if self.without else START_SECONDS
        check_timeouts(self.peer_timeout, patience or math.inf)
        shared: Values = {
            "on_silence": self.on_silence, "peer_timeout_s": self.peer_timeout, "start_timeout_s": patience
        }
        monitored = {**shared, "wait_for_monitor": True}
        settings: dict[str, Values] = {
            "monitor": {**shared, "bag": str(self.bag.absolute())},
            **{name: {**monitored, "law": self.laws.get(name, "")}
               for name in self.scene.controllers if name not in self.without},
            "plant": {**monitored, "scene": str(scene.absolute()), "accuracy": float(self.accuracy), **self.plant},
        }
        nodes = {name: [name] for name in settings}
        if self.one_process:
            nodes = {"graph": ["graph", *settings]}
            settings = {"graph": {f"{name}:{key}": number for name, own in settings.items()
                                  for key, number in own.items()}}
        level = ["--log-level", "error"] if self.quiet else []
        return {name: [*_command(["child", *own], settings[name], self.namespace), *level]
                for name, own in nodes.items()}

    def wait(self, received: Sequence[int]) -> None:
        """Wait until plant and monitor have finished, or until a signal has been received.

        Raises
        ------
        Failed
            If a process ends with another status than 0, a controller ends early, or plant and monitor do not end
            together.
        Refused
            If a node refuses what it is given.
        """
        deadline = math.inf
        awaited = [name for name in self.processes if not name.endswith("controller")]
        while not received and (running := [name for name in awaited if self.processes[name].poll() is None]):
            if len(running) < len(awaited):
                deadline = min(deadline, time.monotonic() + TOGETHER_SECONDS)
            if time.monotonic() > deadline:
                raise Failed(f"{running[0]}: still runs although its counterpart has ended")
            self._check()
            if self.begun is None and self.bag.exists():
                self.begun = time.monotonic()
                if "free_running" in self.plant:
                    self._set_priorities()
            time.sleep(POLL_SECONDS)
        if not received:
            self._check()
            if self.begun is not None and not self.bag.exists():
                raise Failed(f"{self.bag}: was moved or removed")
            if not (self.bag / "metadata.yaml").exists():  # a law can end its process, and all nodes with it
                raise Failed(f"{awaited[0]}: ended with exit status 0 before the run was over")

    def _set_priorities(self) -> None:
        """Let a free run have its turn at once: between equals on busy processors it comes some milliseconds later.

        Those threads inherit it that are still to come.
        """
        try:
            for name, process in self.processes.items():
                for thread in Path(f"/proc/{process.pid}").glob("task/*"):  # none if it has ended
                    with suppress(ProcessLookupError):  # it has just ended
                        if name == "monitor":
                            os.setpriority(os.PRIO_PROCESS, int(thread.name), MONITOR_NICE)
                        else:
                            os.sched_setscheduler(int(thread.name), os.SCHED_RR, os.sched_param(PRIORITY))
        except OSError as error:
            print(f"grasp: real-time priority is not available here ({error.strerror}); without it commands"
                  " get older on busy processors", file=sys.stderr)

    def _check(self) -> None:
        """Fail for the first cause: of the first process that has said why it ends, or was killed, or stands still."""
        ended = {name: process.returncode for name, process in self.processes.items() if process.poll() is not None}
        assert self._lifeline is not None
        with suppress(BlockingIOError):
            while content := self._lifeline.recv(LONGEST):
                when, node, why, status = json.loads(content)
                self._causes.append((when, f"{node}: {why}", status))
        for name, status in ended.items():
            if status < 0:
                why = f"was killed by {signal.Signals(-status).name}{NO_MEMORY if status == -signal.SIGBUS else ''}"
                self._causes.append((time.monotonic(), f"{name}: {why}", 1))
        first, why, status = min(self._causes, default=(math.inf, "", 0))
        if (ended and why) or time.monotonic() > first + STOP_SECONDS:  # its own end may hang
            raise (Refused if status == 2 else Failed)(why)
        for name, status in ended.items():
            if status or name.endswith("controller"):
                raise Failed(f"{name}: ended with exit status {status} before the run was over")
        for name, process in self.processes.items():
            self._see_whether_stopped(name, process)

    def _see_whether_stopped(self, name: str, process: subprocess.Popen[bytes]) -> None:
        """Nobody else is there to notice it when all nodes are in one process, or when all are stopped."""
        with suppress(ChildProcessError):  # of one that has ended
            if found := os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WCONTINUED | os.WNOHANG):
                self._stopped[name] = math.inf if found.si_code == os.CLD_CONTINUED else time.monotonic()
        patience = self.peer_timeout + (0.0 if self.one_process else NODES_SECONDS)
        if self.on_silence == "end" and time.monotonic() - self._stopped.get(name, math.inf) > patience:
            raise Failed(f"{name}: was suspended for more than {patience:g} s")

    def stop(self) -> dict[str, int]:
        """Interrupt what still runs, wait for it, and return the exit statuses."""
        for process in self.processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                process.send_signal(signal.SIGCONT)  # in case it was stopped
        deadline = time.monotonic() + STOP_SECONDS
        for process in self.processes.values():
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, deadline - time.monotonic()))
            with suppress(ProcessLookupError):  # its whole session: what a law has started ends, too
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        for held in filter(None, (self._lifeline, self._hold)):
            held.close()
        self._lifeline = self._hold = None
        statuses = {name: process.returncode for name, process in self.processes.items()}
        if any(status < 0 for status in statuses.values()):  # killed: what it has left is of no use to anybody
            remove_left()
        return statuses
