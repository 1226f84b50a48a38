"""Graphs that run at the same time."""

from __future__ import annotations

import pytest
from conftest import SECOND_DOMAIN

from grasp_ros.graph import bag
from grasp_ros.graph.processes import Graph
from grasp_ros.graph.recording import Recording


def recordings_of(first: Graph, second: Graph, monkeypatch: pytest.MonkeyPatch) -> list[Recording]:
    """Bags of two graphs, each in a ROS domain of its own."""
    try:
        first.start()
        monkeypatch.setenv("ROS_DOMAIN_ID", SECOND_DOMAIN)
        second.start()
        first.wait([])
        second.wait([])
    finally:
        first.stop()
        second.stop()
    return [bag.read(graph.bag) for graph in (first, second)]
