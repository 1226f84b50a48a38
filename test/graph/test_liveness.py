"""A node that is killed or frozen is noticed and named by those that need it, within two seconds."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from graphs import whole
from processes import (
    DEADLINE,
    Terminals,
    children,
    ended,
    growing,
    more_ticks,
    node_command,
    stranger,
    wait_for,
    write_law,
)
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from grasp_ros.graph import bag
from grasp_ros.graph.health.heartbeat import Heartbeat, Heartbeats, digest
from grasp_ros.graph.health.peers import Need
from grasp_ros.graph.nodes.controller import Controller
from grasp_ros.graph.ros import messages
from grasp_ros.graph.ros.node import NEW, GraspNode
from grasp_ros.scene.topics import JOINT_STATES
from grasp_ros.scene.topics import RUN as RUNNING

pytestmark = pytest.mark.slow  # real processes
SIGN = {"node": "/plant", "identity": "first", "texts": [], "ended": "", "process": "", "ready": True}  # of life


@pytest.fixture
def levels(node: Any) -> Any:
    """Levels of /diagnostics by node, as they are now."""
    peer, executor = node
    found: dict[str, bytes] = {}

    def note(message: DiagnosticArray) -> None:
        found.update({status.name: status.level for status in message.status})

    peer.create_subscription(DiagnosticArray, "/diagnostics", note, 10)

    def now() -> dict[str, bytes]:
        executor.spin_once(timeout_sec=0.01)
        return found

    return now


@pytest.mark.thorough
def test_who_waits_says_for_whom_and_goes_on_when_it_is_back(launch: Any, tmp_path: Path, levels: Any) -> None:
    """Each of four nodes frozen and thawed in turn: no tick is lost, and the bag is right."""
    graph = Terminals(launch, tmp_path, {"time.duration_s": 3600.0})
    needs = {  # who misses a message of the first
        "left_controller": ("plant", r"effort_command: no (heartbeat|answer).* of /left_controller for 1\.\d s"),
        "monitor": ("plant", r"lyapunov: no (heartbeat|answer).* of /monitor for 1\.\d s"),
        "plant": ("right_controller", r"joint_states: no heartbeat of /plant for 1\.5 s"),
    }
    for name, (other, words) in needs.items():
        graph.processes[name].send_signal(signal.SIGSTOP)
        graph.wait_for(other, words)
        wait_for(lambda other=other: levels().get(f"/{other}") == DiagnosticStatus.ERROR, "an error in /diagnostics")
        graph.processes[name].send_signal(signal.SIGCONT)
        wait_for(lambda other=other: "is back after" in graph.said(other).split("keeps waiting")[-1], "its end")
        wait_for(lambda other=other: levels().get(f"/{other}") == DiagnosticStatus.WARN, "a warning from then on")
        assert "this node was suspended for" in graph.said(name)
    graph.processes["right_controller"].kill()
    graph.wait_for("plant", r"right/effort_command: no (heartbeat|answer).* of /right_controller for 1\.\d s")
    launch(*node_command("right_controller", wait_for_monitor="true"), stderr=subprocess.DEVNULL)
    wait_for(lambda: "right/effort_command: is back after" in graph.said("plant"), "the one in its place")
    more_ticks(graph.file)
    graph.processes["plant"].send_signal(signal.SIGINT)
    assert graph.processes["monitor"].wait(DEADLINE) == 1
    assert re.search(r"joint_states: /plant has ended; the bag has \d+ ticks", graph.said("monitor"))
    whole(tmp_path / "bag")
    assert "Traceback" not in graph.said()


FAULTS = [  # and the last sentence, in the words of the first that has noticed
    ("left_controller", signal.SIGSTOP, r"left/effort_command: no (heartbeat|answer).* of /left_controller for 1"
     r"|left_controller: was suspended"),
    ("monitor", signal.SIGKILL, r"monitor: was killed by SIGKILL"),
    ("plant", signal.SIGSTOP, r"joint_states: no heartbeat of /plant for 1\.5 s|plant: was suspended"),
    ("plant", signal.SIGTERM, r"plant: was ended by SIGTERM"),
    pytest.param("right_controller", signal.SIGINT, r"right_controller: was ended by SIGINT",
                 marks=pytest.mark.thorough),
    ("graph", signal.SIGSTOP, r"graph: was suspended for more than 1\.5 s"),
]


@pytest.mark.parametrize(("name", "number", "words"), FAULTS)
def test_a_run_ends_with_a_sentence(
    grasp_run: Any, tmp_path: Path, name: str, number: signal.Signals, words: str
) -> None:
    run = grasp_run("case_01", *(["--one-process"] if name == "graph" else []))
    file = growing(tmp_path / "run" / "bag", 50_000)
    os.kill(children(tmp_path)[name], number)
    _, err = ended(run, 1)
    assert re.fullmatch(rf"grasp: .*({words}).*; run/bag has what was recorded", err.splitlines()[-1]), err
    whole(file.parent)
    assert (number == signal.SIGKILL) is not (file.parent / "metadata.yaml").exists()


def test_what_the_executor_was_not_told_of_is_found(make: Any, node: Any) -> None:
    """A message, and a call of a service, that lie there without a wake-up: nobody spins this node."""
    (peer, executor), waiting = node, make(GraspNode, "waiting")
    heard: list[str] = []
    waiting.subscribe(RUNNING, lambda message: heard.append(message.data))
    waiting.create_service(Trigger, "~/status", lambda _, answer: answer)
    publisher = peer.create_publisher(String, RUNNING.name, messages.qos(RUNNING))
    publisher.publish(String(data="text"))
    client = peer.create_client(Trigger, "/waiting/status")
    assert client.wait_for_service(timeout_sec=DEADLINE)
    answers: list[Any] = []

    def found() -> bool:
        answers.append(client.call_async(Trigger.Request()))  # again: the way back may not be known yet
        waiting.sweep()
        executor.spin_once(timeout_sec=0.01)
        return bool(heard) and any(answer.done() for answer in answers)

    wait_for(found, "both")
    assert heard == ["text"]


def test_who_is_busy_was_not_stopped(launch: Any, tmp_path: Path) -> None:
    write_law(tmp_path, "time.sleep(1.6 if tick == 50 else 0.0)")
    plant = launch(*node_command("plant", scene="arm_alone", **{"time.duration_s": 0.1}), stderr=subprocess.DEVNULL)
    controller = launch(*node_command("left_controller", law="mine:law"), cwd=tmp_path, stderr=subprocess.PIPE)
    assert plant.wait(DEADLINE) == 0
    controller.terminate()
    assert "this node was suspended" not in controller.communicate(timeout=DEADLINE)[1]


def test_who_prepares_is_waited_for_and_who_does_not_come_is_not(
    context: rclpy.Context, make: Any, executor: SingleThreadedExecutor
) -> None:
    """A node that nobody spins is as one that compiles: its signs come from a thread of their own."""
    other = Controller("right_controller", context=context)
    controller = make(Controller, "left_controller", start_timeout_s=1.6, on_silence="end")
    executor.add_node(controller)
    end = time.monotonic() + 4.0
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    assert not controller.finished
    other.close()
    other.destroy_node()
    wait_for(lambda: executor.spin_once(timeout_sec=0.1) or controller.finished, "its end")
    assert "timeout of 1.6 s" in controller.words


AWAY = """
import fcntl, os, time
os.makedirs("away", exist_ok=True)
os.chdir("away")
own = open("mine", "w")
fcntl.flock(own, fcntl.LOCK_EX | fcntl.LOCK_NB)  # which one process can have
def law(tick, t, x, v):
    if tick >= 50:  # of a free run it does not see each
        os.chdir("/")
    if tick >= 500:
        time.sleep(3600.0)
    return -5.0 * x - 0.5 * v
