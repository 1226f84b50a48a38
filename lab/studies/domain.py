"""The page of the domain: every bound of `physics.domain`, and every relation of `scene.effects`, in words."""

from __future__ import annotations

from collections.abc import Iterable

from grasp_ros.physics.domain import LARGEST_POSITION, LARGEST_SPEED, RANGES, RULES, SMALLEST
from grasp_ros.scene.effects import EFFECTS


def numbers() -> dict[str, object]:
    """What docs/domain.md needs: the ranges of single numbers, and what several must obey."""
    return {
        "ranges": [[name, f"{own.low:g} to {own.high:g} {own.unit}", own.why] for name, own in RANGES.items()],
        "rules": [[", ".join(f"`{key}`" for key in dict.fromkeys(rule.keys)), rule.text, rule.allowed, rule.why]
                  for rule in RULES],
        "relations": [[", ".join(f"`{section}`" for section in sections), *words] for words, sections in _relations()],
        "smallest": SMALLEST, "largest_position": LARGEST_POSITION, "largest_speed": LARGEST_SPEED,
    }


def _relations() -> Iterable[tuple[tuple[str, str], list[str]]]:
    """What numbers must obey together, and why; and the sections for which it holds."""
    found: dict[tuple[str, str], list[str]] = {}
    for effect in EFFECTS:
        for relation in effect.relations:
            found.setdefault((relation.text, relation.why), []).append(effect.section)
    return found.items()
