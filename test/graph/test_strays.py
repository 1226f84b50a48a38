"""Which command acts, and which one the bag has, when there is more than one: the same, and never who came first."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from processes import DEADLINE, Terminals, growing, more_ticks
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from grasp_ros.graph import bag
from grasp_ros.graph.bag.verify import verify
from grasp_ros.graph.lockstep.synchronizer import GIVE_UP_SECONDS, UNCERTAIN_SECONDS, Arrival, Synchronizer
from grasp_ros.graph.serialization import force_message, raw_force
from grasp_ros.physics.layout import LEFT
from grasp_ros.scene.topics import ALIVE, JOINT_STATES, LEFT_COMMAND, LEFT_CONTACT, SCENE
from lab.drills.nodes import plain_messages

pytestmark = pytest.mark.slow

PERIOD, END = 1_000_000, 10**10


def state(tick: int, effort: float = 0.0) -> bytes:
    return serialize_message(plain_messages.joint_state(tick * PERIOD, [LEFT], np.zeros(6), np.full(3, effort)))


def command(tick: int, force: float) -> bytes:
    return force_message(tick * PERIOD, force)  # the bytes of the package's own controllers


@pytest.mark.parametrize("delay", [0, 2])
def test_where_two_may_have_sent_the_effort_of_a_later_state_decides(delay: int) -> None:
    ticks = Synchronizer([LEFT_COMMAND], ["left"], PERIOD, END, delay)
    ticks.put(JOINT_STATES, state(0))
    assert ticks.put(LEFT_COMMAND, command(0, 1e6), sure=False) is Arrival.TAKEN
    assert ticks.put(LEFT_COMMAND, command(0, 2.0), sure=False) is Arrival.CONTRADICTS
    assert ticks.put(LEFT_COMMAND, command(0, 3.0), sure=False) is Arrival.CONTRADICTS
    for tick in range(1, delay + 1):
        ticks.put(JOINT_STATES, state(tick))
        assert ticks.take() is None
    ticks.put(JOINT_STATES, state(delay + 1, effort=2.0))
    found = ticks.take()
    assert found is not None
    assert (raw_force(found.found[LEFT_COMMAND]), found.lost, found.restored) == (2.0, 0, 0)


def test_a_command_that_did_not_come_is_what_acted() -> None:
    ticks = Synchronizer([LEFT_COMMAND], ["left"], PERIOD, END)
    ticks.put(JOINT_STATES, state(0))
    ticks.put(JOINT_STATES, state(1, effort=-0.0))
    assert ticks.take(UNCERTAIN_SECONDS) is None
    found = ticks.take(UNCERTAIN_SECONDS + 0.1)
    assert found is not None
    assert found.found[LEFT_COMMAND] == command(0, -0.0)
    assert (found.lost, found.restored) == (0, 1)
    assert ticks.take(2 * GIVE_UP_SECONDS) is None  # nobody knows yet
    ticks.put(LEFT_COMMAND, command(1, 5.0), sure=False)
    ticks.put(LEFT_COMMAND, command(1, 6.0), sure=False)
    assert ticks.take(2 * GIVE_UP_SECONDS) is None
    ticks.put(JOINT_STATES, state(0, effort=7.0))  # the plant was reset: neither of them acts
    last = ticks.take(UNCERTAIN_SECONDS + 0.1)
    assert last is not None
    assert raw_force(last.found[LEFT_COMMAND]) == 6.0


def test_what_nothing_stands_for_is_given_up_later() -> None:
    ticks = Synchronizer([LEFT_CONTACT], ["left"], PERIOD, END)
    ticks.put(JOINT_STATES, state(0))
    ticks.put(JOINT_STATES, state(1))
    assert ticks.take(GIVE_UP_SECONDS) is None
    found = ticks.take(GIVE_UP_SECONDS + 0.1)
    assert found is not None
    assert found.lost == 1


def test_who_comes_late_takes_what_comes_before_the_first_state() -> None:
    """It was of a wrong stamp, and lacked in the first ticks."""
    ticks, late = Synchronizer([LEFT_COMMAND], ["left"], PERIOD, END), 6000
    assert ticks.put(LEFT_COMMAND, command(late, 2.0)) is Arrival.TAKEN
    ticks.put(JOINT_STATES, state(late))
    ticks.put(JOINT_STATES, state(late + 1, effort=2.0))  # it has acted, and is no stray
    found = ticks.take()
    assert found is not None
    assert (raw_force(found.found[LEFT_COMMAND]), found.lost) == (2.0, 0)
    assert ticks.put(LEFT_COMMAND, command(2 * late, 2.0)) is Arrival.STAMP


def test_a_message_that_a_reset_overtakes_is_of_its_state() -> None:
    """It was of a wrong stamp, far ahead of the state after the reset, and counted as lost."""
    ticks, late = Synchronizer([LEFT_CONTACT], ["left"], PERIOD, END), 3000
    ticks.put(JOINT_STATES, state(late))
    ticks.put(JOINT_STATES, state(0))
    assert ticks.put(LEFT_CONTACT, command(2 * late, 1.0)) is Arrival.STAMP
    assert ticks.put(LEFT_CONTACT, command(late, 1.0)) is Arrival.TAKEN
    assert ticks.put(LEFT_CONTACT, command(0, 2.0)) is Arrival.TAKEN
    for tick, force in ((late, 1.0), (0, 2.0)):
        found = ticks.take()
        assert found is not None
        assert (found.time_ns, raw_force(found.found[LEFT_CONTACT]), found.lost) == (tick * PERIOD, force, 0)


STRAY = """
import rclpy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node("stray")
latest = []
node.create_subscription(JointState, "joint_states", lambda state: latest.append(state.header), 1000)
for number in range(8):
    latest.clear()  # they go on
    while not latest:
        rclpy.spin_once(node, timeout_sec=0.01)
    commands = node.create_publisher(WrenchStamped, "left/effort_command", 1000)
    while commands.get_subscription_count() < 2:
        rclpy.spin_once(node, timeout_sec=0.001)
    command = WrenchStamped(header=latest[-1])
    command.wrench.force.x = 1e6
    for ahead in range(20):  # one of them is the current one
        commands.publish(command)
        command.header.stamp.nanosec = (command.header.stamp.nanosec + 1_000_000) % 1_000_000_000
    node.destroy_publisher(commands)
