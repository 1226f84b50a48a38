"""The law of a controller: that of the scene, or one of the user's own, `module:object`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from grasp_ros.physics.control import ControlLaw, limited, measured
from grasp_ros.physics.errors import Refused

Law = Callable[[int, float, float, float], float]  # tick, time in s, x in m, v in m/s as measured, to a command in N


class OwnLaw:
    """A law of the user's own, between the sensors and the actuator of the scene.

    Parameters
    ----------
    words : str
        "module:object"; the module is looked for in the working directory last. A class is called without arguments
        for every run, and again at a reset; of any other object `reset` is called, where it has one.

    Raises
    ------
    Refused
        If there is no such object, or it cannot be called.
    """

    def __init__(self, words: str) -> None:
        self.words = words
        module, _, name = words.partition(":")
        if not module or not name:
            raise Refused(f"law: {words!r} is not allowed; allowed: module:object")
        if (here := str(Path.cwd())) not in sys.path:
            sys.path.append(here)
        try:
            found: Any = import_module(module)
            for part in name.split("."):
                found = getattr(found, part)
        except (ImportError, AttributeError, SyntaxError) as error:
            raise Refused(f"law: {words!r}: {error}") from None
        if not callable(found):
            raise Refused(f"law: {words!r} is {type(found).__name__}; allowed: something that can be called")
        self._found = found
        self._law: Law = found
        self.reset()

    def reset(self) -> None:
        """Begin anew, without memory."""
        if isinstance(self._found, type):
            self._law = self._found()
        elif hasattr(self._found, "reset"):
            self._found.reset()

    def command(self, stages: ControlLaw, tick: int, time: float, x: float, v: float) -> float:
        """Command in N that answers the state of a tick, through the stages of the scene."""
        row = stages.row.tolist()
        x, v = measured(row, stages.noise(tick).tolist(), x, v)
        return float(limited(row, float(self._law(tick, time, x, v))))
