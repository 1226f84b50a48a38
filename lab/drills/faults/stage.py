"""Where a drill takes place: processes in their own domain, a fault injector that looks on, and what they leave."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import JOINT_STATES, Topic
from lab.drills import nodes
from lab.drills.faults.output import Output

START_SECONDS = 60.0  # for a graph to start on a machine that is busy
AHEAD = 10_000  # ticks between two looks at what was published
BEFORE = 300  # ticks before the accident
POLL_SECONDS = 0.02
END_SECONDS = 1.0  # for the last words of processes that were killed
GRASP = [sys.executable, "-P", "-m", "grasp_ros.cli"]
NODE = [sys.executable, "-P", "-m", "grasp_ros.graph"]
NODES = ("plant", "left_controller", "right_controller", "monitor")
MARK = "GRASP_DRILL"  # variable by which the processes of a drill are known, whoever is their parent
DOMAINS = range(130, 230)  # beside those that people choose


class Failed(Exception):  # noqa: N818 - a drill that could not take place
    """The graph of a drill did not even start."""


class Companion:
    """The process of the fault injector, for one drill after the other.

    A prefix of words before its command line takes it to another host.
    """

    def __init__(self, prefix: Sequence[str] = ()) -> None:
        self._process = subprocess.Popen(
            [*prefix, *nodes.command("fault_injector")],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            env={**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, start_new_session=True,
        )
        self.pid = self._process.pid

    def ask(self, action: str, **words: Any) -> dict[str, Any]:
        """Let it do something; returns its answer. Failed: nobody reads what it would send, or it has ended."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps({"do": action, **words}) + "\n")
        self._process.stdin.flush()
        for line in self._process.stdout:
            if line.startswith("{"):  # Fast DDS writes there, too
                answer: dict[str, Any] = json.loads(line)
                if "failed" in answer:
                    raise Failed(answer["failed"])
                return answer
        raise Failed("the onlooker has ended")

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.communicate()


def free_domains() -> list[int]:
    """Domains in which nobody is at the moment: the ports of their first participants can be taken.

    Another study at the same time begins with others.
    """
    found = [domain for domain in DOMAINS if _free(7410 + 250 * domain)]
    first = os.getpid() % max(len(found), 1)
    return found[first:] + found[:first]


def _free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as endpoint:
        try:
            endpoint.bind(("", port))
        except OSError:
            return False
    return True