print("done", flush=True)
"""


@pytest.mark.slow  # real processes
def test_a_stray_with_the_stamp_of_the_state_neither_acts_nor_is_recorded(
    launch: Any, grasp_run: Any, tmp_path: Path
) -> None:
    run = grasp_run("case_01", "--set", "time.duration_s=1000", "--peer-timeout", "20")
    file = growing(tmp_path / "run" / "bag")
    assert launch(sys.executable, "-c", STRAY, stdout=subprocess.PIPE).communicate(timeout=DEADLINE)[0] == "done\n"
    more_ticks(file)
    run.send_signal(signal.SIGINT)
    _, err = run.communicate(timeout=DEADLINE)
    assert run.returncode == 0, err
    assert "left/effort_command: commands while sources change: " in err
    recording = bag.read(tmp_path / "run" / "bag")
    assert not any(recording.missing.values())
    assert verify(recording).holds
    assert np.abs(recording.command).max() < 100.0
    assert recording.closed
    assert int(recording.lost["lost messages"]) == 0
    command = recording.command.copy()
    command[300, LEFT] = np.nan
    found = verify(replace(recording, command=command))
    assert not found.holds
    assert found.words.endswith("; the bag lacks left/effort_command of 1 ticks, the first 300")
    assert (str(found.answers["left"]), found.same) == ("the scene's law", None)  # and of nobody else


CHURN = """
import rclpy
from geometry_msgs.msg import WrenchStamped
rclpy.init()
node = rclpy.create_node("churn")
while True:
    node.destroy_publisher(node.create_publisher(WrenchStamped, "left/effort_command", 10))
    rclpy.spin_once(node, timeout_sec=0.05)
