"""What a node does with messages that cannot be true: it counts them, says whose they may be, and loses nothing."""

from __future__ import annotations

import re
import subprocess
import sys
from array import array
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import DEADLINE, START, growing, wait_for
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from grasp_ros import scene
from grasp_ros.graph import bag
from grasp_ros.graph.bag.verify import verify
from grasp_ros.graph.lockstep.synchronizer import PATIENCE_TICKS, Arrival, Synchronizer
from grasp_ros.graph.ros import messages
from grasp_ros.graph.serialization import MOST_BYTES, raw_force
from grasp_ros.scene.topics import JOINT_STATES, LEFT_COMMAND, SCENE
from lab.drills.nodes import plain_messages

PERIOD, END = 1_000_000, 10**10
BODIES = [0]


def state(tick: int, position: float = 0.5) -> bytes:
    return serialize_message(plain_messages.joint_state(tick * PERIOD, BODIES, np.full(6, position), np.zeros(3)))


def command(tick: int, force: float = 1.0) -> bytes:
    return serialize_message(plain_messages.wrench(tick * PERIOD, force))


def ticks() -> Synchronizer:
    return Synchronizer([LEFT_COMMAND], ["left"], PERIOD, END)


def test_a_force_is_read_from_the_bytes_whatever_the_frame() -> None:
    for length in range(20):
        message = plain_messages.wrench(7, -1.5)
        message.header.frame_id = "x" * length
        assert raw_force(serialize_message(message)) == -1.5


