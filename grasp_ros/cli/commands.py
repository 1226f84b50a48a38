"""All commands of `grasp`, with the file of this room that has them: what is not asked for is not imported."""

from __future__ import annotations

from typing import NamedTuple


class Entry(NamedTuple):
    """One command."""

    module: str  # file of this room
    group: str
    text: str


_SCENES, _RUNS, _GRAPH = "scenes", "without ROS", "ROS 2 graph"
COMMANDS: dict[str, Entry] = {
    "scenes": Entry("scenes", _SCENES, "list the scenes that come with the package, or print one"),
    "new": Entry("scenes", _SCENES, "write a commented scene file to start from"),
    "simulate": Entry("simulate", _RUNS, "simulate a scene"),
    "plot": Entry("plot", _RUNS, "draw or animate bags, files of `grasp simulate`, or scenes"),
    "map": Entry("map", _RUNS, "simulate many variants of a scene: a grid over two numbers, or a sample"),
    "design": Entry("design", _RUNS, "choose parameters of a scene that minimise an outcome"),
    "fit": Entry("fit", _RUNS, "estimate parameters of a scene from a bag or a table, with confidence intervals"),
    "accuracy": Entry("accuracy", _RUNS, "error against time of every method on a scene, and the setting to take"),
    "methods": Entry("simulate", _RUNS, "list the integration methods"),
    "run": Entry("graph", _GRAPH, "run a scene in four ROS 2 processes and record a bag"),
    "watch": Entry("graph", _GRAPH, "watch a running graph, or a bag, in the terminal"),
    "ctl": Entry("graph", _GRAPH, "pause, step or reset a graph, set its parameters; or a shell for it"),
    "inspect": Entry("bags", _GRAPH, "print what is in a bag, or write it as a table"),
    "verify": Entry("bags", _GRAPH, "simulate a bag again with its recorded inputs and compare every bit"),
    "replay": Entry("graph", _GRAPH, "publish a bag again, with its clock"),
    "recover": Entry("bags", _GRAPH, "write a new bag from one that was cut off or damaged"),
}


def overview() -> str:
    """All commands by groups, a line each."""
    lines: list[str] = []
    for group in dict.fromkeys(entry.group for entry in COMMANDS.values()):
        lines.append(f"{group}:")
        lines += [f"  {name:<10}{entry.text}" for name, entry in COMMANDS.items() if entry.group == group]
    return "\n".join(lines)
