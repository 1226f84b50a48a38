"""The page of the nodes: parameters and services as running nodes describe them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from grasp_ros.graph.nodes.controller import Controller
from grasp_ros.graph.nodes.monitor import Monitor
from grasp_ros.graph.nodes.plant import Plant
from lab.studies.pages import table

ROS = ("use_sim_time", "start_type_description_service", "qos_overrides")  # parameters that every node has


def page() -> str:
    """Parameters of all nodes, and the services of the plant."""
    parts = [
        "# Nodes", "Executables `plant`, `left_controller`, `right_controller` and `monitor`. The keys of a scene"
        " are node parameters, too: of the plant or, in the section of a feedback, of that controller; see"
        " [scenes](scenes.md).",
    ]
    with _nodes() as nodes:
        for name, node in nodes.items():
            rows = [(f"`{own}`", str(node.get_parameter(own).value), node.describe_parameter(own).description)
                    for own in node._parameters if "." not in own and not own.startswith(ROS)]
            parts += [f"## {name}", table(("parameter", "default", "meaning"), rows)]
        services = nodes["plant"].get_service_names_and_types_by_node("plant", "/")
        calls = [(f"`{name}`", f"`{kinds[0]}`") for name, kinds in services if kinds == ["std_srvs/srv/Trigger"]]
    return "\n\n".join([
        *parts, "## Services of plant", "[Operate the graph](../how-to/operate-the-graph.md) says what they do.",
        table(("service", "type"), calls)])


@contextmanager
def _nodes() -> Iterator[dict[str, Any]]:
    """All nodes, in a context of their own; the plant also as it is with the wall clock."""
    context = Context()
    rclpy.init(context=context)
    free = [Parameter("free_running", value=True)]
    made: dict[str, Any] = {}
    try:
        made["plant"] = Plant(context=context)
        made["plant, free-running"] = Plant(context=context, parameter_overrides=free, namespace="free")
        made["left_controller"] = Controller("left_controller", context=context)
        made["monitor"] = Monitor(context=context)
        yield made
    finally:
        for node in made.values():
            node.close()
            node.destroy_node()
        context.try_shutdown()
