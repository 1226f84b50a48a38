"""What strangers send to a running graph, and what they fail to send: it is named, and nothing is lost."""

from __future__ import annotations

import re
import signal
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from graphs import whole
from processes import DEADLINE, START, Terminals, ended, growing, more_ticks, stranger, wait_for
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from grasp_ros import scene
from grasp_ros.graph.bag.verify import verify
from grasp_ros.graph.ros import messages
from grasp_ros.physics.layout import LEFT
from grasp_ros.scene.topics import ALIVE, JOINT_STATES, LEFT_COMMAND, LEFT_CONTACT, SCENE

pytestmark = pytest.mark.slow  # real processes

STRAY = """
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


def test_a_stray_with_the_stamp_of_the_state_neither_acts_nor_is_recorded(
    launch: Any, grasp_run: Any, tmp_path: Path
) -> None:
    run = grasp_run("case_01", "--set", "time.duration_s=1000", "--peer-timeout", "20")
    file = growing(tmp_path / "run" / "bag")
    assert launch(*stranger("stray", STRAY), stdout=subprocess.PIPE).communicate(timeout=DEADLINE)[0] == "done\n"
    more_ticks(file)
    run.send_signal(signal.SIGINT)
    _, err = ended(run)
    assert "left/effort_command: commands while sources change: " in err
    recording = whole(tmp_path / "run" / "bag")
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
while True:
    node.destroy_publisher(node.create_publisher(WrenchStamped, "left/effort_command", 10))
    rclpy.spin_once(node, timeout_sec=0.05)
"""


def test_sources_that_come_and_go_are_named_with_their_topic(launch: Any, grasp_run: Any, tmp_path: Path) -> None:
    run = grasp_run("case_01", "--set", "time.duration_s=1000", "--peer-timeout", "1", "--no-check", "--no-figure")
    growing(tmp_path / "run" / "bag")
    launch(*stranger("churn", CHURN), stderr=subprocess.DEVNULL)
    _, err = ended(run, 1)
    assert re.search("plant: left/effort_command: (2 sources, |sources come and go, seen: ).*/left_controller.*;"
                     " allowed in lockstep: one;", err)


HARD = """
asked = []
def force_for(state):
    force = 0.25 if len(asked) > 2 or state.header.stamp.nanosec in asked else -1e3
    asked.append(state.header.stamp.nanosec)
    return force
"""


@pytest.mark.parametrize("kind", [[], ["--free-running"]], ids=["lockstep", "free-running"])
@pytest.mark.thorough
def test_a_command_beyond_the_actuator_is_named_and_does_not_act(
    launch: Any, grasp_run: Any, tmp_path: Path, kind: list[str]
) -> None:
    run = grasp_run("saturation", "--set", "time.duration_s=3.0", "--without", "left_controller", "--no-figure", *kind)
    launch(*stranger("hard", HARD, answers=True), stderr=subprocess.DEVNULL)
    _, err = ended(run)
    assert re.search(r"left/effort_command: commands beyond a limit: 1; sources seen: .*; -1000 N; allowed by the", err)
    recording = whole(tmp_path / "run" / "bag")
    assert set(recording.effort[:, LEFT]) <= {0.0, 0.25}


FORGETFUL = """
lost = [0, 50_000_000, 200_000_000]
def force_for(state):
    if state.header.stamp.nanosec in lost:  # as if it had not come
        lost.remove(state.header.stamp.nanosec)
        return None
    i = state.name.index("left")
    return -5.0 * state.position[i] - 0.5 * state.velocity[i]
"""


def test_a_state_that_is_lost_comes_again_and_is_in_the_bag_once(launch: Any, grasp_run: Any, tmp_path: Path) -> None:
    """With a controller that gives no sign of life."""
    run = grasp_run("case_01", "--set", "time.duration_s=0.3", "--no-figure", "--without", "left_controller")
    launch(*stranger("forgetful", FORGETFUL, answers=True), stderr=subprocess.DEVNULL)
    ended(run)
    recording = whole(tmp_path / "run" / "bag")
    assert recording.tick.tolist() == list(range(301))
    assert int(recording.lost["repeated messages"]) + int(recording.lost["repeated states"]) > 0


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
    out, _ = ended(run)
    assert "1001 states follow from the recorded inputs, bit for bit" in out