def test_messages_that_cannot_be_true_are_refused_by_kind() -> None:
    found = ticks()
    assert found.put(JOINT_STATES, state(0)) is Arrival.TAKEN
    strange = plain_messages.joint_state(PERIOD, BODIES, np.zeros(6), np.zeros(3))
    strange.velocity = array("d", [1.0, 2.0])
    nobody = plain_messages.joint_state(PERIOD, BODIES, np.zeros(6), np.zeros(3))
    nobody.name = ["nobody"]
    long = plain_messages.wrench(0, 1.0)
    long.header.frame_id = "x" * MOST_BYTES
    for topic, cdr, arrival in (
        (JOINT_STATES, serialize_message(strange), Arrival.REFUSED),
        (JOINT_STATES, serialize_message(nobody), Arrival.REFUSED),
        (JOINT_STATES, state(1, np.nan), Arrival.REFUSED),
        (JOINT_STATES, state(1)[:20], Arrival.REFUSED),
        (JOINT_STATES, state(END // PERIOD + 1), Arrival.STAMP),
        (LEFT_COMMAND, command(1, np.inf), Arrival.REFUSED),
        (LEFT_COMMAND, serialize_message(long), Arrival.REFUSED),
        (LEFT_COMMAND, b"", Arrival.REFUSED),
        (LEFT_COMMAND, serialize_message(plain_messages.wrench(1, 1.0)), Arrival.STAMP),  # no tick
        (LEFT_COMMAND, serialize_message(plain_messages.wrench(1_800_000_000_000_000_000, 1.0)), Arrival.STAMP),
        (LEFT_COMMAND, command(PATIENCE_TICKS + 1), Arrival.STAMP),
        (LEFT_COMMAND, command(-1), Arrival.STAMP),
        (LEFT_COMMAND, command(1), Arrival.TAKEN),
        (LEFT_COMMAND, command(1), Arrival.REPEATED),
        (LEFT_COMMAND, command(1, 2.0), Arrival.CONTRADICTS),
    ):
        assert found.put(topic, cdr) is arrival, (topic.name, cdr[:40])


def test_a_state_that_comes_again_is_one_tick_and_a_reset_is_two() -> None:
    found = ticks()
    for tick in (0, 0, 1, 1):
        found.put(JOINT_STATES, state(tick))
        found.put(LEFT_COMMAND, command(tick))
        if tick == 0:
            found.take()
    assert [row.time_ns for row in iter(found.take, None)] == [PERIOD]
    assert found.put(JOINT_STATES, state(1)) is Arrival.AGAIN
    found.put(LEFT_COMMAND, command(1, 3.0))  # of the repetition, or the first of another run that has come this far
    for tick in (0, 1):
        assert found.put(LEFT_COMMAND, command(tick, 7.0)) is Arrival.TAKEN
        assert found.put(JOINT_STATES, state(tick)) is Arrival.TAKEN
    rows = list(iter(found.take, None))
    assert [(row.time_ns, row.restarted) for row in rows] == [(0, True), (PERIOD, False)]
    assert [raw_force(row.found[LEFT_COMMAND]) for row in rows] == [7.0, 7.0]
    assert found.put(JOINT_STATES, state(0)) is Arrival.TAKEN
    found.put(LEFT_COMMAND, command(0))
    assert found.take() is not None
    assert found.put(JOINT_STATES, state(0)) is Arrival.AGAIN


def test_a_command_from_before_the_first_state_gives_way_to_the_one_that_answers_it() -> None:
    """It was recorded in place of the answer, and the bag did not follow from its inputs."""
    found = ticks()
    assert found.put(LEFT_COMMAND, command(0, 0.0)) is Arrival.TAKEN
    found.put(JOINT_STATES, state(0))
    assert found.take() is None
    assert found.put(LEFT_COMMAND, command(0, 1.5)) is Arrival.TAKEN
    row = found.take()
    assert row is not None
    assert raw_force(row.found[LEFT_COMMAND]) == 1.5


def test_the_last_tick_waits_for_no_later_state() -> None:
    """Where sources had just changed it stood until DDS forgot the dead one."""
    found, last = ticks(), END // PERIOD
    found.put(JOINT_STATES, state(last))
    found.put(LEFT_COMMAND, command(last), sure=False)
    assert found.take() is None
    row = found.take(waited=2.0)
    assert row is not None
    assert LEFT_COMMAND in row.found


def test_what_is_kept_is_bounded() -> None:
    found = ticks()
    for tick in range(4 * PATIENCE_TICKS):
        found.put(LEFT_COMMAND, command(tick % (PATIENCE_TICKS + 1)))
        found.put(LEFT_COMMAND, command(tick))
    assert len(found._others[LEFT_COMMAND]) <= 2 * PATIENCE_TICKS


ROGUE = """
import sys, time, rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("rogue")
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


@pytest.mark.slow  # real processes
@pytest.mark.thorough
def test_a_rogue_at_full_speed_on_every_other_topic_costs_no_tick(
    launch: Any, grasp_run: Any, tmp_path: Path
) -> None:
    (tmp_path / "other.yaml").write_text(scene.load("case_09").to_yaml())
    rogue = launch(sys.executable, "-c", ROGUE, str(tmp_path / "other.yaml"), "4", stdin=subprocess.PIPE)
    run = grasp_run("case_01", "--set", "time.duration_s=8")
    growing(tmp_path / "run" / "bag")
    rogue.stdin.write("\n")
    rogue.stdin.close()
    out, err = run.communicate(timeout=DEADLINE)
    assert run.returncode == 0, err
    assert "8001 states follow from the recorded inputs, bit for bit" in out
    for words in ("contact/left: messages with a wrong stamp", "scene: refused texts", "lyapunov: refused records"):
        assert re.search(rf"{words}: \d+; sources: .*(/rogue|not known yet)", err), err
    found = bag.read(tmp_path / "run" / "bag")
    assert not any(found.missing.values())
    assert verify(found).holds
    assert int(found.lost["messages with a wrong stamp"]) > 100
    assert found.size < 20e6
    assert "Traceback" not in err


@pytest.mark.slow  # real processes
def test_a_text_that_no_plant_vouches_for_starts_nothing(
    launch: Any, tmp_path: Path, node: tuple[Any, SingleThreadedExecutor]
) -> None:
    peer, _ = node
    publisher = peer.create_publisher(String, SCENE.name, messages.qos(SCENE))
    publisher.publish(String(data="no scene"))
    with (tmp_path / "log").open("w") as log:
        controller = launch(*START, "left_controller", stderr=log)
    wait_for(lambda: "scene: refused texts: 1; sources: /peer" in (tmp_path / "log").read_text(), "the refusal")
    assert controller.poll() is None
