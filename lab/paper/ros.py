"""The eleven cases through the graph: four processes in lockstep over DDS, recorded and compared."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tqdm import tqdm

from grasp_ros.graph import bag
from grasp_ros.graph.processes import Graph
from grasp_ros.graph.verify import compare_recording
from grasp_ros.physics.accuracy import ACCURACY
from lab.paper.cases import Cases

HEADS = ("case", "ticks", "beside the same without ROS", "largest distance of a position from continuous feedback, m")


def through_the_graph(cases: Cases) -> list[tuple[str, ...]]:
    """Run, record and compare each case.

    Raises
    ------
    GraphError
        If a process of a graph fails.
    """
    rows: list[tuple[str, ...]] = []
    for number, scene in tqdm(cases.items(), desc="the cases through the graph", file=sys.stderr):
        with tempfile.TemporaryDirectory() as directory:
            graph = Graph(scene, Path(directory) / "run", ACCURACY)
            try:
                graph.start()
                graph.wait([])
            finally:
                graph.stop()
            recording = bag.read(graph.bag)
            found = compare_recording(recording)
        far = "" if found.offset is None else f"{float(found.offset[0::2].max()):.3g}"
        equal = "equal, bit for bit" if found.equal else "NOT EQUAL"
        rows.append((f"No. {number}", str(len(recording.t)), equal, far))
    return rows
