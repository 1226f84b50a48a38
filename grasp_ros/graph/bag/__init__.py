"""Bags: written, read, verified, recovered, and told in a few numbers."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from grasp_ros.graph.bag.reading import BagError as BagError
    from grasp_ros.graph.bag.reading import Recording as Recording
    from grasp_ros.graph.bag.reading import read as read


def __getattr__(name: str) -> Any:
    """What reads, with the simulation that it needs, when it is first used: a monitor only writes."""
    if name not in ("BagError", "Recording", "read"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from grasp_ros.graph.bag import reading

    return getattr(reading, name)
