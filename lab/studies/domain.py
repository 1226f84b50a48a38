"""The page of the domain: every bound of `physics.domain` in words."""

from __future__ import annotations

from grasp_ros.physics.domain import LARGEST_POSITION, LARGEST_SPEED, RANGES, RULES, SMALLEST


def numbers() -> dict[str, object]:
    """What docs/domain.md needs: the ranges of single numbers, and the rules for several."""
    return {
        "ranges": [[name, f"{own.low:g} to {own.high:g} {own.unit}", own.why] for name, own in RANGES.items()],
        "rules": [[", ".join(f"`{key}`" for key in dict.fromkeys(rule.keys)), rule.text, rule.allowed, rule.why]
                  for rule in RULES],
        "smallest": SMALLEST, "largest_position": LARGEST_POSITION, "largest_speed": LARGEST_SPEED,
    }
