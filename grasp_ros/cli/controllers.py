"""Controllers that a command line names: side=module:object."""

from __future__ import annotations

import os
import select
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from inspect import isfunction

from grasp_ros.physics.control import Law
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.own_law import begin, find_law

MOST_BYTES = 2**16  # of a refusal
QUIET_SECONDS = 5.0  # of an import that nothing is said of


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


def check_controllers(words: Sequence[str], seconds: float) -> None:
    """Refuse what `load_controllers` refuses, from a process of its own.

    What a user's module opens, or changes, when it is imported belongs to the node that runs it. One that ends its
    process, or takes longer than so many seconds, is left to that node.
    """
    if not words:
        return
    reader, writer = os.pipe()
    if (child := os.fork()) == 0:
        try:
            os.setpgid(0, 0)  # with what the module starts
            nothing = os.open(os.devnull, os.O_RDWR)
            for stream in range(3):
                os.dup2(nothing, stream)
            os.write(writer, _refusal(words).encode())
        finally:
            os._exit(0)
    with suppress(OSError):  # it has done so already
        os.setpgid(child, child)
    os.close(writer)
    try:
        if not (ready := select.select([reader], [], [], QUIET_SECONDS)[0]):
            print(f"grasp: waits for the import of {', '.join(words)}", file=sys.stderr)
            ready = select.select([reader], [], [], seconds - QUIET_SECONDS)[0]
        refusal = os.read(reader, MOST_BYTES).decode() if ready else ""
    finally:
        os.close(reader)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
    if refusal:
        raise Refused(refusal)


def _refusal(words: Sequence[str]) -> str:
    try:
        for side, law in load_controllers(words).items():
            if isfunction(law):  # an object may open, when it begins, what belongs to its node
                begin(law, f"--controller: {side}")
    except Refused as error:
        return str(error)
    return ""
