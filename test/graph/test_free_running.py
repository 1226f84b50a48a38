"""The graph with the wall clock: held commands, timeouts, and the quality that it publishes."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from graphs import status, whole
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from processes import GRASP, children, end_nodes, ended, node_command, ran, wait_for, write_law
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from grasp_ros import scene
from grasp_ros.graph import bag
from grasp_ros.graph.bag.verify import verify
from grasp_ros.graph.health import heartbeat
from grasp_ros.graph.health.peers import PeerNode
from grasp_ros.graph.nodes.controller import Controller
from grasp_ros.graph.nodes.monitor import Monitor
from grasp_ros.graph.nodes.plant import Plant
from grasp_ros.graph.ros import messages
from grasp_ros.graph.serialization import force_message
from grasp_ros.scene.topics import JOINT_STATES, LYAPUNOV, LYAPUNOV_NAMES, WINDOW
from lab.drills.nodes import plain_messages
from lab.site.examples import titled

pytestmark = pytest.mark.slow  # real processes
PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "operate-the-graph.md"
FREE = {"scene": "arm_alone", "free_running": "true"}


@pytest.mark.thorough
def test_a_controller_at_its_own_rate_is_held_recorded_and_verified(
    launch: Any, grasp_run: Any, tmp_path: Path
) -> None:
    """The one that the page prints, beside one of ours."""
    source = titled(PAGE, "own_rate.py")
    begin = time.monotonic()
    words = ("--without", "left_controller", "--free-running", "0.5")
    run = grasp_run("case_01", "--set", "time.duration_s=1.5", *words)
    launch(sys.executable, "-c", source, stderr=subprocess.DEVNULL)
    ended(run)
    assert time.monotonic() - begin > 3.0  # half as fast as the clock
    recording = whole(tmp_path / "run" / "bag")
    assert recording.running.words == "free-running, 0.5 s per second; on timeout: zero after 0.1 s"
    assert recording.tick.tolist() == list(range(1501))
    assert 3 < len(np.unique(recording.effort[:, 0])) < 200  # held over many periods
    assert np.isnan(recording.lyapunov[:, 0]).all()
    assert recording.command[:-1].tobytes() == recording.effort[1:].tobytes()  # what acted: it answers no tick
    with (tmp_path / "run" / "bag" / "bag.mcap").open("rb") as file:
        rows = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics=["/timing"])
        timing = [dict(zip(row.decoded_message.name, row.decoded_message.position, strict=True)) for row in rows]
    assert timing
    assert {"period_s", "jitter_s", "overruns", "right_age_p99", "left_age_max"} <= timing[0].keys()
    assert 0.001 < np.median([row["period_s"] for row in timing]) < 0.01


@pytest.mark.parametrize(("reaction", "status"), [("stop", 1), ("zero", 0)])
def test_a_silent_controller_has_the_declared_reaction(launch: Any, reaction: str, status: int) -> None:
    numbers = {**FREE, "real_time_factor": 50, "left_timeout_s": 0.25, "left_on_timeout": reaction}
    plant = launch(*node_command("plant", **numbers, progress="true"), stderr=subprocess.PIPE)
    _, errors = ended(plant, status)
    assert "%|" not in errors  # no bar of progress where no terminal is
    assert f"left: no command newer than 0.25 s at tick 250; reaction: {reaction}" in errors
    assert ("finished 20000 ticks" in errors) is (reaction == "zero")


def test_who_has_sent_a_first_command_is_not_waited_for(make: Any) -> None:
    plant = make(Plant, scene="case_01", free_running=True, wait_for_controllers=True, wait_for_monitor=False)
    left, right = plant.loop._commands
    plant.loop._on_command(left, force_message(0, 1.0))
    assert [(need.topic, need.due) for need in plant.needs()] == [
        (left.topic, math.inf), (right.topic, plant.published_at)]


@pytest.mark.parametrize("monitored", [True, False])
def test_a_free_run_begins_when_its_monitor_has_heard_all_controllers(
    make: Any, executor: SingleThreadedExecutor, monitored: bool
) -> None:
    """DDS may connect one with the monitor seconds after the plant: the bag would lack its commands."""
    plant = make(Plant, scene="case_01", free_running=True, wait_for_controllers=True, wait_for_monitor=monitored)
    peer, sides = make(PeerNode, "left_controller"), plant.scene.controllers
    plant.published_at = 1.0  # when its first state was published, in s
    for node in (plant, peer):
        executor.add_node(node)
    for heard in ([], [*sides.values()]):
        for topic in heard:
            peer.heartbeats.confirm(topic.name)
        names = {topic.name for topic in heard}
        wait_for(lambda: executor.spin_once(timeout_sec=0.1) or names <= {  # noqa: B023
            name for beat in plant.heartbeats.alive for name in beat.hears}, "the heartbeats")
        for own in plant.loop._commands:
            plant.loop._on_command(own, force_message(0, 1.0))
        waits = monitored and not heard
        assert plant.loop.missing() == ([topic.name for topic in sides.values()] if waits else [])
        assert any(need.due == plant.published_at for need in plant.needs()) is waits  # not for ever


def test_a_reset_waits_for_the_monitor_and_the_wait_is_no_period(make: Any) -> None:
    plant = make(Plant, scene="arm_alone", free_running=True, wait_for_controllers=False, wait_for_monitor=True)
    plant.begun, loop = True, plant.loop

    def go_on(tick: int) -> None:
        wait_for(lambda: loop.advance() or plant.tick >= tick, f"tick {tick}")

    go_on(5)
    tick, loop.reset_due = plant.tick, True
    time.sleep(0.3)
    loop.advance()
    assert (plant.tick, plant.resets) == (tick, 0)
    record = plain_messages.lyapunov(tick * plant.scene.period_ns, [0.0] * len(LYAPUNOV_NAMES))
    plant._on_lyapunov(serialize_message(record))
    assert (plant.tick, plant.resets) == (0, 1)
    go_on(5)
    assert max(loop._timing._intervals) < 0.2


def test_v_is_known_from_the_first_state_of_a_free_run_with_priority_on(grasp_run: Any, tmp_path: Path) -> None:
    """After a reset the laws are announced anew, and nothing acts before. Where there is no priority it says why."""
    run = grasp_run("case_01", "--set", "time.duration_s=200", "--free-running", "1", "--no-check", "--no-figure")
    wait_for(lambda: not ran(*GRASP, "ctl", "reset").returncode, "a reset")
    nodes = children(tmp_path)
    schedulers = {name: os.sched_getscheduler(process) for name, process in nodes.items()}
    assert not ran(*GRASP, "ctl", "pause").returncode
    run.send_signal(signal.SIGINT)
    out, err = ended(run)
    given = "real-time priority is not available here" not in err
    assert schedulers == {name: os.SCHED_RR if given and name != "monitor" else os.SCHED_OTHER for name in nodes}
    assert "refused" not in err  # what was on its way at the reset
    recording = bag.read(tmp_path / "run" / "bag")
    assert len(recording.starts) == 2
    assert recording.lyapunov[0, LYAPUNOV_NAMES.index("closed")] == 1.0
    assert recording.closed
    assert recording.energy.V[recording.starts] == pytest.approx([5.1, 5.1])
    assert re.search(r"certificate +V_c may rise: commands are held", out)


def test_periods_of_more_than_half_a_second_are_not_late(launch: Any) -> None:
    numbers = {**FREE, "real_time_factor": 0.0016, "time.duration_s": 0.004}
    plant = launch(*node_command("plant", **numbers), stderr=subprocess.PIPE)
    begin = time.monotonic()
    assert "finished 4 ticks" in ended(plant)[1]
    assert time.monotonic() - begin > 2.5


THREE_SECONDS = ("arm_alone", "--set", "time.duration_s=3", "--no-figure")


def test_a_slow_controller_answers_the_newest_state_and_what_was_late_is_shown(
    grasp_run: Any, tmp_path: Path, command: Any
) -> None:
    """5 ms for a period of 0.5 ms of wall time: to answer each state would take five times as long as the run.

    The first answer takes a second, which does not count: the clock starts with it. Another one times out.
    """
    late = ["if tick > 1500 and not seen:", "    seen.append(tick)", "    time.sleep(0.25)"]
    write_law(tmp_path, "time.sleep(0.005 if tick else 1.0)", *late)
    limits = ("--max-age", "1", "--min-factor", "2.5")
    run = grasp_run(*THREE_SECONDS, "--free-running", "2", "--controller", "left=mine:law", *limits)
    out, err = ended(run, 1)
    assert "no command newer than 0.1 s" in err
    recording = whole(tmp_path / "run" / "bag")
    usual, most = recording.ages["left"]
    silent = replace(recording, held={"left": recording.held["left"][:5]})
    assert "the bag lacks commands of left that acted, the first at tick" in verify(silent).words
    assert 9.0 <= usual <= most
    assert usual < 1000.0
    assert 100 < recording.timed_out["left"] < 1500
    assert recording.counts["left/effort_command"] < 1500
    assert 0.0 < recording.reached <= 2.05
    assert not re.search("Hz: [^;]*(/diagnostics|timing)", out)  # they go by wall time
    assert f"grasp: --max-age 1: the oldest command was {most:g} periods old" in err
    assert f"grasp: --min-factor 2.5: {recording.reached:.3g} s per second was reached" in err
    words = f"{recording.reached:.3g} s per second, {recording.overruns} overruns, "
    timed_out = f"left for {recording.timed_out['left']} periods, in which its last command was older than"
    for text in (out, command("inspect", "run/bag").stdout):
        assert words in text
        assert f"left at most {most:.0f} periods, 99 % at most {usual:.0f}" in text
        assert re.search(rf"timed out +{timed_out}", text)
    assert re.search(r"wall time +\d+\.\d s: (compilation .*, )?start \d.*, run .*, stop .*, reading .*, check", out)
    assert not (tmp_path / "run" / "figure.png").exists()
    assert command("inspect", "run/bag", "--max-age", "1").returncode == 1
    assert command("inspect", "run/bag", "--max-age", str(most), "--min-factor", "0.01").returncode == 0


def test_a_run_that_is_interrupted_tells_the_ages_of_its_end(grasp_run: Any, tmp_path: Path, command: Any) -> None:
    write_law(tmp_path, "time.sleep(5.0 if tick > 500 else 0.0)")
    run = grasp_run(*THREE_SECONDS, "--free-running", "1", "--controller", "left=mine:law", "--max-age", "90")
    assert any("no command newer than 0.1 s" in line for line in run.stderr)
    run.send_signal(signal.SIGINT)
    _, err = ended(run, 1)
    recording = bag.read(tmp_path / "run" / "bag")
    assert recording.ages["left"][1] >= 100.0
    assert recording.timed_out["left"] > 0
    assert f"--max-age 90: the oldest command was {recording.ages['left'][1]:g} periods old" in err


@pytest.mark.thorough
def test_a_plant_that_is_faster_than_its_monitor_waits_for_it(launch: Any, node: Any) -> None:
    """A monitor that says when it has recorded: what is more than WINDOW ahead of it could be lost."""
    peer, executor = node
    period_ns, ticks = scene.load("arm_alone").period_ns, []

    def note(message: JointState) -> None:
        ticks.append(plain_messages.to_ns(message.header.stamp) // period_ns)

    peer.create_subscription(JointState, JOINT_STATES.name, note, messages.qos(JOINT_STATES))
    recorded = peer.create_publisher(JointState, LYAPUNOV.name, messages.qos(LYAPUNOV))
    monitored = node_command("plant", **FREE, real_time_factor=50, wait_for_monitor="true")
    launch(*monitored, stderr=subprocess.DEVNULL)
    for last, next_one in ((WINDOW, 400), (400 + WINDOW + 1, 900)):
        wait_for(lambda last=last: executor.spin_once(timeout_sec=0.05) or ticks[-1:] == [last], f"tick {last}")
        for _ in range(3):
            assert status(node)["tick"] == last
        recorded.publish(plain_messages.lyapunov(next_one * period_ns, [0.0] * len(LYAPUNOV_NAMES)))
    assert ticks == list(range(len(ticks)))


def test_a_monitor_that_waits_for_a_lost_command_is_not_blocked(
    context: rclpy.Context, make: Any, executor: SingleThreadedExecutor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own watchdog would end it before the bag is closed."""
    ended = list[int]()
    plant = make(Plant, scene="arm_alone", free_running=True, wait_for_monitor=True)
    controller = make(Controller, "left_controller", wait_for_monitor=True)
    given = [Parameter("bag", value=str(tmp_path / "bag")), Parameter("on_silence", value="end")]
    monitor = Monitor(context=context, parameter_overrides=given)
    for node in (plant, controller, monitor):
        executor.add_node(node)
    wait_for(lambda: executor.spin_once(timeout_sec=0.1) or any(monitor._acted), "a command that acted")
    monkeypatch.setattr(heartbeat.os, "_exit", ended.append)
    monkeypatch.setattr(monitor.heartbeats, "frozen", lambda: ["/left_controller"])
    monkeypatch.setattr(monitor, "take_waiting", lambda *_: None)
    for commands in monitor._commands.values():
        commands.clear()
    end_nodes(monitor)
    assert not ended
    assert len(bag.read(tmp_path / "bag").tick)