class Stage:
    """A directory, a domain, and the processes of one drill.

    The directory is made. Ticks are counted by a topic: what the plant publishes, or what the monitor does once it has
    recorded a tick.
    """

    def __init__(
        self, folder: Path, scene: Scene, companion: Companion, domain: int, seen: Topic = JOINT_STATES
    ) -> None:
        self.folder, self.scene, self.companion, self.domain, self.seen = folder, scene, companion, domain, seen
        self.mark = uuid.uuid4().hex
        folder.mkdir()
        self._scene_file = folder / f"{scene.name}.yaml"
        self._scene_file.write_text(scene.to_yaml(), encoding="utf-8")
        self.output = Output()
        self._reached = -1
        self.terminal = -1  # or a pipe: the end that is read
        self.accident = math.nan  # when it happened, monotonic
        self.asleep = 0.0, 0.0  # from when to when nobody could do anything
        self.started: dict[str, subprocess.Popen[bytes]] = {}
        self.times: Array = np.lib.format.open_memmap(folder / "times.npy", "w+", float, (scene.ticks + 1,))
        self._others = companion
        self._open()

    def _open(self) -> None:
        times = str(self.folder / "times.npy")
        self.companion.ask(
            "open", domain=self.domain, times=times, period_ns=self.scene.period_ns, topic=self.seen.name
        )

    def look_on_from(self, prefix: Sequence[str]) -> None:
        """Let a fault injector on another host look on."""
        self.companion.ask("close")
        self.companion = Companion(prefix)
        self._open()

    @property
    def bag(self) -> Path:
        """Where the bag is."""
        return self.folder / "run" / "bag"

    @property
    def environment(self) -> dict[str, str]:
        """Variables of the processes."""
        return {
            **os.environ, MARK: self.mark, "ROS_DOMAIN_ID": str(self.domain), "ROS_LOG_DIR": str(self.folder / "log"),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "PYTHONUNBUFFERED": "1",
        }

    def start(self, name: str, command: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
        """Start a process in a session of its own, and follow what it prints."""
        follow = {"stdout", "stderr"}.isdisjoint(options)
        if follow:
            options |= {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        process = subprocess.Popen(
            command, cwd=self.folder,
            **{"env": self.environment, "start_new_session": True, "stdin": subprocess.DEVNULL, **options},
        )
        if follow:
            assert process.stdout is not None
            self.output.follow(process.stdout.fileno())
        self.started[name] = process
        return process

    def run_words(self, *words: str, folder: str = "run") -> list[str]:
        """`grasp run` of the scene, which writes to a folder in the directory."""
        return [*GRASP, "run", str(self._scene_file), "-o", str(self.folder / folder), *words]

    def run(self, *words: str) -> None:
        """Start `grasp run`."""
        self.start("grasp run", self.run_words(*words))

    def node(self, name: str, *words: str, prefix: Sequence[str] = (), **parameters: str) -> None:
        """Start one node, as in a terminal of its own."""
        given = {"plant": {"scene": str(self._scene_file), "wait_for_monitor": "true"},
                 "monitor": {"bag": str(self.bag)}}.get(name, {"wait_for_monitor": "true"})
        numbers = [word for key, value in {**given, **parameters}.items() for word in ("-p", f"{key}:={value}")]
        self.bag.parent.mkdir(exist_ok=True)
        self.start(name, [*prefix, *NODE, name, "--ros-args", *numbers, *words])

    def terminals(self, **parameters: str) -> None:
        """Start the four nodes, each in a terminal of its own."""
        for name in NODES:
            self.node(name, **parameters)

    def pid(self, name: str) -> int:
        """Process of a node, or of `grasp run`."""
        if name in self.started:
            return self.started[name].pid
        for process in self._processes():
            with suppress(psutil.NoSuchProcess):
                if {"grasp_ros.graph", name} <= set(process.cmdline()):
                    return int(process.pid)
        raise Failed(f"{name} does not run")

    def has(self, name: str) -> bool:
        """Whether a node runs."""
        with suppress(Failed):
            return self.pid(name) > 0
        return False

    def said(self, words: str) -> bool:
        """Whether somebody has printed these words."""
        return any(words in line.text for line in list(self.output.lines))

    def ended(self, name: str) -> bool:
        """Whether a process that was started here has ended."""
        return self.started[name].poll() is not None

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a node, or to `grasp run`."""
        pid = self.pid(name)
        self.happens()
        os.kill(pid, number)

    def happens(self, when: float | None = None) -> None:
        """Note the time of the accident, now or as given; the first counts."""
        if math.isnan(self.accident):
            self.accident = time.monotonic() if when is None else when

    def _processes(self) -> Iterator[psutil.Process]:
        for process in psutil.process_iter(["environ"]):
            if (process.info["environ"] or {}).get(MARK) == self.mark:  # None: somebody else's
                yield process

    def living(self) -> list[int]:
        """Processes of this drill that live, whoever is their parent."""
        return [process.pid for process in self._processes()]

    @property
    def published(self) -> int:
        """The last tick that has been seen; -1: none."""
        first = self._reached + 1
        seen = np.flatnonzero(np.array(self.times[first : first + AHEAD]))  # a copy: it changes meanwhile
        if len(seen):
            self._reached = first + int(seen[-1])
        return self._reached

    def forget(self) -> None:
        """Begin to count anew, for another graph."""
        self.times[:] = 0.0
        self._reached = -1

    def wait(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Wait for a condition; returns whether it came true."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                return False
            time.sleep(POLL_SECONDS)
        return True

    def settle(self) -> None:
        """Wait until the graph is at work; raises Failed if it does not get there."""
        self.wait(lambda: self.published >= BEFORE or all(map(self.ended, self.started)), START_SECONDS)
        if self.published < BEFORE:
            raise Failed("; ".join(line.text for line in self.output.lines[-3:]) or "the graph does not start")
        self.companion.ask("clear")

    def shared_memory(self) -> set[str]:
        """Files in /dev/shm that processes of this drill have opened, and the fault injector has not."""
        own = {name for process in self._processes() for name in _shared(process)}
        return own - _shared(psutil.Process(self.companion.pid))

    def clear(self) -> None:
        """Kill what is left of this drill, and remove its files."""
        for pid in self.living():
            os.kill(pid, signal.SIGKILL)
        for process in self.started.values():
            process.wait()
        self.output.finish(END_SECONDS)
        for process in self.started.values():
            if process.stdout is not None:
                process.stdout.close()
        if self.companion is self._others:
            self.companion.ask("close")
        else:
            self.companion.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def _shared(process: psutil.Process) -> set[str]:
    with suppress(psutil.NoSuchProcess):
        return {part.path for part in process.memory_maps() if part.path.startswith("/dev/shm/")}
    return set()
