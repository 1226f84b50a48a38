"""Controllers that a command line names: side=module:object."""

from __future__ import annotations

from collections.abc import Sequence

from grasp_ros.physics.control import Law
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.own_law import find_law


def sides_of(words: Sequence[str]) -> dict[str, str]:
    """Where the controllers are found, "module:object" by side."""
    found: dict[str, str] = {}
    for word in words:
        side, _, place = word.partition("=")
        if side not in SIDES or not all(place.partition(":")):
            raise Refused(f"--controller: {word} is not allowed; allowed: side=module:object, with the side"
                          f" {' or '.join(SIDES)}")
        if side in found:
            raise Refused(f"--controller: {word} is not allowed; allowed: one for the {side} side")
        found[side] = place
    return found


def load_controllers(words: Sequence[str]) -> dict[str, Law | type]:
    """The callables by side."""
    return {side: find_law(place, f"--controller: {side}={place}") for side, place in sides_of(words).items()}
