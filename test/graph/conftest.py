"""A node of the tests beside those of the graph."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor

from grasp_ros.exact.integrator import compile_kernels


@pytest.fixture(scope="session", autouse=True)
def _kernels() -> None:
    """On disk before several processes, each with a deadline, would compile them at the same time."""
    compile_kernels()


@pytest.fixture
def node() -> Iterator[tuple[Any, SingleThreadedExecutor]]:
    context = rclpy.Context()
    rclpy.init(context=context)
    peer = rclpy.create_node("peer", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(peer)
    yield peer, executor
    executor.shutdown()
    peer.destroy_node()
    context.shutdown()
