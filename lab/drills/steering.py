"""Random calls to the services of a plant, right ones and wrong ones: each has exactly the effect that it promises.

What each call must do is known before from a model of the plant; afterwards its status is asked for. At the end the bag
must hold exactly the ticks that were promised, and prove itself.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from tqdm import tqdm

from grasp_ros.graph import bag
from grasp_ros.graph.bag.verify import laws_of, verify
from grasp_ros.graph.host import LOCALHOST, RANGE
from grasp_ros.graph.processes import Graph
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate

ACTIONS = ("pause", "resume", "step", "step", "step", "step too far", "step none", "reset", "step and at once")
SERVICES = ("pause", "resume", "step", "reset", "status")
MOST_STEPS = 40  # of a call, and ticks that a running plant is let go on
SETTLE_SECONDS, ANSWER_SECONDS, AGAIN_SECONDS = 30.0, 60.0, 2.0
SECONDS = 1e5  # simulated, so that a running plant does not come to its end


class Wrong(Exception):  # noqa: N818 - a finding
    """A call had another effect than it promises."""


class Plant:
    """A plant that begins paused, and what is known of it: where it stands, and the ticks that its bag must have."""

    def __init__(self, graph: Graph) -> None:
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context)
        self._node = rclpy.create_node("pilot", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._set = self._node.create_client(SetParameters, "plant/set_parameters")
        self._clients = {name: self._node.create_client(Trigger, f"plant/{name}") for name in SERVICES}
        for client in (self._set, *self._clients.values()):
            if not client.wait_for_service(ANSWER_SECONDS):
                raise Wrong(f"{client.srv_name}: nobody offers this service")
        self.ticks = graph.scene.ticks
        self.lengths: list[int] = []  # states of the runs that a reset has ended
        self.paused, self.tick, self.resets = True, 0, 0
        self.settle()

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.shutdown()

    def call(self, service: str, steps: int | None = None) -> tuple[bool, str]:
        """Call a service; returns whether it did something, and its words. `steps` is set before, where it may be."""
        if steps is not None:
            request = SetParameters.Request(parameters=[Parameter("steps", value=steps).to_parameter_msg()])
            [result] = self._answer(self._set, request).results
            if not result.successful:
                return False, str(result.reason)
        answer = self._answer(self._clients[service], Trigger.Request())
        return bool(answer.success), str(answer.message)

    def _answer(self, client: Any, request: Any) -> Any:
        """Of a service; `status` may be asked again, and a plant that answers this newest client knows all of them."""
        deadline = time.monotonic() + ANSWER_SECONDS
        seconds = AGAIN_SECONDS if client is self._clients["status"] else ANSWER_SECONDS
        while time.monotonic() < deadline:
            future = client.call_async(request)
            self._executor.spin_until_future_complete(future, timeout_sec=seconds)
            if future.done():
                return future.result()
        raise Wrong(f"{client.srv_name}: no answer")

    def status(self) -> dict[str, Any]:
        """What the plant says of itself."""
        found: dict[str, Any] = json.loads(self.call("status")[1])
        return found

    def expect(self, service: str, why: str = "", steps: int | None = None) -> dict[str, Any]:
        """Call a service that must succeed, or must not for some reason; returns its answer."""
        done, said = self.call(service, steps)
        found: dict[str, Any] = json.loads(said) if said.startswith("{") else {"why": said}
        if done is bool(why) or why not in found.get("why", ""):
            expected = f"refused, {why!r}" if why else "done"
            asked = service if steps is None else f"{service} {steps}"
            raise Wrong(f"{asked}: {'done' if done else 'refused'}, {said!r}; expected: {expected}")
        return found

    def settle(self) -> None:
        """Wait until it stands where it should, or runs; it must stay there."""
        deadline = time.monotonic() + SETTLE_SECONDS
        goal = {"state": "paused" if self.paused else "running", "resets": self.resets, "resetting": False}
        goal |= {"tick": self.tick, "steps": 0} if self.paused else {}
        while not goal.items() <= (now := self.status()).items():
            over = self.paused and now["resets"] == self.resets and now["tick"] > self.tick
            if over or time.monotonic() > deadline:
                raise Wrong(f"status {now}; expected: {goal}")
        if self.paused and (again := self.status()) != now:
            raise Wrong(f"status {again} although paused; before: {now}")

    def let_go_on(self, ticks: int) -> None:
        """Wait until a running plant has done some ticks."""
        begin, deadline = self.status()["tick"], time.monotonic() + SETTLE_SECONDS
        while (now := self.status())["tick"] < begin + ticks:
            if time.monotonic() > deadline:
                raise Wrong(f"status {now}; expected: it goes on")


def steer(plant: Plant, calls: int, seed: int, quiet: bool = True) -> Counter[str]:
    """Call services at random, and leave the plant paused; returns how often each was called, and refused.

    Raises Wrong at the first call that has another effect than it promises.
    """
    draw, done = random.Random(seed), Counter[str]()
    for _ in tqdm(range(calls), unit="call", disable=quiet):
        action = draw.choice(ACTIONS)
        done[f"{action.split()[0]} {'refused' if _act(plant, action, draw) else 'done'}"] += 1
        plant.settle()
    if not plant.paused:
        _act(plant, "pause", draw)
        plant.settle()
    return done


def _act(plant: Plant, action: str, draw: random.Random) -> bool:
    """One call, with what it must do; returns whether it must be refused."""
    if action in ("pause", "resume"):
        refused = plant.paused is (action == "pause")
        word = "paused" if action == "pause" else "running"
        said = plant.expect(action, f"already {word}" if refused else "")
        plant.paused = action == "pause"
        if plant.paused:
            plant.tick = said["tick"]
        elif not refused:
            plant.let_go_on(draw.randint(1, MOST_STEPS))
    elif action == "reset":
        refused = _reset(plant)
    else:
        refused = _step(plant, action, draw)
    return refused


def _reset(plant: Plant) -> bool:
    """A reset ends a run with the tick that it names; returns whether it must be refused: at the beginning."""
    if not plant.paused:
        plant.let_go_on(1)
    refused = plant.paused and not plant.tick
    said = plant.expect("reset", "already at the beginning" if refused else "")
    if refused:
        return True
    plant.resets += 1
    last = said["last_tick"]
    if said["goal"]["resets"] != plant.resets or (plant.paused and last != plant.tick):
        raise Wrong(f"{said!r}; expected: reset {plant.resets}, tick {plant.tick}")
    plant.lengths.append(last + 1)
    plant.tick = 0
    return False


def _step(plant: Plant, action: str, draw: random.Random) -> bool:
    number = draw.randint(1, MOST_STEPS)
    if action == "step none":
        plant.expect("step", "steps", steps=draw.randint(-3, 0))
        return True
    if not plant.paused:
        plant.expect("step", "not paused; allowed: step of a paused plant", steps=number)
        return True
    left = plant.ticks - plant.tick
    if action == "step too far":
        plant.expect("step", f"allowed: at most {left}", steps=left + number)
        return True
    plant.tick += number
    said = plant.expect("step", steps=number)
    if said["goal"]["tick"] != plant.tick:
        raise Wrong(f"{said!r}; expected: tick {plant.tick}")
    if action == "step and at once":  # what may come before the steps are done, or after them
        success, answer = plant.call("step")
        if success:
            plant.tick += number
        elif "allowed: one at a time" not in answer:
            raise Wrong(f"step while stepping: refused, {answer!r}")
        plant.expect("pause", "already paused")
    return False


@contextmanager
def steered(scene: Scene, directory: Path) -> Iterator[Plant]:
    """A graph of real processes in a new directory, paused at its first state; ends it."""
    graph = Graph(scene, directory, ACCURACY, errors=subprocess.DEVNULL, plant={"paused": True})
    graph.start()
    try:
        with closing(Plant(graph)) as plant:
            yield plant
    finally:
        graph.stop()


def problems(path: Path, lengths: Sequence[int]) -> list[str]:
    """What is wrong with the bag of a run that was steered; nothing, if all is right.

    `lengths` are the ticks that it must have from each beginning of the scene on.
    """
    recording = bag.read(path)
    verification, found = verify(recording), []
    if not verification.holds:
        found.append(verification.words)
    begins = recording.starts.tolist()
    recorded = np.diff([*begins, len(recording.tick)]).tolist()
    if recorded != list(lengths):
        row = next((row for row, pair in enumerate(zip(recorded, lengths, strict=False)) if pair[0] != pair[1]), -1)
        found.append(f"{len(recorded)} runs with {sum(recorded)} states; expected: {len(lengths)} with {sum(lengths)};"
                     f" first difference: run {row}")
    if missing := {name: number for name, number in recording.missing.items() if number}:
        found.append(f"missing: {missing}")
    found += [f"{side} controller: {law}" for side, law in laws_of(recording).items() if law != "the scene's law"]
    longest = max(recorded)
    seconds = (longest - 1) * recording.scene.period_ns / 1e9
    alone = simulate(recording.scene.changed({"time.duration_s": seconds}), sampled=True).state if longest > 1 else None
    for begin, length in zip(begins, recorded, strict=True):
        if alone is not None and recording.state[begin : begin + length].tobytes() != alone[:length].tobytes():
            found.append(f"the run that begins at tick {begin} of the bag differs from the same one without ROS")
    return found


def run(scene: Scene, calls: int, seed: int) -> bool:
    """Steer a graph at random, and print what came of it; returns whether all was as promised."""
    scene = scene.changed({"time.duration_s": SECONDS})
    os.environ.setdefault(RANGE, LOCALHOST)  # before rclpy looks
    with tempfile.TemporaryDirectory() as directory:
        folder = Path(directory) / "run"
        begin = time.monotonic()
        try:
            with steered(scene, folder) as plant:
                done = steer(plant, calls, seed, quiet=False)
        except Wrong as error:
            print(f"{scene.title}, seed {seed}: {error}")
            return False
        seconds, lengths = time.monotonic() - begin, [*plant.lengths, plant.tick + 1]
        found = problems(folder / "bag", lengths)
    print(f"{scene.title}: {calls} random calls, seed {seed}, {seconds:.0f} s: every status as promised")
    print(", ".join(f"{name} {number}" for name, number in sorted(done.items())))
    print(f"bag: {len(lengths)} runs, {sum(lengths)} states: " + (
        "; ".join(found) or "exactly those that were promised, bit for bit those of the same runs without ROS"))
    return not found
