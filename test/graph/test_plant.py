"""What a node refuses, and what the plant drops."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from processes import DEADLINE, START, ended, node_command, wait_for
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from grasp_ros import scene
from grasp_ros.graph import bag
from grasp_ros.graph.nodes.plant import Plant
from grasp_ros.graph.ros import messages
from grasp_ros.graph.serialization import force_message
from grasp_ros.scene.topics import JOINT_STATES, LEFT_COMMAND, RIGHT_COMMAND, SCENE
from grasp_ros.simulation import simulate
from lab.drills.nodes import plain_messages
from lab.reference.grasp import commands

pytestmark = pytest.mark.slow  # real processes


GAIN = "left_feedback.position_gain_N_per_m"
REFUSED = [
    ("plant", "-p scene:=case_99", "case_99: no such scene"),
    ("plant", "-p scene:=missing.yaml", "missing.yaml: no such file"),
    ("plant", "-p accuracy:=1.0", "accuracy: 1.0 is not allowed; allowed: 1e-16 to 0.001"),
    ("plant", "-p accuracy:=1", "accuracy: 1.0 is not allowed; allowed: 1e-16 to 0.001"),
    ("plant", "-p scene:=1", "scene: 1 is not allowed; allowed: a text"),
    ("plant", "-p scene:=''", "'': no such scene; allowed: a path that ends in .yaml, or one of "),
    ("plant", "-p paused:=1", "paused: 1 is not allowed; allowed: true or false"),
    ("plant", "-p object.mas_kg:=4.0", "object.mas_kg: no such parameter"),
    ("plant", "-p tilt.angle_rad:=0.3", "tilt.angle_rad: no such parameter"),
    ("plant", "-p object.mass_kg:=-4.0", "object.mass_kg"),
    ("plant", "-p accuracy:=[1.0,2.0]", "accuracy: [1.0, 2.0] is not allowed; allowed: a number"),
    ("plant", "-p accuracy:=true", "accuracy: True is not allowed; allowed: a number"),
    ("plant", "-p scene:=delay -p loop.delay_ticks:=2.5", "loop.delay_ticks: 2.5 is not allowed; allowed: a whole"),
    ("plant", "-p object.mass_kg:=abc", "object.mass_kg: 'abc' is not allowed; allowed: a number >= 1e-12"),
    ("plant", "-p scene:=table -p left_arm_table.time_s:=3.0", "left_arm_table.time_s: 3.0 is not allowed"),
    ("plant", "-p use_sim_time:=3", "use_sim_time"),
    ("plant", "-p nothing", "ROS does not start: "),
    ("plant", "-p scene:=", "'-p scene:='. Error: nothing behind :=; it was given "),
    ("plant", "-r x:=y name", "ROS does not start: unknown arguments ['name']; it was given --ros-args -r x:=y name"),
    ("plant", "--params-file nothing.yaml", "ROS does not start: "),
    ("plant", "-p start_timeout_s:=-1", "start_timeout_s: -1 is not allowed; allowed: a number > 0, or 0 for any time"),
    ("plant", "-p start_timeout_s:=.nan", "start_timeout_s: nan is not allowed"),
    ("plant", "-p peer_timeout_s:=-1", "peer_timeout_s: -1 is not allowed; allowed: a number > 0, at most"),
    ("plant", "-p steps:=0", "Invalid parameter value (0) for parameter. Reason: Parameter steps out of range. Min: 1"),
    ("plant", "-- case_03", "case_03: not allowed; allowed: --help, or --ros-args -p NAME:=VALUE ..."),
    ("monitor", "-p bagg:=new", "bagg: no such parameter; did you mean bag?"),
    ("left_controller", "-p wait_for_monitr:=true", "wait_for_monitr: no such parameter; did you mean wait_for_moni"),
    ("monitor", "-p bag:=.", "bag: .: already exists; allowed: a new directory"),
    ("monitor", "-p bag:=/dev/null/bag", "bag: /dev/null/bag: cannot be written: Not a directory"),
    ("monitor", "-p bag:=/proc/bag", "bag: /proc/bag: cannot be written: No such file or directory"),
]


ONE_BY_ONE = """
import json, sys
from grasp_ros.graph import __main__ as start, stopping
stopping.GRACE_SECONDS = 1e4  # which count from the end of the first
for name, arguments in json.loads(sys.argv[1]):
    sys.argv[1:] = [name, "--ros-args", *arguments.split()]
    status = start.start()
    print(f"exit status {status}", file=sys.stderr, flush=True)
