"""Records of measurements as tests make them up."""

from __future__ import annotations

from typing import Any

from grasp_ros.accuracy.measure import Record


def record(method: str, error: float | None, seconds: float | None, **other: Any) -> Record:
    """A sound record, or one with other numbers."""
    values: dict[str, Any] = {
        "scene": "s", "family": "f", "method": method, "knob": "tolerance", "setting": 1e-6, "error": error,
        "seconds": seconds, "least": seconds, "repeats": 3, "first": 1.0, "steps": 10, "right_hand_sides": 60,
        "found": (3, 2), "there_are": (3, 2), "status": "done",
    }
    return Record(**{**values, **other})