"""


@pytest.mark.slow  # real processes
def test_sources_that_come_and_go_are_named_with_their_topic(launch: Any, grasp_run: Any, tmp_path: Path) -> None:
    run = grasp_run("case_01", "--set", "time.duration_s=1000", "--peer-timeout", "1", "--no-check", "--no-figure")
    growing(tmp_path / "run" / "bag")
    launch(sys.executable, "-c", CHURN, stderr=subprocess.DEVNULL)
    _, err = run.communicate(timeout=DEADLINE)
    assert run.returncode == 1, err
    assert re.search("plant: left/effort_command: (2 sources, |sources come and go, seen: ).*/left_controller.*;"
                     " allowed in lockstep: one;", err)


HARD = """
import rclpy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node("hard")
commands = node.create_publisher(WrenchStamped, "left/effort_command", 1000)
asked = []
def answer(state):
    command = WrenchStamped(header=state.header)
    command.wrench.force.x = 0.25 if state.header.stamp.nanosec in asked else -1e3
    asked.append(state.header.stamp.nanosec)
    if len(asked) > 3:
        command.wrench.force.x = 0.25
    commands.publish(command)
while commands.get_subscription_count() < 2:
    rclpy.spin_once(node, timeout_sec=0.01)
node.create_subscription(JointState, "joint_states", answer, 1000)
rclpy.spin(node)
"""


@pytest.mark.slow  # real processes
@pytest.mark.parametrize("kind", [[], ["--free-running"]], ids=["lockstep", "free-running"])
@pytest.mark.thorough
def test_a_command_beyond_the_actuator_is_named_and_does_not_act(
    launch: Any, grasp_run: Any, tmp_path: Path, kind: list[str]
) -> None:
    run = grasp_run("saturation", "--set", "time.duration_s=3.0", "--without", "left_controller", "--no-figure", *kind)
    launch(sys.executable, "-c", HARD, stderr=subprocess.DEVNULL)
    _, err = run.communicate(timeout=DEADLINE)
    assert run.returncode == 0, err
    assert re.search(r"left/effort_command: commands beyond a limit: 1; sources: .*; -1000 N; allowed by the", err)
    recording = bag.read(tmp_path / "run" / "bag")
    assert verify(recording).holds
    assert set(recording.effort[:, LEFT]) <= {0.0, 0.25}


@pytest.mark.slow  # real processes
def test_whom_dds_does_not_connect_holds_nobody_up(grasp_run: Any, node: tuple[Any, Any]) -> None:
    """Readers and writers of another type, or of a quality of service that is not offered, from before the start on."""
    peer, _ = node
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    hasty = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    for kind, topic, qos in ((String, LEFT_COMMAND, 1), (WrenchStamped, LEFT_CONTACT, hasty), (JointState, ALIVE, 1)):
        peer.create_publisher(kind, topic.name, qos)
    peer.create_publisher(JointState, JOINT_STATES.name, hasty)
    often, lively = (QoSProfile(depth=1, **{name: Duration(seconds=9)})
                     for name in ("deadline", "liveliness_lease_duration"))
    for qos in (latched, often, lively):
        peer.create_subscription(JointState, JOINT_STATES.name, print, qos)
    peer.create_subscription(JointState, SCENE.name, print, 1)
    run = grasp_run("arm_alone", "--set", "time.duration_s=1", "--no-figure")
    out, err = run.communicate(timeout=DEADLINE)
    assert run.returncode == 0, err
    assert "1001 states follow from the recorded inputs, bit for bit" in out


@pytest.mark.slow  # real processes
def test_a_graph_that_slept_as_a_whole_goes_on(launch: Any, tmp_path: Path) -> None:
    """Nobody takes his own pause for the silence of others, although all end for silence."""
    graph = Terminals(launch, tmp_path, "case_01", ["-p", "peer_timeout_s:=0.6", "-p", "on_silence:=end"])
    processes = graph.processes.values()
    for process in processes:
        process.send_signal(signal.SIGSTOP)
    with pytest.raises(subprocess.TimeoutExpired):  # longer than a slow one may take
        graph.processes["plant"].wait(3.0)
    for process in processes:
        process.send_signal(signal.SIGCONT)
    more_ticks(graph.file)
    assert "this node was suspended for" in graph.said()
    for process in processes:
        process.send_signal(signal.SIGINT)
    assert [process.wait(DEADLINE) for process in processes] == [0, 0, 0, 0], graph.said()
    recording = bag.read(tmp_path / "bag")
    assert not any(recording.missing.values())
    assert verify(recording).holds
