"""Nodes that only the laboratory starts: the baseline without physics, an injector of faults."""

from __future__ import annotations

import sys
from pathlib import Path

NAME = "fault_injector"


def command(name: str) -> list[str]:
    """What starts a node of this room, from any directory."""
    return [sys.executable, "-P", str(Path(__file__).with_name(f"{name}.py"))]
