"""What a scene may contain: every refusal names the file, the key, the value and what is allowed."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from grasp_ros.physics.domain import outside
from grasp_ros.physics.errors import Refused, allowed
from grasp_ros.physics.system import System
from grasp_ros.scene.effects import BY_SECTION, named
from grasp_ros.scene.effects.base import BODIES, Effect

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


def read_texts(source: str, document: Mapping[Any, Any]) -> tuple[str, tuple[str, ...], str]:
    """Title, readings and what to watch for."""
    title, readings, watch = document["title"], document["readings"], document.get("watch", "")
    for key, value in (("title", title), ("watch", watch)):
        if not is_text(value):
            raise SceneError(f"{source}: {key}: {value!r} is not allowed; allowed: a text without control characters")
    if not isinstance(readings, (list, tuple)) or not all(is_text(reading) for reading in readings):
        raise SceneError(f"{source}: readings: {readings!r} is not allowed; allowed: a list of texts without control"
                         " characters")
    return title, tuple(readings), watch


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


def check_together(source: str, values: Mapping[str, Mapping[str, Any]]) -> None:
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
