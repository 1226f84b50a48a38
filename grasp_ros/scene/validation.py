"""What a scene and settings of it may contain: every refusal names the file, the key, the value and what is allowed."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from grasp_ros.physics.domain import outside
from grasp_ros.physics.errors import Refused, allowed
from grasp_ros.physics.system import System
from grasp_ros.scene.effects import BY_SECTION, named
from grasp_ros.scene.effects.base import BODIES, Effect
from grasp_ros.scene.strict_yaml import load

TEXTS = ("title", "readings", "watch")
FEW = 2  # changes that a title names
CHANGED = re.compile(r" \[(other numbers|\w+(\.\w+)?=[^\]]*)\]$")  # at the end of a title
CONTROLS = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\ud800-\udfff]")  # categories Cc, without the line break, and Cs


class SceneError(Refused):
    """A scene that cannot be run as written: names the file, the key, the value and what is allowed."""


def is_text(value: Any) -> bool:
    """Whether a value is a text that a terminal and a file can take: no controls but line breaks."""
    return isinstance(value, str) and not CONTROLS.search(value)


def check_keys(source: str, prefix: str, found: Mapping[Any, Any], known: Sequence[str], needed: Sequence[str]
               ) -> None:
    """Refuse unknown keys and missing ones."""
    for key in found:
        if key not in known:
            meant = allowed(f"{prefix}{key}", [f"{prefix}{own}" for own in known])
            raise SceneError(f"{source}: {prefix}{key}: unknown key with the value {found[key]!r}; {meant}")
    for key in needed:
        if key not in found:
            optional = ", ".join(own for own in known if own not in needed)
            every = f"the keys {', '.join(needed)}" + (f"; optional: {optional}" if optional else "")
            raise SceneError(f"{source}: {prefix}{key}: missing; allowed: {every}")


def read(source: str, document: Mapping[Any, Any], before: Mapping[str, Any] | None
         ) -> tuple[str, tuple[str, ...], str, dict[str, dict[str, Any]]]:
    """Title, readings, what to watch for and the numbers of a scene, perhaps one with the numbers `before`."""
    check_keys(source, "", document, (*TEXTS, *BY_SECTION), ("title", "readings", "time"))
    title, readings, watch = document["title"], document["readings"], document.get("watch", "")
    for key, value in (("title", title), ("watch", watch)):
        if not is_text(value):
            raise SceneError(f"{source}: {key}: {value!r} is not allowed; allowed: a text without control characters")
    if not isinstance(readings, (list, tuple)) or not all(is_text(reading) for reading in readings):
        raise SceneError(f"{source}: readings: {readings!r} is not allowed; allowed: a list of texts without control"
                         " characters")
    values = read_sections(source, document)
    _check_together(source, values)
    title, watch = _texts_of_changed(title, watch, before, values)
    return title, tuple(readings), watch, values


def read_sections(source: str, document: Mapping[Any, Any]) -> dict[str, dict[str, Any]]:
    """Numbers of all sections of a document, each within its range."""
    return {section: _section(source, BY_SECTION[section], found) for section, found in document.items()
            if section in BY_SECTION}


def _section(source: str, effect: Effect, found: Any) -> dict[str, Any]:
    keys = [parameter.key for parameter in effect.parameters]
    needed = [parameter.key for parameter in effect.parameters if not parameter.optional]
    if not isinstance(found, Mapping):
        raise SceneError(
            f"{source}: {effect.section}: {found!r} is not allowed; allowed: a mapping with {', '.join(keys)}"
        )
    check_keys(source, f"{effect.section}.", found, keys, needed)
    own = [(parameter, found[parameter.key]) for parameter in effect.parameters if parameter.key in found]
    for parameter, value in own:
        if not parameter.accepts(value):
            key = f"{effect.section}.{parameter.key}"
            raise SceneError(f"{source}: {key}: {value!r} is not allowed; allowed: {parameter.allowed}")
    return {parameter.key: parameter.read(value) for parameter, value in own}


def _check_together(source: str, values: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse sections that do not go together."""
    if not BODIES.keys() & values.keys():
        raise SceneError(f"{source}: no body; allowed: at least one of {', '.join(BODIES)}")
    effects = named(values)
    for effect in effects:
        for section in effect.needs:
            if section not in values:
                raise SceneError(f"{source}: {effect.section}: needs {section}; allowed: a scene that names both")
    for effect in effects:
        for relation in effect.relations:
            for problem in relation.problems(values):
                raise SceneError(f"{source}: {problem}")


def check_domain(source: str, values: Mapping[str, Mapping[str, Any]], system: System) -> None:
    """Refuse a scene outside the domain, see `physics.domain`."""
    found = outside(system, values["time"]["duration_s"])
    if found is not None:
        rule, name, measured = found
        section, _, key = name.partition(".")
        short = f"{measured:.6g}"
        number = repr(measured) if float(short) in (rule.low, rule.high) else short
        raise SceneError(f"{source}: {name}: {values[section][key]!r} is not allowed: {rule.text} is {number};"
                         f" allowed: {rule.allowed}")


def apply_settings(settings: Sequence[str], document: dict[Any, Any]) -> None:
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


def _texts_of_changed(title: str, watch: str, before: Mapping[str, Any] | None, values: Mapping[str, Any]
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
