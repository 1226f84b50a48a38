"""The graph: four real processes, real DDS, real bags."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import WrenchStamped
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from grasp_ros import scene
from grasp_ros.cli.report import compare_recording
from grasp_ros.exact.integrator import ACCURACY
from grasp_ros.graph import bag
from grasp_ros.graph.nodes import messages
from grasp_ros.graph.processes import Graph
from grasp_ros.physics.layout import LEFT, OBJECT
from grasp_ros.physics.model import impact_forces
from grasp_ros.scene.topics import JOINT_STATES, LEFT_COMMAND, LYAPUNOV_NAMES, RIGHT_COMMAND, SCENE, state_of
from grasp_ros.simulation import simulate

DEADLINE = 60.0
START = [sys.executable, "-m", "grasp_ros.graph.nodes.start"]


def wait_for(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.01)


@pytest.fixture
def node() -> Iterator[tuple[Any, SingleThreadedExecutor]]:
    context = rclpy.Context()
    rclpy.init(context=context)
    peer = rclpy.create_node("peer", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(peer)
    yield peer, executor
    executor.shutdown()
    peer.destroy_node()
    context.shutdown()


def content(directory: Path) -> list[tuple[str, int, bytes]]:
    with (directory / "bag" / "bag.mcap").open("rb") as file:
        rows = make_reader(file).iter_messages()
        return [(channel.topic, message.log_time, message.data) for _, channel, message in rows]


def test_graph_bag_and_simulation_are_equal_bit_for_bit(two_runs: tuple[Path, Path]) -> None:
    recording = bag.read(two_runs[0] / "bag")
    simulated = simulate(scene.load("case_01", ["time.duration_s=3"]), sampled=True)
    assert len(recording.tick) == 3001
    assert simulated.state.tobytes() == recording.state.tobytes()
    assert simulated.command.tobytes() == recording.command.tobytes()
    assert simulated.t.tobytes() == recording.t.tobytes()
    assert np.array_equal(recording.effort[1:], recording.command[:-1])
    assert simulated.inputs.tobytes() == recording.inputs.tobytes()
    assert len({*simulated.events}) >= 12  # the run has contacts to be equal in


def test_a_comparison_sees_inputs_that_differ_and_leaves_out_what_the_bag_does_not_know(
    two_runs: tuple[Path, Path]
) -> None:
    recording = bag.read(two_runs[0] / "bag")
    assert compare_recording(recording, ACCURACY).equal
    effort = recording.effort.copy()
    effort[1000, 0] = np.nextafter(effort[1000, 0], np.inf)
    assert not compare_recording(replace(recording, effort=effort), ACCURACY).equal
    cut = {name: getattr(recording, name)[:500] for name in ("tick", "state", "effort", "command", "lyapunov")}
    begin = replace(recording, **cut)
    assert np.isnan(begin.inputs[-1]).all()
    assert begin.inputs[:-1].tobytes() == recording.inputs[:499].tobytes()
    assert compare_recording(begin, ACCURACY).equal
    gap = {name: np.delete(values, 100, axis=0) for name, values in cut.items()}
    assert np.flatnonzero(np.isnan(replace(recording, **gap).inputs[:, 0])).tolist() == [99, 498]
    assert compare_recording(replace(recording, **gap), ACCURACY).equal


def test_two_runs_record_the_same_bytes(two_runs: tuple[Path, Path]) -> None:
    first, second = (content(directory) for directory in two_runs)
    assert first == second
    assert len(first) == 6 * 3001 + 1


def test_bag_holds_every_tick_of_every_topic(two_runs: tuple[Path, Path]) -> None:
    recording = bag.read(two_runs[0] / "bag")
    assert recording.missing == {topic.name: 0 for topic in recording.scene.topics}
    assert recording.scene.values == scene.load("case_01", ["time.duration_s=3"]).values
    assert {"python", "numpy", "grasp_ros", "rclpy"} <= set(recording.versions)


def test_monitor_values_follow_from_the_recorded_states(two_runs: tuple[Path, Path]) -> None:
    recording = bag.read(two_runs[0] / "bag")
    level = recording.energy
    assert np.array_equal(recording.lyapunov[:, :4], np.stack([*level[:3], level.mode.astype(float)], axis=1))
    assert (recording.lyapunov[:, 4] <= 1e-12).all()  # the energy balance closes
    assert recording.lyapunov[:, 4].sum() < -1.0  # what the impacts and dampers have taken
    assert not recording.lyapunov[:, 5].any()
    assert set(recording.lyapunov[:, 3]) == {0.0, 1.0, 2.0, 3.0}
    for side, force in zip(("left", "right"), impact_forces(recording.scene.grasp, recording.state), strict=True):
        assert np.array_equal(recording.outputs[f"contact/{side}"], force)
        assert force.max() > 10.0


def test_an_independent_reader_decodes_the_bag(two_runs: tuple[Path, Path]) -> None:
    with (two_runs[0] / "bag" / "bag.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        rows = [
            (schema.name, channel.metadata["offered_qos_profiles"], message.log_time, decoded)
            for schema, channel, message, decoded in reader.iter_decoded_messages(topics=["/joint_states"])
        ]
    names, qos, times, states = zip(*rows, strict=True)
    assert set(names) == {"sensor_msgs/msg/JointState"}
    assert "reliab" in qos[0]
    assert list(times) == [tick * 1_000_000 for tick in range(3001)]
    assert states[500].name == ["left", "object", "right"]
    stamp = states[500].header.stamp
    assert (stamp.sec, stamp.nanosec) == (0, 500_000_000)
    assert states[500].position[0] == simulate(scene.load("case_01"), sampled=True, grid=np.array([0.5])).state[0, 0]


def test_run_reports_and_draws(two_runs: tuple[Path, Path]) -> None:
    printed = (two_runs[0].parent / "stdout").read_text()
    assert "equal, bit for bit" in printed
    assert "lost                      nothing" in printed
    assert (two_runs[0] / "figure.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["noise", "everything", "hammer", "no_contact", "friction_slide"])
def test_a_scene_with_effects_is_the_same_everywhere(tmp_path: Path, name: str) -> None:
    """Simulation, graph and bag; and nothing is there that the scene does not name."""
    more = ["object_pulse.start_s=0.3", "left_actuator.limit_N=30"] if name == "everything" else []
    settings = ["time.duration_s=1.0", *more]
    graph = Graph(scene.load(name, settings), tmp_path / "run", ACCURACY)
    graph.start()
    try:
        graph.wait([])
    finally:
        statuses = graph.stop()
    assert set(statuses.values()) == {0}
    recording = bag.read(graph.bag)
    comparison = compare_recording(recording, ACCURACY)
    assert comparison.equal
    inputs = simulate(recording.scene, sampled=True).inputs
    assert recording.inputs.tobytes() == inputs.tobytes()
    if more:  # a delay, a limit, and a pulse that all act
        assert inputs[0].tolist() == [0.0, 0.0, 0.0]
        assert (np.nanmax(np.abs(inputs[:, LEFT])), np.nanmax(inputs[:, OBJECT])) == (30.0, 30.0)
    assert not any(recording.missing.values())
    assert not recording.lyapunov[:, 5].any()
    assert {topic for topic, _, _ in content(tmp_path / "run")} == {
        "/scene", *(f"/{topic.name}" for topic in recording.scene.topics)
    }
    assert set(statuses) == {"plant", "monitor", *recording.scene.controllers}


def test_numbers_set_on_a_running_controller_are_recorded_and_replayed(
    tmp_path: Path, node: tuple[Any, SingleThreadedExecutor]
) -> None:
    peer, executor = node
    clients = {name: AsyncParameterClient(peer, name) for name in ("left_controller", "plant")}
    graph = Graph(scene.load("case_01", ["time.duration_s=6"]), tmp_path / "run", ACCURACY)

    def answer(name: str, number: Parameter) -> Any:
        future = clients[name].set_parameters([number])
        deadline = time.monotonic() + DEADLINE
        while not future.done():
            assert time.monotonic() < deadline, f"{name} does not answer"
            executor.spin_once(timeout_sec=0.01)
        return future.result().results[0]

    graph.start()
    try:
        wait_for(clients["left_controller"].services_are_ready, "the controller")
        wait_for(clients["plant"].services_are_ready, "the plant")
        wait_for(lambda: graph.bag.exists(), "the bag")  # the controller has the scene when the monitor has it
        gain = "left_feedback.position_gain_N_per_m"
        wait_for(lambda: answer("left_controller", Parameter(gain, value=9)).successful, "the new gain")
        refused = answer("left_controller", Parameter(gain, value=-100.0))
        assert not refused.successful
        assert "a sum >= 0" in refused.reason
        fixed = answer("plant", Parameter("object.mass_kg", value=4.0))
        assert not fixed.successful
        assert "does not change in a run" in fixed.reason
        graph.wait([])
    finally:
        graph.stop()
    recording = bag.read(graph.bag)
    assert list(recording.changes.values()) == [{gain: 9.0}]
    assert compare_recording(recording, ACCURACY).equal
    tick = next(iter(recording.changes))
    x, v = recording.state[tick, :2]
    assert recording.command[tick, 0] == -9.0 * x - 0.5 * v
    assert not recording.lyapunov[:, 5].any()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("moment", ["recording", "starting"])
def test_interrupted_run_ends_cleanly(tmp_path: Path, number: signal.Signals, moment: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "grasp_ros.cli", "run", "case_01", "-o", str(tmp_path / "run")], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )
    recorded = tmp_path / "run" / "bag" / "bag.mcap"
    if moment == "recording":
        wait_for(lambda: recorded.exists() and recorded.stat().st_size > 2_000_000, "a bag that grows")
    else:
        wait_for(lambda: (tmp_path / "run" / "case_01.yaml").exists(), "the first process")
    process.send_signal(number)
    out, err = process.communicate(timeout=DEADLINE)
    assert process.returncode == 0, err
    assert "Traceback" not in err + out
    if moment == "recording":
        recording = bag.read(recorded.parent)
        ticks = len(recording.tick)
        assert 100 < ticks < 20001
        assert recording.counts == {topic.name: ticks for topic in recording.scene.topics}
        assert np.array_equal(recording.tick, np.arange(ticks))
        full = simulate(scene.load("case_01"), sampled=True)
        assert full.state[:ticks].tobytes() == recording.state.tobytes()
    left_behind = subprocess.run(["pgrep", "-f", str(tmp_path)], capture_output=True, text=True, check=False)
    assert left_behind.stdout == ""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", ["plant", "left_controller", "right_controller", "monitor"])
def test_lonely_node_ends_cleanly_on_a_signal(tmp_path: Path, name: str, number: signal.Signals) -> None:
    process = subprocess.Popen(
        [*START, name], cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "ROS_DOMAIN_ID": "120"},
    )
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=120)
    observer = rclpy.create_node("observer", context=context)
    wait_for(lambda: name in observer.get_node_names(), name)
    process.send_signal(number)
    _, err = process.communicate(timeout=DEADLINE)
    observer.destroy_node()
    context.shutdown()
    assert process.returncode == 0, err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("name", "parameter", "complaint"),
    [
        ("plant", "scene:=case_99", "case_99: no such scene"),
        ("plant", "scene:=missing.yaml", "missing.yaml: no such file"),
        ("plant", "accuracy:=1.0", "accuracy: 1.0 is outside"),
        ("plant", "accuracy:=1", "accuracy: 1.0 is outside"),
        ("plant", "scene:=1", "scene"),
        ("plant", "object.mas_kg:=4.0", "object.mas_kg: no such parameter"),
        ("plant", "tilt.angle_rad:=0.3", "tilt.angle_rad: no such parameter"),
        ("plant", "object.mass_kg:=-4.0", "object.mass_kg"),
        ("monitor", "bag:=.", "bag: '.' exists"),
    ],
)
def test_bad_parameters_are_refused(tmp_path: Path, name: str, parameter: str, complaint: str) -> None:
    command_line = [*START, name, "--ros-args", "-p", parameter]
    result = subprocess.run(command_line, cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE, check=False)
    assert result.returncode == 2
    assert complaint in result.stderr
    assert "Traceback" not in result.stderr


def test_a_second_plant_on_the_same_topics_is_refused() -> None:
    plants = [subprocess.Popen([*START, "plant"], stderr=subprocess.PIPE, text=True) for _ in range(2)]
    wait_for(lambda: any(plant.poll() is not None for plant in plants), "a plant that gives way")
    for plant in plants:
        plant.terminate()
    errors = [plant.communicate(timeout=DEADLINE)[1] for plant in plants]
    statuses = [plant.returncode for plant in plants]
    assert 1 in statuses
    assert "another plant publishes here" in errors[statuses.index(1)]
    assert "Traceback" not in "".join(errors)


def test_run_notices_a_plant_that_was_stopped(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "grasp_ros.cli", "run", "case_01", "-o", str(tmp_path / "run")], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )
    recorded = tmp_path / "run" / "bag" / "bag.mcap"
    wait_for(lambda: recorded.exists() and recorded.stat().st_size > 1_000_000, "a bag that grows")
    subprocess.run(["pkill", "-TERM", "-f", f"start plant .*{tmp_path}"], check=True)
    _, err = process.communicate(timeout=DEADLINE)
    assert process.returncode == 1
    assert "monitor: still runs although its counterpart has ended" in err
    assert bag.read(recorded.parent).counts[JOINT_STATES.name] > 100


WRONG_PLANT = """
import sys
from grasp_ros.graph.nodes import start
from grasp_ros.exact.integrator import Integrator
set_input = Integrator.set_input
Integrator.set_input = lambda self, forces: set_input(self, 1.5 * forces)
sys.exit(start.main("plant"))
"""


def test_the_monitor_stops_a_graph_whose_energy_balance_does_not_close(tmp_path: Path) -> None:
    """A plant that pushes its arms harder than the commands say."""
    options = ["--ros-args", "-p", "wait_for_monitor:=true"]
    recording = [*START, "monitor", "--ros-args", "-p", f"bag:={tmp_path / 'bag'}"]
    monitor = subprocess.Popen(recording, stderr=subprocess.PIPE, text=True)
    others = [
        subprocess.Popen([sys.executable, "-c", WRONG_PLANT, *options], stderr=subprocess.PIPE),
        *(subprocess.Popen([*START, f"{side}_controller", *options], stderr=subprocess.PIPE)
          for side in ("left", "right")),
    ]
    _, err = monitor.communicate(timeout=DEADLINE)
    _, last_words = others[0].communicate(timeout=DEADLINE)
    for controller in others[1:]:
        controller.terminate()
        controller.communicate(timeout=DEADLINE)
    assert (monitor.returncode, others[0].returncode) == (1, 1)
    assert b"the monitor that this run waits for has ended" in last_words
    assert re.search(r"V_c rose by \S+ J more than the work of the held forces, t = \S+ s, mode 0, state \[", err)
    found = bag.read(tmp_path / "bag")
    assert found.alarms == 1
    assert found.lyapunov[-1, LYAPUNOV_NAMES.index("alarm")] == 1.0
    assert not any(found.missing.values())


def test_plant_drops_what_is_stale_repeated_or_not_finite(node: tuple[Any, SingleThreadedExecutor]) -> None:
    """One node plays both controllers and sends garbage between its right answers."""
    peer, executor = node
    settings = ["time.duration_s=0.6"]
    expected = simulate(scene.load("case_01", settings), sampled=True)
    publishers = [
        peer.create_publisher(WrenchStamped, topic.name, messages.qos(topic)) for topic in (LEFT_COMMAND, RIGHT_COMMAND)
    ]
    states: list[np.ndarray] = []
    scenes: list[str] = []

    def answer(message: JointState) -> None:
        states.append(state_of(message)[0])
        now = messages.to_ns(message.header.stamp)
        forces = expected.scene.system.commands(now // 1_000_000, states[-1])
        for publisher in publishers:
            publisher.publish(messages.wrench(now - 1_000_000, 100.0))
            publisher.publish(messages.wrench(now, math.nan))
            publisher.publish(messages.wrench(now, math.inf))
        publishers[0].publish(messages.wrench(now, forces[0]))
        publishers[0].publish(messages.wrench(now, 100.0))
        publishers[1].publish(messages.wrench(now, forces[1]))

    peer.create_subscription(JointState, JOINT_STATES.name, answer, messages.qos(JOINT_STATES))
    peer.create_subscription(String, SCENE.name, lambda message: scenes.append(message.data), messages.qos(SCENE))
    file = Path(os.environ["ROS_LOG_DIR"]) / "short.yaml" if "ROS_LOG_DIR" in os.environ else Path("short.yaml")
    file.write_text(expected.scene.to_yaml())
    plant = subprocess.Popen([*START, "plant", "--ros-args", "-p", f"scene:={file}"])
    deadline = time.monotonic() + DEADLINE
    while plant.poll() is None:
        assert time.monotonic() < deadline, "the plant does not finish"
        executor.spin_once(timeout_sec=0.05)
    file.unlink()
    assert plant.returncode == 0
    assert np.array_equal(states, expected.state)
    assert scene.parse(scenes[0], "scene", "topic").values == expected.scene.values
