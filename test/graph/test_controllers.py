"""Controllers that are not ours: on topics, as objects, several at a time, and those that stay."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import recordings_of
from processes import DEADLINE, START, wait_for
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

from grasp_ros import scene
from grasp_ros.graph import bag
from grasp_ros.graph.processes import Graph
from grasp_ros.graph.verify import laws_of, verify
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene.topics import LYAPUNOV_NAMES
from grasp_ros.simulation import SampledPlant, simulate
from lab.site.examples import titled

pytestmark = pytest.mark.slow  # real processes

PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "controller.md"
OWN = """
class Limited:
    def __init__(self):
        self.before = 0.0
    def __call__(self, tick, time, x, v):
        self.before = 0.9 * self.before + 0.1 * max(-1.5, min(1.5, -5.0 * x - 0.5 * v))
        return self.before
"""


def test_a_controller_that_we_did_not_write_is_recorded_and_verified(launch: Any, tmp_path: Path) -> None:
    """The one that the page prints on the left, and on the right one with a frame_id that reads like a number."""
    source = titled(PAGE, "my_controller.py")
    assert len(source.splitlines()) == 19
    other = source.replace("left", "right").replace("my_controller", "another").replace(
        "    commands.publish", '    command.header.frame_id = "7" if i else "world"\n    commands.publish')
    run = launch(
        sys.executable, "-m", "grasp_ros.cli", "run", "case_01", "--set", "time.duration_s=0.6", "-o", "run",
        "--without", "left_controller", "--without", "right_controller",
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )
    for text in (source, other):
        launch(sys.executable, "-c", text, stderr=subprocess.DEVNULL)
    out, err = run.communicate(timeout=DEADLINE)
    assert run.returncode == 0, out + err
    recording = bag.read(tmp_path / "run" / "bag")
    x, v = recording.state[:, 0], recording.state[:, 1]
    assert np.array_equal(recording.command[:, LEFT], np.clip(-7.0 * x - 0.7 * v, -2.0, 2.0))
    assert verify(recording).words == "601 states follow from the recorded inputs, bit for bit"
    assert not recording.closed
    named = dict(zip(LYAPUNOV_NAMES, recording.lyapunov.T, strict=True))
    assert np.isnan(named["V"]).all()
    assert np.isfinite(named["V_plant"]).all()
    assert np.abs(np.diff(named["V_plant"]) - named["work"][1:] - named["unexplained"][1:]).max() < 1e-12
    assert all(law.startswith("foreign: ") for law in laws_of(recording).values())
    assert "of the plant alone" in out
    assert "601 states follow" in out
    assert "NOT EQUAL" not in out


FOREIGN = """
import rclpy
from geometry_msgs.msg import WrenchStamped
from own_law import Limited
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node("foreign")
commands = node.create_publisher(WrenchStamped, "left/effort_command", 1000)
law, said = Limited(), {}
def answer(state):
    i, stamp = state.name.index("left"), (state.header.stamp.sec, state.header.stamp.nanosec)
    if stamp not in said:  # otherwise it comes again
        said[stamp] = law(0, 0.0, state.position[i], state.velocity[i])
    command = WrenchStamped(header=state.header)
    command.wrench.force.x = said[stamp]
    commands.publish(command)
while commands.get_subscription_count() < 2:
    rclpy.spin_once(node, timeout_sec=0.01)
