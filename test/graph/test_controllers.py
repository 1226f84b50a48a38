"""Controllers that are not ours: on topics, as objects, several at a time, and those that stay."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from graphs import call, status, whole
from processes import START, ended, node_command, wait_for
from rclpy.qos import QoSPresetProfiles

from grasp_ros import scene
from grasp_ros.graph import bag
from grasp_ros.graph.bag.verify import laws_of, verify
from grasp_ros.graph.ros.node import GraspNode
from grasp_ros.physics.layout import LEFT
from grasp_ros.scene.topics import LYAPUNOV_NAMES
from lab.site.examples import titled

pytestmark = pytest.mark.slow  # real processes

PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "controller.md"


def test_a_controller_that_we_did_not_write_is_recorded_and_verified(
    launch: Any, grasp_run: Any, tmp_path: Path
) -> None:
    """The one that the page prints on the left; on the right one with a frame_id like a number, and with a torque."""
    source = titled(PAGE, "my_controller.py")
    assert len(source.splitlines()) == 19
    other = source.replace("left", "right").replace("my_controller", "another").replace(
        "    commands.publish", '    command.header.frame_id = "7" if i else "world"\n'
        "    command.wrench.torque.x = 3.0\n    commands.publish")
    without = ("--without", "left_controller", "--without", "right_controller")
    run = grasp_run("case_01", "--set", "time.duration_s=0.6", "--no-figure", *without)
    for text in (source, other):
        launch(sys.executable, "-c", text, stderr=subprocess.DEVNULL)
    out, _ = ended(run)
    recording = bag.read(tmp_path / "run" / "bag")
    x, v = recording.state[:, 0], recording.state[:, 1]
    assert np.array_equal(recording.command[:, LEFT], np.clip(-7.0 * x - 0.7 * v, -2.0, 2.0))
    assert verify(recording).words == "601 states follow from the recorded inputs, bit for bit"
    assert not recording.closed
    named = dict(zip(LYAPUNOV_NAMES, recording.lyapunov.T, strict=True))
    assert np.isnan(named["V"]).all()
    assert np.isfinite(named["V_plant"]).all()
    assert np.abs(np.diff(named["V_plant"]) - named["work"][1:] - named["unexplained"][1:]).max() < 1e-12
    assert all(law.startswith("not the scene's law: ") for law in laws_of(recording).values())
    assert "of the plant alone" in out
    assert "601 states follow" in out
    assert "NOT EQUAL" not in out


def test_a_second_source_of_commands_is_named_and_refused(launch: Any, tmp_path: Path, node: Any) -> None:
    plant = launch(*node_command("plant", scene="arm_alone", paused="true"), stderr=subprocess.PIPE)
    launch(*START, "left_controller", stderr=subprocess.DEVNULL)
    wait_for(lambda: status(node)["state"] == "paused", "the first state")
    launch(*START, "left_controller", "--ros-args", "-r", "__node:=rogue", stderr=subprocess.DEVNULL)
    peer, _ = node
    wait_for(lambda: len(peer.get_publishers_info_by_topic("left/effort_command")) == 2, "the second source")
    assert call("resume", node).success
    _, errors = ended(plant, 1)
    assert "left/effort_command: 2 sources, /left_controller and /rogue; allowed in lockstep: one" in errors


def test_a_controller_with_another_quality_of_service_is_named_while_it_is_waited_for(launch: Any, node: Any) -> None:
    peer, _ = node
    peer.create_publisher(WrenchStamped, "left/effort_command", QoSPresetProfiles.SENSOR_DATA.value)
    launch(*node_command("plant", scene="arm_alone"), stderr=subprocess.DEVNULL)
    words = ("waiting for left/effort_command; not connected: peer, whose left/effort_command is"
             " geometry_msgs/msg/WrenchStamped, best_effort; needed: geometry_msgs/msg/WrenchStamped, reliable")
    wait_for(lambda: status(node)["words"] == words, "the words of the plant")


@pytest.mark.thorough
def test_controllers_that_stay_work_with_the_next_scene_or_say_why_not(launch: Any, tmp_path: Path) -> None:
    with (tmp_path / "right").open("w") as log:
        launch(*node_command("left_controller", wait_for_monitor="true"), stderr=subprocess.DEVNULL)
        launch(*node_command("right_controller", wait_for_monitor="true"), stderr=log)
    for number, (name, gain) in enumerate((("case_01", 5.0), ("case_09", 50.0), ("arm_alone", None))):
        monitor = launch(*node_command("monitor", bag=tmp_path / f"bag{number}"), stderr=subprocess.PIPE)
        words = node_command("plant", scene=name, wait_for_monitor="true", **{"time.duration_s": 0.2})
        plant = launch(*words, stderr=subprocess.PIPE)
        ended(plant)
        assert f"closed the bag {tmp_path / f'bag{number}'}: 201 ticks" in ended(monitor)[1]
        recording = whole(tmp_path / f"bag{number}")
        assert recording.scene.title == scene.load(name).title
        assert set(laws_of(recording).values()) == {"the scene's law"}
        if gain:
            assert recording.command[0, LEFT] == -gain * recording.state[0, 0]
    assert "has no right_controller; allowed: left_controller" in (tmp_path / "right").read_text()


def test_what_was_confirmed_before_a_command_was_sent_is_seen_before_it() -> None:
    """A monitor that takes a command has the law that was announced before it."""
    seen: list[str] = []
    announced, commanded = (SimpleNamespace(there=[], callback=seen.append) for _ in range(2))

    class Looking:
        sent = False

        def waiting(self, topic: SimpleNamespace) -> Iterator[str]:
            yield from topic.there
            topic.there.clear()
            if not self.sent:  # both are, now, one after the other
                announced.there.append("law")
                commanded.there.append("command")
            self.sent = True

    looking = Looking()

    for _ in range(2):
        GraspNode.take_waiting(looking, [announced, commanded])  # type: ignore[arg-type]
        assert seen in ([], ["law"], ["law", "command"])
    assert seen == ["law", "command"]
