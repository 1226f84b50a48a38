"""What a result was computed with."""

import platform
from importlib import metadata

PACKAGES = ("grasp_ros", "numpy", "numba", "llvmlite", "rclpy", "rosbags")


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that the numbers depend on."""
    return {"python": platform.python_version(), **{name: metadata.version(name) for name in PACKAGES}}