"""


@pytest.fixture(scope="module")
def refusals(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[int, str]]:
    """Exit status and messages of all refused nodes, one after the other in one process."""
    cwd = tmp_path_factory.mktemp("refused")
    nodes = json.dumps([(name, arguments) for name, arguments, _ in REFUSED])
    found = subprocess.run([sys.executable, "-c", ONE_BY_ONE, nodes], cwd=cwd, stderr=subprocess.PIPE, text=True,
                           timeout=DEADLINE, check=True)
    parts = re.split(r"exit status (\d+)\n", found.stderr)
    return [(int(status), message) for message, status in zip(parts[0:-1:2], parts[1::2], strict=True)]


@pytest.mark.parametrize("row", range(len(REFUSED)), ids=[f"{name} {arguments}" for name, arguments, _ in REFUSED])
def test_bad_parameters_are_refused(refusals: list[tuple[int, str]], row: int) -> None:
    status, message = refusals[row]
    assert status == 2
    assert REFUSED[row][2] in message.splitlines()[-1]
    assert "Traceback" not in message


def test_a_file_of_parameters_for_another_node_is_named(launch: Any, tmp_path: Path) -> None:
    (tmp_path / "file.yaml").write_text("plannt:\n  ros__parameters:\n    scene: case_03\n")
    words = [*START, "plant", "--ros-args", "--params-file", "file.yaml"]
    plant = launch(*words, cwd=tmp_path, stderr=subprocess.PIPE)
    first = plant.stderr.readline()
    plant.terminate()
    plant.communicate(timeout=DEADLINE)
    assert first.endswith("[plant]: no parameter file has values for /plant\n")


def test_one_file_of_parameters_is_for_all_nodes(launch: Any, tmp_path: Path) -> None:
    numbers = {"scene": "arm_alone", "time.duration_s": 0.1, GAIN: 31.0, "bag": "bag", "wait_for_monitor": True}
    (tmp_path / "file.yaml").write_text(json.dumps({"/**": {"ros__parameters": numbers}}))
    nodes = [launch(*START, name, "--ros-args", "--params-file", "file.yaml", cwd=tmp_path, stderr=subprocess.PIPE)
             for name in ("plant", "monitor", "left_controller")]
    errors = [node.communicate(timeout=DEADLINE)[1] for node in nodes[:2]]
    assert [node.returncode for node in nodes] == [0, 0, None], errors  # a controller waits for the next plant
    nodes[2].terminate()
    nodes[2].communicate(timeout=DEADLINE)
    recording = bag.read(tmp_path / "bag")
    assert recording.scene.duration == 0.1
    assert recording.changes == {0: {GAIN: 31.0}}


def test_the_plant_logs_what_its_scene_can_hardly_mean(launch: Any, tmp_path: Path) -> None:
    odd = scene.load("friction_slide", ["time.duration_s=0.1", "loop={}"])
    file = tmp_path / "odd.yaml"
    file.write_text(odd.to_yaml())
    plant = launch(*START, "plant", "--ros-args", "-p", f"scene:={file}", stderr=subprocess.PIPE)
    _, errors = ended(plant)
    assert errors.count(odd.warnings[0]) == 1


def test_a_loop_that_grows_beyond_the_domain_ends_the_plant(launch: Any) -> None:
    slow = {"time.duration_s": 900.0, "time.control_period_s": 0.5}
    gain = {"left_feedback.velocity_gain_Ns_per_m": 50.0}
    launch(*node_command("left_controller", **gain), stderr=subprocess.DEVNULL)
    plant = launch(*node_command("plant", scene="arm_alone", **slow), stderr=subprocess.PIPE)
    _, errors = ended(plant, 1)
    assert "than the domain allows" in errors


def test_a_controller_logs_what_it_is_told_and_can_hardly_mean(launch: Any, tmp_path: Path, node: Any) -> None:
    peer, executor = node
    file = tmp_path / "limited.yaml"
    file.write_text(scene.load("arm_alone", ["time.duration_s=900", "loop={}", "left_actuator.limit_N=9"]).to_yaml())
    launch(*START, "plant", "--ros-args", "-p", f"scene:={file}", stderr=subprocess.DEVNULL)
    with (tmp_path / "log").open("w") as log:
        launch(*START, "left_controller", stderr=log)
    client = AsyncParameterClient(peer, "left_controller")
    wait_for(client.services_are_ready, "the controller")

    def told() -> bool:
        future = client.set_parameters([Parameter("left_actuator.limit_N", value=0)])
        executor.spin_until_future_complete(future, timeout_sec=DEADLINE)
        return bool(future.result().results[0].successful)

    wait_for(told, "the new limit")  # refused as long as the controller does not have the scene
    wait_for(lambda: "left_actuator.limit_N: 0.0 lets no force" in (tmp_path / "log").read_text(), "the warning")


def test_a_second_plant_on_the_same_topics_is_refused(launch: Any) -> None:
    plants = [launch(*START, "plant", stderr=subprocess.PIPE) for _ in range(2)]
    wait_for(lambda: any(plant.poll() is not None for plant in plants), "a plant that gives way")
    for plant in plants:
        plant.terminate()
    errors = [plant.communicate(timeout=DEADLINE)[1] for plant in plants]
    statuses = [plant.returncode for plant in plants]
    assert 1 in statuses
    assert "another plant publishes here" in errors[statuses.index(1)]
    assert "Traceback" not in "".join(errors)


@pytest.mark.parametrize("reliability", [ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT])
def test_a_second_clock_is_named(launch: Any, node: Any, reliability: Any) -> None:
    """Of any quality of service: readers of time take it."""
    node[0].create_publisher(Clock, "/clock", QoSProfile(depth=1, reliability=reliability))
    plant = launch(*node_command("plant", scene="arm_alone"), stderr=subprocess.PIPE)
    words = "; sources seen: /peer and /plant; use_sim_time jumps between their times\n"
    said = any("/clock: second sources: " in line and line.endswith(words) for line in plant.stderr)
    plant.terminate()
    plant.communicate(timeout=DEADLINE)
    assert said


def test_plant_drops_what_is_stale_repeated_or_not_finite(launch: Any, node: Any) -> None:
    """One node plays both controllers and sends garbage between its right answers."""
    peer, executor = node
    expected = simulate(scene.load("case_01", ["time.duration_s=0.6"]), sampled=True)
    publishers = [
        peer.create_publisher(WrenchStamped, topic.name, messages.qos(topic)) for topic in (LEFT_COMMAND, RIGHT_COMMAND)
    ]
    states: list[np.ndarray] = []
    scenes: list[str] = []

    def answer(message: JointState) -> None:
        states.append(np.column_stack([message.position, message.velocity]).ravel())
        now = plain_messages.to_ns(message.header.stamp)
        forces = commands(expected.scene.system, now // 1_000_000, states[-1])
        for publisher in publishers:
            publisher.publish(plain_messages.wrench(now - 1_000_000, 100.0))
            publisher.publish(plain_messages.wrench(now, math.nan))
            publisher.publish(plain_messages.wrench(now, math.inf))
        publishers[0].publish(plain_messages.wrench(now, forces[0]))
        publishers[0].publish(plain_messages.wrench(now, 100.0))
        publishers[1].publish(plain_messages.wrench(now, forces[1]))

    peer.create_subscription(JointState, JOINT_STATES.name, answer, messages.qos(JOINT_STATES))
    peer.create_subscription(String, SCENE.name, lambda message: scenes.append(message.data), messages.qos(SCENE))
    plant = launch(*node_command("plant", scene="case_01", **{"time.duration_s": 0.6}))
    wait_for(lambda: executor.spin_once(timeout_sec=0.05) or plant.poll() is not None, "the end of the plant")
    assert plant.returncode == 0
    assert np.array_equal(states, expected.state)
    assert scene.parse(scenes[0], "scene", "topic").values == expected.scene.values


def test_who_answers_a_state_that_was_published_again_is_not_blamed(
    make: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    """It was published again for somebody else."""
    plant = make(Plant, scene="case_01", wait_for_monitor=False)
    plant.begun, loop, (left, right) = True, plant.loop, plant.loop._commands
    first, second = (force_message(tick * plant.scene.period_ns, 0.0) for tick in (0, 1))
    loop._on_command(left, first)
    loop._repeat(1.0)
    loop._on_command(left, first)
    loop._on_command(right, first)
    loop._on_command(right, first)
    assert plant.tick == plant.counters["repeated commands"] == plant.counters["stale commands"] == 1
    assert "commands" not in capfd.readouterr().err
    for _ in range(2):
        loop._on_command(left, second)
    assert "left/effort_command: repeated commands: 2; sources seen: " in capfd.readouterr().err


def test_who_answers_only_when_asked_again_is_named(make: Any, capfd: pytest.CaptureFixture[str]) -> None:
    """One that answers a state when the next one comes, say: the graph would crawl without a word."""
    plant = make(Plant, scene="case_01", wait_for_monitor=False)
    plant.begun, loop, (left, right) = True, plant.loop, plant.loop._commands
    for tick in range(2):
        assert "late answers" not in capfd.readouterr().err
        plant.published_at = 0.0
        loop._on_command(left, force_message(tick * plant.scene.period_ns, 0.0))
        loop.ask_again(10.0 * (tick + 1))
        loop._on_command(right, force_message(tick * plant.scene.period_ns, 0.0))
    assert (plant.tick, plant.counters["repeated states"], plant.counters["late answers"]) == (2, 2, 1)
    assert "right/effort_command: late answers: 1; sources seen: " in capfd.readouterr().err