node.create_subscription(JointState, "joint_states", answer, 1000)
rclpy.spin(node)
"""


def test_a_law_with_limits_and_memory_gives_the_same_bits_in_four_processes_in_one_and_without_ros(
    launch: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In four processes on the left as a node that we did not write, on the right as an object; both at a time."""
    (tmp_path / "own_law.py").write_text(OWN)
    place, case = "own_law:Limited", scene.load("case_01", ["time.duration_s=0.5"])
    names: dict[str, Any] = {}
    exec(OWN, names)
    simulated = simulate(case, controllers=dict.fromkeys(("left", "right"), names["Limited"]))
    four = Graph(case, tmp_path / "four", ACCURACY, without=["left_controller"], laws={"right_controller": place})
    laws_of_both = dict.fromkeys(case.controllers, place)
    one = Graph(case, tmp_path / "one", ACCURACY, laws=laws_of_both, one_process=True)
    launch(sys.executable, "-c", FOREIGN, cwd=tmp_path, stderr=subprocess.DEVNULL)
    monkeypatch.chdir(tmp_path)
    for recording in recordings_of(four, one, monkeypatch):
        assert recording.state.tobytes() == simulated.state.tobytes()
        assert recording.command.tobytes() == simulated.command.tobytes()
        assert verify(recording).words == "501 states follow from the recorded inputs, bit for bit"
        assert all(law.startswith("foreign: ") for law in laws_of(recording).values())
    plant, states = SampledPlant(case.system, case.period_ns), []
    laws = {LEFT: names["Limited"](), RIGHT: names["Limited"]()}
    for tick in range(len(simulated.t)):
        states.append(plant.state.copy())
        commands = np.zeros(3)
        for body, law in laws.items():
            commands[body] = law(tick, case.time_of(tick), *plant.state[COLUMN[body] :][:2].tolist())
        plant.step(commands)
    assert np.array(states).tobytes() == simulated.state.tobytes()


def call(service: str, node: tuple[Any, SingleThreadedExecutor]) -> Any:
    """Answer of a service of the plant."""
    peer, executor = node
    client = peer.create_client(Trigger, f"plant/{service}")
    assert client.wait_for_service(timeout_sec=DEADLINE)
    future = client.call_async(Trigger.Request())
    executor.spin_until_future_complete(future, timeout_sec=DEADLINE)
    assert future.done(), service
    peer.destroy_client(client)
    return future.result()


def test_a_second_source_of_commands_is_named_and_refused(
    launch: Any, tmp_path: Path, node: tuple[Any, SingleThreadedExecutor]
) -> None:
    options = ["--ros-args", "-p", "scene:=arm_alone", "-p", "paused:=true"]
    plant = launch(*START, "plant", *options, stderr=subprocess.PIPE)
    launch(*START, "left_controller", stderr=subprocess.DEVNULL)
    wait_for(lambda: '"state": "paused"' in call("status", node).message, "the first state")
    launch(*START, "left_controller", "--ros-args", "-r", "__node:=rogue", stderr=subprocess.DEVNULL)
    peer, _ = node
    wait_for(lambda: len(peer.get_publishers_info_by_topic("left/effort_command")) == 2, "the second source")
    assert call("resume", node).success
    errors = plant.communicate(timeout=DEADLINE)[1]
    assert plant.returncode == 1
    assert "left/effort_command: 2 sources, /left_controller and /rogue; allowed in lockstep: one" in errors
    assert "Traceback" not in errors


@pytest.mark.thorough
def test_controllers_that_stay_work_with_the_next_scene_or_say_why_not(launch: Any, tmp_path: Path) -> None:
    with (tmp_path / "right").open("w") as log:
        monitored = ["--ros-args", "-p", "wait_for_monitor:=true"]
        launch(*START, "left_controller", *monitored, stderr=subprocess.DEVNULL)
        launch(*START, "right_controller", *monitored, stderr=log)
    for number, (name, gain) in enumerate((("case_01", 5.0), ("case_09", 50.0), ("arm_alone", None))):
        file = tmp_path / f"{name}.yaml"
        file.write_text(scene.load(name, ["time.duration_s=0.2"]).to_yaml())
        monitor = launch(*START, "monitor", "--ros-args", "-p", f"bag:={tmp_path / f'bag{number}'}",
                         stderr=subprocess.PIPE)
        plant = launch(*START, "plant", "--ros-args", "-p", f"scene:={file}", "-p", "wait_for_monitor:=true",
                       stderr=subprocess.PIPE)
        errors = plant.communicate(timeout=DEADLINE)[1]
        assert plant.returncode == 0, errors
        said = monitor.communicate(timeout=DEADLINE)[1]
        assert f"closed the bag {tmp_path / f'bag{number}'}: 201 ticks" in said
        assert monitor.returncode == 0
        recording = bag.read(tmp_path / f"bag{number}")
        assert recording.scene.name != ""
        assert verify(recording).holds
        assert set(laws_of(recording).values()) == {"the scene's law"}
        if gain:
            assert recording.command[0, LEFT] == -gain * recording.state[0, 0]
    assert "has no right_controller; allowed: left_controller" in (tmp_path / "right").read_text()
