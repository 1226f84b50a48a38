"""Bags: recorded, read, verified, recovered and summarized."""

from typing import TYPE_CHECKING, Any

from grasp_ros.physics.errors import Refused

if TYPE_CHECKING:
    from grasp_ros.graph.bag.reading import read as read
    from grasp_ros.graph.bag.recording import Recording as Recording


class BagError(Refused):
    """A bag that cannot be written or read: names the path and the reason."""


class EmptyBagError(BagError):
    """A bag without a tick."""


def __getattr__(name: str) -> Any:
    """Import what reads on first use, with the simulation that it needs: a monitor only writes."""
    if name not in ("Recording", "read"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from grasp_ros.graph.bag import reading

    return getattr(reading, name)
