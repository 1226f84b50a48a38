"""`grasp watch` on a pseudo-terminal: its keys, the size of its picture, and the terminal that it gives back."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import re
import select
import signal
import struct
import termios
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import call, started, status
from processes import DEADLINE, GRASP, START, node_command, ran, wait_for
from rich.console import Console
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from grasp_ros import scene as scenes
from grasp_ros.graph import bag
from grasp_ros.graph.processes import Graph
from grasp_ros.graph.ros.messages import qos
from grasp_ros.graph.terminal import HINT, View, moment_of
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.scene.topics import JOINT_STATES, SCENE

pytestmark = pytest.mark.slow  # real processes
SHELL = 'trap : INT TERM HUP; "$@"; echo "status $?"; read end'  # the terminal is there as long as it is
RIGHT, LEFT, INTERRUPT = b"\x1b[C", b"\x1b[D", b"\x03"


class Screen:
    """A terminal of its own for a process."""

    def __init__(self, launch: Callable[..., Any], *command: str, columns: int = 80) -> None:
        self._ours, self._theirs = pty.openpty()
        fcntl.ioctl(self._theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        self._before, self._shown = termios.tcgetattr(self._theirs), ""
        environment = {**os.environ, "TERM": "xterm-256color", "LC_ALL": "C.UTF-8"}
        sides = dict.fromkeys(("stdin", "stdout", "stderr"), self._theirs)
        self._shell = launch("setsid", "-c", "sh", "-c", SHELL, "sh", *command, env=environment, **sides)

    def press(self, key: bytes) -> None:
        """Press a key; what was shown before is forgotten."""
        self._read(0.0)
        self._shown = ""
        os.write(self._ours, key)

    def _read(self, seconds: float) -> None:
        while select.select([self._ours], [], [], seconds)[0]:
            self._shown += os.read(self._ours, 65536).decode(errors="replace")

    def wait(self, pattern: str) -> str:
        """The newest whole picture, once one matches."""
        deadline = time.monotonic() + DEADLINE
        while time.monotonic() < deadline:
            self._read(0.02)
            text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", self._shown)
            pictures = re.findall(r"╭[^╭]*╯", text)
            if pictures and re.search(pattern, pictures[-1]):
                return str(pictures[-1])
        raise AssertionError(f"waited in vain for {pattern}: {self._shown[-2000:]!r}")

    def shows(self, words: str) -> bool:
        """Whether words have been shown since the last key."""
        self._read(0.02)
        return words in re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", self._shown)

    def kill(self, number: int) -> None:
        """Send a signal to the process."""
        children = Path(f"/proc/{self._shell.pid}/task/{self._shell.pid}/children").read_text().split()
        os.kill(int(children[0]), number)

    @property
    def as_before(self) -> bool:
        """Whether the terminal is as it was at first."""
        return termios.tcgetattr(self._theirs) == self._before

    def put_back(self) -> None:
        """Make the terminal as it was at first, as a shell does when a Ctrl-Z has stopped the process."""
        termios.tcsetattr(self._theirs, termios.TCSANOW, self._before)

    def end(self) -> int:
        """Exit status of the process."""
        def status() -> list[str]:
            self._read(0.02)
            return re.findall(r"status (\d+)", self._shown)

        wait_for(lambda: bool(status()), "the end")
        return int(status()[0])


def watch(path: Path, *options: str) -> list[str]:
    """The command for a bag."""
    return [*GRASP, "watch", str(path), *options]


def time_in(picture: str) -> float:
    """The time that is shown, s."""
    return float(re.findall(r"t = (\S+) s", picture)[0])


def test_keys_pause_step_and_end_a_bag(launch: Any, recorded: Path) -> None:
    recording = bag.read(recorded)
    screen = Screen(launch, *watch(recorded, "--rate", "0.05", "--from", "1.5"))
    assert time_in(screen.wait("0.05 s per second")) == pytest.approx(1.5, abs=0.1)
    assert not screen.as_before
    screen.press(b" ")
    at = time_in(screen.wait("paused"))
    for key, ticks in ((RIGHT, 1), (RIGHT, 2), (LEFT, 1), (b"\x1bOD", 0), (LEFT, -1)):
        screen.press(key)
        picture = screen.wait(rf"t = {at + 0.001 * ticks:.3f} s   paused")
        assert f"{recording.state[round(1000 * at) + ticks, 0]:+.5f}" in picture
    screen.put_back()
    screen.press(b" ")
    screen.wait("0.05 s per second")
    screen.press(b"q")
    assert screen.end() == 0


def test_a_bag_is_shown_to_its_end(launch: Any, recorded: Path) -> None:
    recording = bag.read(recorded)
    screen = Screen(launch, *watch(recorded, "--rate", "3"), columns=90)
    picture = screen.wait("t = 3.000 s")
    assert f"{recording.state[-1, 0]:+.5f}" in picture
    assert f"{recording.energy.V_c[-1]:.6g} J" in picture
    assert screen.end() == 0


def test_a_plant_that_was_paused_before_anybody_watched_is_said_to_be_and_steps(launch: Any) -> None:
    launch(*node_command("plant", scene="friction_slide", paused="true"))
    wait_for(lambda: "paused" in ran(*GRASP, "ctl", "status").stdout, "a pause")
    screen = Screen(launch, *START, "watch")
    wait_for(lambda: screen.shows("the plant is paused at tick 0; → steps it"), "what the plant is")
    screen.press(RIGHT)
    screen.wait("t = 0.001 s   paused")
    screen.press(b"q")
    assert screen.end() == 0


def test_a_plant_of_others_may_answer_whatever_it_likes(launch: Any, node: Any) -> None:
    peer, executor = node
    answers = iter(["hello", "[]", '{"a": 1}', '{"state": 1, "tick": Infinity}'])

    def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = next(answers, '{"state": "[/x]", "tick": 3}')
        return response

    peer.create_service(Trigger, "plant/status", answer)
    peer.create_publisher(JointState, JOINT_STATES.name, 1)
    screen = Screen(launch, *START, "watch")
    wait_for(lambda: executor.spin_once(timeout_sec=0.05) or screen.shows("the plant is [/x] at tick 3"), "its words")
    screen.press(b"q")
    assert screen.end() == 0


def test_states_without_the_bodies_of_the_scene_are_passed_over(launch: Any, node: Any) -> None:
    peer, executor = node
    latched = peer.create_publisher(String, SCENE.name, qos(SCENE))
    latched.publish(String(data=scenes.load("arm_alone").to_yaml()))
    states, screen = peer.create_publisher(JointState, JOINT_STATES.name, 1), Screen(launch, *START, "watch")

    def shown(name: str, words: str) -> bool:
        states.publish(JointState(name=[name], position=[0.25], velocity=[0.0], effort=[0.0]))
        executor.spin_once(timeout_sec=0.05)
        return screen.shows(words)

    wait_for(lambda: shown("left", "+0.25000"), "the arm")
    assert not any(shown("elbow", "nan") for _ in range(30))
    screen.press(b"q")
    assert screen.end() == 0


@pytest.mark.parametrize(
    ("ending", "status"), [(b"q", 0), (INTERRUPT, 130), (signal.SIGTERM, 130), (signal.SIGHUP, 130)]
)
def test_the_terminal_is_given_back_however_it_ends(launch: Any, recorded: Path, ending: Any, status: int) -> None:
    screen = Screen(launch, *watch(recorded, "--rate", "0.01"), columns=40)
    screen.wait("t = ")
    assert not screen.as_before
    if isinstance(ending, bytes):
        screen.press(ending)
    else:
        screen.kill(ending)
    assert screen.end() == status
    assert screen.as_before


@pytest.mark.parametrize("width", [100, 80, 66, 65, 40])
def test_the_picture_is_whole_at_every_width(recorded: Path, width: int) -> None:
    recording = bag.read(recorded)
    row = int(np.argmax(recording.outputs["contact/left"]))
    for closed in (1.0, 0.0):
        console = Console(width=width, file=io.StringIO(), color_system=None)
        moment = moment_of(recording, row, "paused")
        moment = moment._replace(level={**moment.level, "closed": closed})
        console.print(View(recording.scene, HINT).draw(moment, console.width))
        picture = console.file.getvalue()  # type: ignore[attr-defined]
        lines = picture.splitlines()
        assert {len(line) for line in lines} == {min(width, 80)}
        assert len(lines) <= 15
        assert "…" not in picture
        places = 5 if width >= 66 else 3
        for number in recording.state[row]:
            assert f"{number:+.{places}f}" in picture
        assert f"{moment.impacts['left']:+.{places - 1}f}" in picture
        words = ("[L]", "(O)", "[R]", recording.scene.title, HINT, "closes", f"t = {moment.time:.3f} s   paused")
        assert all(word in picture for word in words)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e308, 9.0])
@pytest.mark.parametrize("name", ["V", "V_c", "mode", "alarm", "closed"])
def test_whatever_a_bag_says_of_the_energy_is_shown(recorded: Path, name: str, value: float) -> None:
    """Numbers of the monitor need not be finite; `grasp verify` says which are wrong."""
    recording, console = bag.read(recorded), Console(width=80, file=io.StringIO(), color_system=None)
    view, moment = View(recording.scene), moment_of(recording, 1, "paused")
    for level in ({**moment.level, name: value}, moment.level):
        console.print(view.draw(moment._replace(level=level), 80))
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert ("not known" in shown) is (name in ("mode", "alarm"))


@pytest.mark.parametrize(
    ("options", "words"),
    [(["--from", "3.5"], "--from: 3.5 is not allowed; allowed: 0 to 3 s"),
     (["--from", "nan"], "--from: nan is not allowed; allowed: 0 to 3 s"),
     (["--rate", "0"], "--rate: 0.0 is not allowed; allowed: 1e-06 to 1e+06")],
)
def test_what_cannot_be_shown_is_refused(recorded: Path, command: Any, options: list[str], words: str) -> None:
    found = command("watch", str(recorded), *options)
    assert (found.returncode, found.stderr) == (2, f"grasp: {words}\n")
    for option in ("--from", "--rate"):
        assert command("watch", option, "1").stderr == f"grasp: {option} 1.0 is not allowed; allowed: with a bag\n"
    assert command("watch", "bag", "--namespace", "/x").stderr.endswith("of a graph; allowed: without a bag\n")


def test_keys_pause_and_step_a_running_plant(launch: Any, tmp_path: Path, node: Any) -> None:
    case = scenes.load("case_01", ["time.duration_s=1000"])
    graph = Graph(case, tmp_path / "run", ACCURACY, one_process=True)
    with started(graph):
        screen = Screen(launch, *START, "watch")
        screen.wait(r"[1-9]\d* ticks/s")
        screen.press(b" ")
        wait_for(lambda: status(node)["state"] == "paused", "a pause")
        tick = status(node)["tick"]
        for step in (1, 2):
            screen.press(RIGHT)
            screen.wait(f"t = {case.time_of(tick + step):.3f} s")
            assert (status(node)["tick"], status(node)["state"]) == (tick + step, "paused")
        assert call("reset", node).success
        screen.wait(r"t = 0\.000 s   paused")  # what came before the reset is not drawn beside it
        screen.press(b" ")
        wait_for(lambda: status(node)["tick"] > tick + 10, "the run to go on")
        screen.press(RIGHT)
        wait_for(lambda: status(node)["state"] == "paused", "a pause")
        screen.press(b"q")
        assert screen.end() == 0
        assert screen.as_before