"""


@pytest.mark.parametrize("how", [(), ("--free-running",)])
def test_a_law_that_goes_away_is_followed_and_one_that_stands_in_one_process_has_as_long_as_in_four(
    grasp_run: Any, tmp_path: Path, how: tuple[str, ...]
) -> None:
    (tmp_path / "mine.py").write_text(AWAY)
    run = grasp_run("case_01", "--one-process", "--controller", "left=mine:law", *how)
    _, err = ended(run, 1)  # in less time than a first answer may take
    words = r"^grasp: left_controller: blocked for \d+\.\d s: in .*mine.py, line 11; run/bag has what"
    assert re.search(words, err, re.M), err
    assert bag.read(tmp_path / "run" / "bag").tick[-1] > 100


@pytest.mark.parametrize("line", ["time.sleep(3600.0)", "input()"])
def test_a_law_whose_import_does_not_return_is_named(launch: Any, tmp_path: Path, line: str) -> None:
    (tmp_path / "mine.py").write_text(f"import time\n{line}\n")
    words = node_command("left_controller", law="mine:law", start_timeout_s=1.0, peer_timeout_s=0.5, on_silence="end")
    with launch(*words, cwd=tmp_path, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as node:
        node.wait(DEADLINE)  # its standard input stays open
        err = node.stderr.read()
    assert re.search(r"^\[FATAL\] \[left_controller\]: blocked for \d\.\d s: in .*mine.py, line 2$", err, re.M), err


def test_who_stands_because_another_was_stopped_says_so_and_ends(launch: Any, tmp_path: Path) -> None:
    """As in a call of DDS that waits for a lock which a stopped process holds."""
    write_law(tmp_path, "if tick == 50:", "    os.mkdir('standing')", "    time.sleep(3600.0)")
    plant = launch(*node_command("plant", scene="arm_alone"), stderr=subprocess.DEVNULL)
    words = node_command("left_controller", law="mine:law", on_silence="end")
    controller = launch(*words, cwd=tmp_path, stderr=subprocess.PIPE)
    wait_for((tmp_path / "standing").exists, "a law that stands")
    plant.send_signal(signal.SIGSTOP)
    _, err = ended(controller, 1)
    assert re.search(r"\[FATAL\] \[left_controller\]: blocked for \d+\.\d s: /plant suspended\n", err), err


def test_one_that_has_just_come_is_not_silent_as_the_one_before_it(make: Any) -> None:
    heartbeats = Heartbeats(make(GraspNode, "waiting"), lambda: None, lambda: None)
    heartbeats._on_beat(String(data=json.dumps(SIGN)))
    assert heartbeats.quiet(["/plant"], time.monotonic()) == ["/plant"]
    heartbeats._on_beat(String(data=json.dumps({**SIGN, "ended": "ended"})))
    assert heartbeats.quiet(["/plant"], time.monotonic()) == []  # whom DDS lists by now is another one
    heartbeats.end("")


@pytest.mark.parametrize("process", ["", " ", "\t1", "1", "1 2 3", "x y", "../self 1"])
def test_a_process_that_this_machine_does_not_have_is_not_running(process: str) -> None:
    """Anybody can send a heartbeat with any words."""
    assert not Heartbeat("/plant", "first", [], "", process, ready=True).runs


def test_a_process_of_another_host_is_not_one_of_this_host_with_its_number(make: Any) -> None:
    heartbeats = Heartbeats(make(GraspNode, "waiting"), lambda: None, lambda: None)
    own = heartbeats.own.process
    heartbeats.end("")
    number, begun, *whose = own.split()
    assert Heartbeat("/plant", "first", [], "", own, ready=True).runs
    for other in (["another", whose[1]], [whose[0], "pid:[1]"]):
        assert not Heartbeat("/plant", "first", [], "", " ".join([number, begun, *other]), ready=True).runs


def test_only_who_has_said_so_has_ended(make: Any) -> None:
    """Without last words, the network may be cut."""
    node = make(Controller, "left_controller")
    node._last[JOINT_STATES], node._gone[JOINT_STATES] = ["/plant"], 0.0
    for last, words in (("", "is no longer connected"), ("ended", "has ended"), ("full", "has ended: full")):
        node.heartbeats._on_beat(String(data=json.dumps({**SIGN, "ended": last})))
        trouble = node._trouble_with(Need(JOINT_STATES), time.monotonic())
        assert trouble.words == f"joint_states: /plant {words}"


def test_a_refused_text_names_who_was_a_source_when_it_came(
    make: Any, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """It waits for a digest; whoever has sent it may be gone by then, and the plant still there."""
    node = make(Controller, "left_controller", peer_timeout_s=0.2)
    node.heartbeats._on_beat(String(data=json.dumps({**SIGN, "texts": [digest("a scene")]})))
    monkeypatch.setattr(node, "sources", lambda _: ["/plant", "/stray"])
    node._on_text(RUNNING, print, String(data="no run"))
    monkeypatch.setattr(node, "sources", lambda _: ["/plant"])
    wait_for(lambda: node.heard() or not node._texts, "the refusal")
    assert "run: refused texts: 1; sources seen: /plant and /stray\n" in capfd.readouterr().err


def test_a_node_whose_name_goes_before_its_topics_is_named(make: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node, need = make(Controller, "left_controller"), Need(JOINT_STATES)
    for names in (["/plant"], [NEW]):
        monkeypatch.setattr(node, "sources", lambda _, names=names: names)
        node._trouble_with(need, time.monotonic())
    monkeypatch.setattr(node, "sources", lambda _: [])
    node._trouble_with(need, 0.0)
    assert node._trouble_with(need, time.monotonic()).words == "joint_states: /plant is no longer connected"


@pytest.mark.thorough
def test_a_process_whose_own_end_hangs_is_ended(grasp_run: Any, tmp_path: Path) -> None:
    """DDS waits for ever for what a law has closed."""
    write_law(tmp_path, "os.closerange(3, 200)")
    run = grasp_run("case_01", "--one-process", "--controller", "left=mine:law")
    _, err = ended(run, 1)
    assert "Bad file descriptor" in err
    wait_for(lambda: not children(tmp_path), "the end of all processes")


def test_who_waits_for_an_acknowledgement_lets_other_threads_go_on(launch: Any, node: Any) -> None:
    """Heartbeats come from one. A reader that was killed never acknowledges."""
    publisher = node[0].create_publisher(JointState, "joint_states", 10)
    reader = launch(*stranger("reader", "node.create_subscription(JointState, 'joint_states', print, 10)\n"
                                        "rclpy.spin(node)"))
    wait_for(lambda: publisher.get_subscription_count() == 1, "the reader")
    reader.kill()
    reader.wait()
    publisher.publish(JointState())
    turns: list[bool] = []
    over = threading.Event()

    def go_on() -> None:
        while not over.wait(0.01):
            turns.append(True)

    other = threading.Thread(target=go_on)
    other.start()
    assert not GraspNode.flush(node[0], publisher, seconds=0.5)
    over.set()
    other.join()
    assert len(turns) > 5
