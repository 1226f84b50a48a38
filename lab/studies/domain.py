"""The tables of the page of the domain: `python -m lab.studies.domain PAGE` puts them into it."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from grasp_ros.physics.domain import LARGEST_POSITION, LARGEST_SPEED, RANGES, RULES, SMALLEST
from lab.studies.document import put, read, table, write

PART = "the domain"  # marked part of the document


def tables() -> str:
    """The ranges of single numbers, and the rules for several."""
    ranges = [[name, f"{own.low:g} to {own.high:g} {own.unit}", own.why] for name, own in RANGES.items()]
    rules = [[", ".join(f"`{key}`" for key in dict.fromkeys(rule.keys)), rule.text, rule.allowed, rule.why]
             for rule in RULES]
    return "\n\n".join((
        table(("number", "allowed", "why"), ranges),
        f"But for positions and velocities a number is 0 or at least {SMALLEST:g} in size. A run ends with a status"
        f"\nwhere a position reaches {LARGEST_POSITION:g} m or a velocity {LARGEST_SPEED:g} m/s.",
        table(("key", "ratio", "allowed", "why"), rules),
    ))


def main(arguments: Sequence[str]) -> int:
    """Write the tables into the page."""
    page = Path(arguments[0])
    write(page, put(page, read(page), PART, tables()))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
