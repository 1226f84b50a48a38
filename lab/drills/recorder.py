"""What the recorder survives: recordings that are killed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros.graph import bag
from grasp_ros.graph.bag.reading import recover
from grasp_ros.graph.bag.recorder import FLUSH_SECONDS, Recorder
from grasp_ros.graph.serialization import force_message, list_message
from grasp_ros.physics.energy import energy, energy_balance
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import CHANGES, COMMANDS, JOINT_STATES, LYAPUNOV, LYAPUNOV_NAMES, Topic
from grasp_ros.simulation import Trajectory, simulate

LONGEST_SECONDS = 1.0  # after which a recording is killed at the latest
PROMISED_SECONDS = 0.2  # of wall time that a kill may cost
Tick = tuple[int, list[tuple[Topic, bytes]]]


def ticks_of(run: Trajectory) -> Iterator[Tick]:
    """What a monitor would record of a sampled run: time in ns, and messages, its own last."""
    scene, level, alone = run.scene, run.energy, energy(run.scene.system, run.state, feedback=False).V_c
    balance = energy_balance(scene.system, run.state[:-1], run.state[1:], run.inputs[:-1])
    residual, alarm, work = (np.append(0.0, part) for part in (balance.residual, balance.alarm, balance.work))
    bodies = [body for body in (LEFT, OBJECT, RIGHT) if body not in scene.system.absent]
    held = run.inputs - scene.system.external_over(np.arange(len(run.t)))
    effort = np.vstack([np.zeros(3), held[:-1]])
    for tick, state in enumerate(run.state):
        time_ns = tick * scene.period_ns
        forces = {topic: run.command[tick, side] for side, topic in zip(
            scene.system.laws, scene.controllers.values(), strict=True)}
        forces |= {output.topic: output.value(scene.system, tick, state) for output in scene.outputs}
        column = np.array([COLUMN[body] for body in bodies])
        states = list_message(
            time_ns, [NAMES[body] for body in bodies],
            *(numbers.tolist() for numbers in (state[column], state[column + 1], effort[tick, bodies])),
        )
        columns = level.V, level.V_c, level.V_rate, level.mode, residual, alarm, alone, work
        own = [*(float(column[tick]) for column in columns), 1.0]
        rest = [(topic, force_message(time_ns, force)) for topic, force in forces.items()]
        lyapunov = list_message(time_ns, LYAPUNOV_NAMES, own)
        laws = {} if tick else {side: scene.numbers_of(f"{side}_controller") for side, command in COMMANDS.items()
                                if command in scene.topics}
        beside = [(CHANGES[side], list_message(0, [*numbers], [*numbers.values()], frame="1"))
                  for side, numbers in laws.items()]
        yield time_ns, [*beside, (JOINT_STATES, states), *rest, (LYAPUNOV, lyapunov)]


def write(path: Path, run: Trajectory) -> None:
    """Record a sampled run without a graph."""
    recorder = Recorder(path, run.scene, {})
    for tick in ticks_of(run):
        recorder.write_tick(*tick)
    recorder.close()


class Kill(NamedTuple):
    """A recording that was killed."""

    read: int  # ticks that are in the bag
    recovered: int  # ticks in the bag that `recover` made of it
    lost: float  # s of wall time before the kill from which nothing is there

    @property
    def survived(self) -> bool:
        """Whether the bag opened and no more is lost than promised."""
        return self.read == self.recovered and self.lost <= PROMISED_SECONDS


def kill(scene: Scene, ticks: list[Tick], after: float) -> Kill:
    """Record ticks in a process of its own, and kill it some seconds after the bag was opened."""
    with tempfile.TemporaryDirectory() as directory:
        path, noted = Path(directory) / "bag", Path(directory) / "times"
        times: Array = np.lib.format.open_memmap(noted, "w+", float, (len(ticks),))
        child = multiprocessing.get_context("fork").Process(target=_record, args=(path, scene, ticks, times))
        child.start()
        while not times[0] and child.is_alive():
            time.sleep(1e-3)
        time.sleep(after)
        os.kill(child.pid or 0, signal.SIGKILL)
        end = time.monotonic()
        child.join()
        done = np.array(times[times > 0.0])
        read = _count(path)
        lost = 0.0 if read >= len(done) else end - float(done[read])
        new = Path(directory) / "new"
        saved = recover(path, new).ticks if read else 0
        return Kill(read, saved, lost)


def _count(path: Path) -> int:
    """Ticks in a bag; 0 if it was killed before the first was on the disk."""
    try:
        return len(bag.read(path).tick)
    except bag.BagError as error:
        if "holds no tick" in str(error):
            return 0
        raise


def _record(path: Path, scene: Scene, ticks: list[Tick], times: Array) -> None:
    """The process that is killed: a tick each millisecond, and when it had been written."""
    recorder = Recorder(path, scene, {})
    begin = time.monotonic()
    for number, tick in enumerate(ticks):
        recorder.write_tick(*tick)
        times[number] = time.monotonic()
        time.sleep(max(0.0, begin + 1e-3 * number - time.monotonic()))
    time.sleep(2.0 * LONGEST_SECONDS)


def run(scene: Scene, kills: int, seed: int) -> bool:
    """Print how many kills were survived; returns whether all were."""
    print(f"{scene.title}: {scene.ticks + 1} ticks")
    rng, ticks = np.random.default_rng(seed), list(ticks_of(simulate(scene, sampled=True)))
    ends = [kill(scene, ticks, rng.uniform(0.0, LONGEST_SECONDS)) for _ in tqdm(range(kills), unit="kill")]
    survived = sum(end.survived for end in ends)
    worst = max((end.lost for end in ends), default=0.0)
    print(f"killed              {survived} of {kills} bags have all but the last {PROMISED_SECONDS} s")
    print(f"lost at most        {1e3 * worst:.0f} ms; a chunk is handed to the disk every {1e3 * FLUSH_SECONDS:.0f} ms")
    return survived == kills
