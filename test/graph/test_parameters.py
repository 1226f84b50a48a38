"""Parameters of the nodes: what may be set, and when it acts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from processes import wait_for
from rcl_interfaces.msg import SetParametersResult
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from grasp_ros.graph.nodes.controller import Controller
from grasp_ros.graph.nodes.plant import Plant

pytestmark = pytest.mark.slow  # real nodes
GAIN = "left_feedback.position_gain_N_per_m"


@pytest.fixture
def loop() -> Iterator[tuple[Plant, Controller, SingleThreadedExecutor]]:
    """A plant and its controller in this process."""
    context = rclpy.Context()
    rclpy.init(context=context)
    plant = Plant(context=context, parameter_overrides=[Parameter("scene", value="arm_alone")])
    controller = Controller("left_controller", context=context)
    executor = SingleThreadedExecutor(context=context)
    for node in (plant, controller):
        executor.add_node(node)
    wait_for(lambda: executor.spin_once(timeout_sec=0.1) or plant.tick > 10, "some ticks")
    yield plant, controller, executor
    executor.shutdown()
    plant.end()
    controller.end()
    context.shutdown()


def test_a_node_takes_what_it_dumps(loop: tuple[Any, ...]) -> None:
    for node in loop[:2]:
        present = list(node.get_parameters(list(node._parameters)))
        assert len(present) > 8
        for parameter in present:
            assert node.set_parameters_atomically([parameter]).successful, parameter.name
        fixed = node.set_parameters_atomically([Parameter("peer_timeout_s", value=3.0)])
        assert not fixed.successful


def test_numbers_that_somebody_else_refuses_never_act(loop: tuple[Any, ...]) -> None:
    plant, controller, executor = loop
    refusing = [True]

    def refuse(_: Any) -> SetParametersResult:
        return SetParametersResult(successful=not refusing[0], reason="not now")

    controller._on_set_parameters_callbacks.append(refuse)  # the door of rclpy lets a later one be asked first
    tick = plant.tick
    assert controller.set_parameters([Parameter(GAIN, value=9.0)])[0].reason == "not now"
    wait_for(lambda: executor.spin_once(timeout_sec=0.1) or plant.tick > tick + 10, "some ticks")
    assert controller._law.position_gain == controller.get_parameter(GAIN).value == 5.0
    refusing.clear()
    refusing.append(False)
    assert controller.set_parameters([Parameter(GAIN, value=9.0)])[0].successful
    wait_for(lambda: executor.spin_once(timeout_sec=0.1) or controller._law.position_gain == 9.0, "the new gain")
