"""A node of the tests beside those of the graph."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor


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
