"""The page of the domain: every bound of `physics.domain` in words."""

from __future__ import annotations

from pathlib import Path

from grasp_ros.physics.domain import LARGEST_POSITION, LARGEST_SPEED, RANGES, RULES, SMALLEST
from lab.studies import pages


def numbers() -> dict[str, object]:
    """The ranges of single numbers, and the rules for several."""
    return {
        "ranges": [[name, f"{own.low:g} to {own.high:g} {own.unit}", own.why] for name, own in RANGES.items()],
        "rules": [[", ".join(f"`{key}`" for key in dict.fromkeys(rule.keys)), rule.text, rule.allowed, rule.why]
                  for rule in RULES],
        "smallest": SMALLEST, "largest_position": LARGEST_POSITION, "largest_speed": LARGEST_SPEED,
    }


def run(docs: Path | None) -> None:
    """Print the page, or write it into a directory of pages.

    Raises
    ------
    Refused
        If it cannot be written.
    """
    pages.write(docs, "domain", **numbers())
