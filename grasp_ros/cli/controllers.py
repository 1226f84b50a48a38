"""Controllers that a command line names: side=module:object."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from functools import reduce
from typing import Any

from grasp_ros.exact.foreign import Law
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.effects.base import SIDES

FORM = "side=module:object"


def load_controllers(words: Sequence[str]) -> dict[str, Law]:
    """The callables by side; modules are found in the current directory, too.

    Raises
    ------
    Refused
        If a word has another form, comes twice for a side, or names what is not there or cannot be called.
    """
    found: dict[str, Law] = {}
    for word in words:
        side, _, place = word.partition("=")
        module, _, name = place.partition(":")
        if side not in SIDES or not module or not name:
            raise Refused(f"--controller: {word} is not allowed; allowed: {FORM}, with the side {' or '.join(SIDES)}")
        if side in found:
            raise Refused(f"--controller: {word} is not allowed; allowed: one for the {side} side")
        found[side] = _load(word, module, name)
    return found


def _load(word: str, module: str, name: str) -> Law:
    if "" not in sys.path:
        sys.path.insert(0, "")
    try:
        holder: Any = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module}.".startswith(f"{error.name}."):
            raise  # it is the module that misses another one
        raise Refused(f"--controller: {word}: no module {error.name}; allowed: one of the current directory, or one"
                      " that is installed") from None
    try:
        law: Any = reduce(getattr, name.split("."), holder)
    except AttributeError:
        raise Refused(f"--controller: {word}: {module} has no {name}; allowed: a callable of it") from None
    if not callable(law):
        raise Refused(f"--controller: {word}: {law!r} cannot be called; allowed: a callable of tick, time, x and v")
    found: Law = law
    return found
