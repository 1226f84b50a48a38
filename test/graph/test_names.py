"""Two graphs side by side in one domain, and what the package says of itself."""

from __future__ import annotations

import os
import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from graphs import started, whole
from mcap.reader import make_reader
from processes import GRASP, ended

from grasp_ros import scene
from grasp_ros.graph import host
from grasp_ros.graph.bag.verify import laws_of
from grasp_ros.graph.processes import Graph
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation import simulate

ROOT = Path(__file__).parents[2]
PYPI = {"mcap", "rosbags", "zstandard"}  # not known to rosdep
ROSDEP = {"PyYAML": "yaml", "pillow": "pil"}


@pytest.mark.slow  # real processes
def test_two_graphs_in_one_domain_do_not_see_each_other(launch: Any, tmp_path: Path) -> None:
    names, processes = {"/a": "case_01", "/b": "case_09"}, {"/a": [], "/b": ["--one-process"]}
    runs = [
        launch(
            *GRASP, "run", name, "--set", "time.duration_s=0.5", "-o", namespace[1:], "--namespace", namespace,
            "--no-figure", *processes[namespace], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )
        for namespace, name in names.items()
    ]
    for run in runs:
        ended(run)
    for namespace, name in names.items():
        recording = whole(tmp_path / namespace[1:] / "bag")
        simulated = simulate(scene.load(name, ["time.duration_s=0.5"]), sampled=True)
        assert recording.state.tobytes() == simulated.state.tobytes()
        assert set(laws_of(recording).values()) == {"the scene's law"}
        with (recording.path / "bag.mcap").open("rb") as file:
            summary = make_reader(file).get_summary()
        assert summary is not None
        topics = {channel.topic for channel in summary.channels.values()}
        assert {topic for topic in topics if not topic.startswith(f"{namespace}/")} == {"/diagnostics"}
        assert f"{namespace}/clock" in topics


def test_the_package_lists_what_its_nodes_import_and_how_to_cite_it() -> None:
    manifest = ElementTree.parse(ROOT / "package.xml").getroot()
    listed = {entry.text for entry in manifest.findall("exec_depend")}
    sources = "\n".join(path.read_text() for path in (ROOT / "grasp_ros" / "graph").rglob("*.py"))
    imported = set(re.findall(r"^from (\w+_(?:msgs|srvs|interfaces))\.", sources, re.M)) | {"rclpy"}
    assert imported <= listed
    required = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    names = {re.split(r"[^\w-]", need)[0] for need in required if not need.startswith("ros-")} - PYPI
    assert {f"python3-{ROSDEP.get(name, name)}" for name in names} <= listed
    version = (manifest.findtext("version"), manifest.findtext("license"))
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert (cited["version"], cited["license"]) == version
    assert cited["references"][0]["year"] == 1990


@pytest.mark.slow  # real processes
def test_a_second_graph_in_the_place_of_one_that_runs_is_refused_before_it_starts(tmp_path: Path) -> None:
    """Its controllers would answer the states of the first, which ends where its commands have two sources."""
    first = Graph(scene.load("case_01"), tmp_path / "first", ACCURACY)
    with started(first), pytest.raises(Refused, match=r"already runs in ROS domain \d+, .*another ROS_DOMAIN_ID"):
        Graph(scene.load("case_02"), tmp_path / "second", ACCURACY, namespace="").start()
    assert not (tmp_path / "second").exists()
    host.hold(os.environ, "/").close()  # it is free again
