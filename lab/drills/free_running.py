"""A long run with the wall clock: what it loses, and the quality that the graph itself publishes.

The plant publishes its quality on `timing` once a second, and the monitor records it; here it is read from the bag.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np

from grasp_ros.graph import bag
from grasp_ros.graph.opening import Opened
from grasp_ros.graph.processes import Graph, GraphError
from grasp_ros.graph.rosbag2 import decode
from grasp_ros.graph.verify import verify
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import TIMING

MOST_AGE = 2.0  # periods, at the 99th percentile


def run(scene: Scene, seconds: float, factor: float) -> bool:
    """Print what became of a free run; returns whether no state was lost and commands were young enough.

    Parameters
    ----------
    scene : Scene
    seconds : float
        Of simulated time.
    factor : float
        Simulated seconds in a second.
    """
    scene = scene.changed({"time.duration_s": seconds})
    with tempfile.TemporaryDirectory() as directory:
        plant = {"free_running": "true", "real_time_factor": repr(factor)}
        graph = Graph(scene, Path(directory) / "run", ACCURACY, progress=True, plant=plant)
        graph.start()
        try:
            graph.wait([])
        except GraphError as error:
            print(f"{scene.title}: {error}")
            return False
        finally:
            graph.stop()
        recording, timing = bag.read(graph.bag), timing_of(graph.bag)
        found = verify(recording)
    lost = scene.ticks + 1 - len(recording.tick)
    missing = recording.missing["joint_states"]
    ages = {name: values[-1] for name, values in timing.items() if name.endswith("_age_p99_all")}
    print(f"{scene.title}: {seconds:g} s, {recording.running.words}, period {scene.period_ns / 1e6:g} ms,"
          f" {os.cpu_count()} processors")
    print(f"states lost         {lost + missing} of {scene.ticks + 1}; {found.words}")
    for name, values in timing.items():
        print(f"{name:<19} median {np.median(values):.4g}, largest {np.max(values):.4g}, last {values[-1]:.4g}")
    young = all(age < MOST_AGE for age in ages.values())
    words = ", ".join(f"{name.split('_')[0]} {age:g}" for name, age in ages.items())
    print(f"age of commands     {words} periods at the 99th percentile of the run; to be below {MOST_AGE:g}")
    return not lost and not missing and found.holds and young


def timing_of(path: Path) -> dict[str, Array]:
    """What a bag has of `timing`, a row each second, by name."""
    opened = Opened(path)
    rows = [decode(TIMING, stored.cdr) for stored in opened.messages if stored.topic == opened.names[TIMING]]
    return {name: np.array([row.position[place] for row in rows]) for place, name in enumerate(rows[0].name)}
