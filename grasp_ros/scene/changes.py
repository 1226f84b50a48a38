"""What a scene with other numbers says of itself: its title names them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

FEW = 2  # changes that a title names
CHANGED = re.compile(r" \[(other numbers|\w+(\.\w+)?=[^\]]*)\]$")  # at the end of a title


def texts_of_changed(title: str, watch: str, before: Mapping[str, Any] | None, values: Mapping[str, Any]
                     ) -> tuple[str, str]:
    """Title, which names what is other than before if it is little, and what to watch for, which was said of that.

    How long a scene lasts does not count. None: nothing was before.
    """
    changes = [] if before is None else _differences(before, values)
    if not changes:
        return title, watch
    base = CHANGED.sub("", title)
    words = ", ".join(changes) if len(changes) <= FEW and base == title else "other numbers"
    return f"{base} [{words}]", ""


def _differences(before: Mapping[str, Any], values: Mapping[str, Any]) -> list[str]:
    """What is other than before, as settings would say it."""
    found = [f"{section}={{}}" for section, numbers in values.items() if section not in before and not numbers]
    for section, numbers in values.items():
        for key, value in numbers.items():
            if before.get(section, {}).get(key) != value and (section, key) != ("time", "duration_s"):
                found.append(f"{section}.{key}={'...' if isinstance(value, tuple) else f'{value:g}'}")
    return found
