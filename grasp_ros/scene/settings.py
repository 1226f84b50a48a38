"""Settings: numbers beside those of a file or in their place; and the texts of a scene with other numbers."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from grasp_ros.physics.errors import Refused, allowed
from grasp_ros.scene.effects import BY_SECTION
from grasp_ros.scene.strict_yaml import load
from grasp_ros.scene.validation import SceneError

FEW = 2  # changes that a title names
CHANGED = re.compile(r" \[(other numbers|\w+(\.\w+)?=[^\]]*)\]$")  # at the end of a title


def apply(settings: Sequence[str], document: dict[Any, Any]) -> None:
    """Put settings into the document of a scene, which is changed in place, before it is validated; in any order.

    "section.key=value" gives a number; "section={}" names a section for which the document has no numbers.
    """
    for target, count in Counter(setting.partition("=")[0] for setting in settings).items():
        if count > 1:
            raise SceneError(f"setting {target}: given {count} times; allowed: once")
    known = [f"{name}.{parameter.key}" for name, effect in BY_SECTION.items() for parameter in effect.parameters]
    for setting in sorted(settings, key=lambda one: not one.endswith("={}")):  # before others give the section numbers
        match = re.fullmatch(r"(\w+)(?:\.(\w+)=(.*)|=\{\})", setting)
        if match is None:
            raise SceneError(f"setting {setting}: not understood; allowed: section.key=value, or section={{}}")
        section, key, value = match.groups()
        if key is None and section not in BY_SECTION:
            raise SceneError(f"setting {setting}: no such section; {allowed(section, BY_SECTION)}")
        if key is not None and f"{section}.{key}" not in known:
            raise SceneError(f"setting {setting}: no such key; {allowed(f'{section}.{key}', known)}")
        numbers = document.setdefault(section, {})
        if key is None and numbers:
            raise SceneError(f"setting {setting}: {section} has numbers, which stay; allowed: {section}.key=value")
        if key is not None and isinstance(numbers, dict):  # anything else is refused with the file
            try:
                numbers[key] = load(value)
            except Refused as error:
                raise SceneError(f"setting {setting}: {error}; allowed: a number") from None


def texts_of_changed(title: str, watch: str, before: Mapping[str, Any] | None, values: Mapping[str, Any]
                     ) -> tuple[str, str]:
    """Title, which names the changes if they are few, and what to watch for, which is left out after a change.

    The duration does not count as a change. `before`: the numbers without the changes; None: there are no changes.
    """
    if before is None:
        return title, watch
    changes = [f"{section}={{}}" for section, numbers in values.items() if section not in before and not numbers]
    for section, numbers in values.items():
        for key, value in numbers.items():
            if before.get(section, {}).get(key) != value and (section, key) != ("time", "duration_s"):
                changes.append(f"{section}.{key}={'...' if isinstance(value, tuple) else f'{value:g}'}")
    if not changes:
        return title, watch
    base = CHANGED.sub("", title)
    words = ", ".join(changes) if len(changes) <= FEW and base == title else "other numbers"
    return f"{base} [{words}]", ""
