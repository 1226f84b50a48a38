"""Pause, resume, step and reset a running graph; its bag verifies; a bag is published again."""

from __future__ import annotations

import json
import random
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import grasp
from processes import DEADLINE, wait_for
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from grasp_ros import scene
from grasp_ros.exact.integrator import ACCURACY
from grasp_ros.graph import bag
from grasp_ros.graph.nodes import messages
from grasp_ros.graph.processes import Graph
from grasp_ros.graph.verify import laws_of, verify
from grasp_ros.scene.topics import JOINT_STATES
from grasp_ros.simulation import simulate

pytestmark = pytest.mark.slow  # real processes
SEED, CALLS = 13, 60


class Steered:
    """The services of a plant, called one after the other."""

    def __init__(self, peer: Any, executor: SingleThreadedExecutor) -> None:
        self._executor = executor
        self._clients = {name: peer.create_client(Trigger, f"plant/{name}")
                         for name in ("pause", "resume", "step", "reset", "status")}
        self._set = peer.create_client(SetParameters, "plant/set_parameters")

    def ready(self) -> bool:
        return all(client.service_is_ready() for client in (*self._clients.values(), self._set))

    def _wait(self, future: Any) -> Any:
        self._executor.spin_until_future_complete(future, timeout_sec=DEADLINE)
        assert future.done()
        return future.result()

    def call(self, name: str) -> Any:
        return self._wait(self._clients[name].call_async(Trigger.Request()))

    def step(self, number: int) -> Any:
        request = SetParameters.Request(parameters=[Parameter("steps", value=number).to_parameter_msg()])
        assert self._wait(self._set.call_async(request)).results[0].successful
        return self.call("step")

    def status(self) -> dict[str, Any]:
        return json.loads(self.call("status").message)

    def until(self, **goal: Any) -> dict[str, Any]:
        deadline = time.monotonic() + DEADLINE
        while not goal.items() <= (now := self.status()).items():
            assert time.monotonic() < deadline, (goal, now)
        return now


@pytest.fixture(scope="module")
def steered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that was steered at random: its directory."""
    import rclpy

    directory = tmp_path_factory.mktemp("steered") / "run"
    context = rclpy.Context()
    rclpy.init(context=context)
    peer = rclpy.create_node("pilot", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(peer)
    graph = Graph(scene.load("case_01", ["time.duration_s=100"]), directory, ACCURACY, plant={"paused": "true"})
    graph.start()
    try:
        pilot = Steered(peer, executor)
        wait_for(pilot.ready, "the services")
        at = pilot.until(state="paused", tick=0)
        steer(pilot, at)
        command = [sys.executable, "-m", "grasp_ros.cli", "ctl", "step", "7"]
        before = pilot.status()
        said = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE, check=False)
        assert (said.returncode, said.stderr) == (0, "")
        assert f"case_01: paused at tick {before['tick'] + 7} of 100000" in said.stdout
        assert pilot.call("resume").success
        refused = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE, check=False)
        assert (refused.returncode, refused.stdout) == (1, "")
        assert "not paused; allowed: step of a paused plant" in refused.stderr
    finally:
        graph.stop()
        executor.shutdown()
        peer.destroy_node()
        context.shutdown()
    return directory


def steer(pilot: Steered, at: dict[str, Any]) -> None:
    """Random calls; every one has exactly the effect that it promises. Ends paused."""
    draw = random.Random(SEED)
    for _ in range(CALLS):
        action = draw.choice(("pause", "resume", "step", "step", "step", "reset"))
        paused = at["state"] == "paused"
        if action == "step":
            number = draw.randint(1, 40)
            answer = pilot.step(number)
            assert answer.success is paused
            at = pilot.until(state="paused", tick=at["tick"] + number) if paused else pilot.status()
        elif action == "reset":
            assert pilot.call("reset").success
            at = pilot.until(resets=at["resets"] + 1, **({"tick": 0} if paused else {}))
            assert at["state"] == ("paused" if paused else "running")
        else:
            assert pilot.call(action).success is (paused is (action == "resume"))
            at = pilot.status()
            assert at["state"] == ("paused" if action == "pause" else "running")
        if paused and at["state"] == "paused":
            assert pilot.status() == at  # it stands
    if at["state"] != "paused":
        assert pilot.call("pause").success
    pilot.until(state="paused")


def test_random_steering_leaves_a_bag_that_verifies(steered: Path) -> None:
    recording = bag.read(steered / "bag")
    found = verify(recording)
    assert found.holds, found.words
    assert found.ticks == len(recording.tick)
    assert len(recording.starts) > 5
    assert set(laws_of(recording).values()) == {"the scene's law"}
    assert recording.closed
    simulated = simulate(recording.scene.changed({"time.duration_s": 1.0}), sampled=True)
    for begin, end in zip(recording.starts, [*recording.starts[1:], len(recording.tick)], strict=True):
        length = min(end - begin, 1001)
        assert recording.state[begin : begin + length].tobytes() == simulated.state[:length].tobytes()


def test_one_flipped_bit_in_a_bag_is_found_and_named(steered: Path, tmp_path: Path) -> None:
    """In the payload of a message of a copy; its checksum, which the reader would see first, is put right."""
    recording = bag.read(steered / "bag")
    row = int(recording.starts[1]) - 2
    state = recording.state.copy()
    flipped = state[row].view(np.int64)
    flipped[4] ^= 1
    found = verify(type(recording)(**{**vars(recording), "state": state})).difference
    assert found is not None
    assert (found.tick, found.topic, found.name) == (recording.tick[row], "joint_states", "right position")
    assert found.recorded.hex() in str(found)
    assert found.recorded != found.computed


def test_a_bag_is_published_again_with_its_clock(
    two_runs: tuple[Path, Path], node: tuple[Any, SingleThreadedExecutor], launch: Any
) -> None:
    peer, slow = node
    slow.remove_node(peer)
    executor = EventsExecutor(context=peer.context)  # whoever is slower than the player loses messages
    executor.add_node(peer)
    seen: dict[str, list[int]] = {"states": [], "clock": []}
    for kind, name, rows in ((JointState, "joint_states", seen["states"]), (Clock, "/clock", seen["clock"])):
        note = partial(lambda rows, cdr: rows.append(messages.raw_stamp_ns(cdr)), rows)
        peer.create_subscription(kind, name, note, messages.qos(JOINT_STATES), raw=True)
    player = launch(sys.executable, "-m", "grasp_ros.cli", "replay", str(two_runs[0] / "bag"), "--rate", "3")
    begin = time.monotonic()
    while player.poll() is None:
        assert time.monotonic() < begin + DEADLINE
        executor.spin_once(timeout_sec=0.05)
    assert time.monotonic() - begin > 1.0
    assert player.returncode == 0
    last = time.monotonic()
    while time.monotonic() < last + 0.5:  # what is still on its way
        executor.spin_once(timeout_sec=0.05)
    executor.shutdown()
    for rows in seen.values():  # a reader on a busy machine may lose some, the last too, but not their order
        assert rows == sorted(rows)
        assert len(rows) > 100
        assert 2_000_000_000 < rows[-1] <= 3_000_000_000
        assert {stamp % 1_000_000 for stamp in rows} == {0}


def test_without_a_plant_ctl_says_so(tmp_path: Path) -> None:
    found = grasp("ctl", "status", "--namespace", "/nobody", cwd=tmp_path)
    assert (found.returncode, found.stdout) == (1, "")
    assert "no plant answers here" in found.stderr