def test_a_graph_that_slept_as_a_whole_goes_on(launch: Any, tmp_path: Path) -> None:
    """Nobody takes his own pause for the silence of others, although all end for silence."""
    graph = Terminals(launch, tmp_path, peer_timeout_s=0.6, on_silence="end")
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
    whole(tmp_path / "bag")


ROGUE = """
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
wrench = WrenchStamped()
wrench.header.stamp = node.get_clock().now().to_msg()
crooked = JointState(name=["left", "left"], position=[1e300], velocity=[float("nan")] * 3)
crooked.header.frame_id = "\\x07" * 100000
far = JointState(name=["V"], position=[float("inf")])
far.header.stamp.sec = 2**31 - 1
health = DiagnosticArray(status=[DiagnosticStatus(name="rogue", message="y" * 200000)])
with open(sys.argv[1]) as file:
    other = file.read()
once = [("scene", String(data=other), latched), ("run", String(data="{["), latched),
        ("scene", String(data="a: &a [*a, *a]"), latched), ("run", String(data=other * 2000), latched)]
often = [("alive", String(data="[1, 2"), 10), ("alive", String(data="[" * 3000), 10), ("lyapunov", far, 10),
         ("lyapunov", crooked, 10), ("left/parameters", crooked, latched), ("/diagnostics", health, 10),
         ("lyapunov", b"\\0", 10), ("left/parameters", b"\\0\\1", latched),
         ("alive", b"\\0\\1\\0\\0\\xff\\xff", 10)]
kinds = {"lyapunov": JointState, "left/parameters": JointState, "alive": String}
publishers = [(node.create_publisher(kinds.get(topic, type(message)), topic, qos), message)
              for topic, message, qos in once + often]
flood = node.create_publisher(WrenchStamped, "contact/left", 1000)
input()
heard = [publisher for publisher, _ in publishers if publisher.topic_name in ("/scene", "/lyapunov")]
while not all(publisher.get_subscription_count() for publisher in [*heard, flood]):
    time.sleep(0.01)
end = time.monotonic() + float(sys.argv[2])
for number in range(10**9):
    if time.monotonic() > end:
        break
    for publisher, message in publishers if number % 500 == 0 else ():
        publisher.publish(message)
    flood.publish(wrench)
"""


@pytest.mark.thorough
def test_a_rogue_at_full_speed_on_every_other_topic_costs_no_tick(launch: Any, grasp_run: Any, tmp_path: Path) -> None:
    (tmp_path / "other.yaml").write_text(scene.load("case_09").to_yaml())
    rogue = launch(*stranger("rogue", ROGUE), str(tmp_path / "other.yaml"), "4", stdin=subprocess.PIPE)
    run = grasp_run("case_01", "--set", "time.duration_s=8")
    growing(tmp_path / "run" / "bag")
    rogue.stdin.write("\n")
    rogue.stdin.close()
    out, err = ended(run)
    assert "8001 states follow from the recorded inputs, bit for bit" in out
    for words in ("contact/left: messages with a wrong stamp", "scene: refused texts", "lyapunov: refused records"):
        assert re.search(rf"{words}: \d+; sources seen: .*(/rogue|not known yet)", err), err
    found = whole(tmp_path / "run" / "bag")
    assert int(found.lost["messages with a wrong stamp"]) > 100
    assert found.size < 20e6


def test_a_text_that_no_plant_vouches_for_starts_nothing(launch: Any, tmp_path: Path, node: Any) -> None:
    peer, _ = node
    publisher = peer.create_publisher(String, SCENE.name, messages.qos(SCENE))
    publisher.publish(String(data="no scene"))
    with (tmp_path / "log").open("w") as log:
        controller = launch(*START, "left_controller", stderr=log)
    said = re.compile("scene: refused texts: 1; sources seen: (/peer|a node whose name is not known yet)")
    wait_for(lambda: said.search((tmp_path / "log").read_text()), "the refusal")
    assert controller.poll() is None
