"""The free numbers of a fit, each as a function of a number y that begins at 0 and changes by about 1."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.identification.measured import CHANNELS, Measured
from grasp_ros.physics.errors import Refused, allowed
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects import BY_SECTION
from grasp_ros.sensitivity.directions import check_key

OFFSET = "offset."  # of a sensor; the name of its channel follows
DECADE = math.log(10.0)


class Number(NamedTuple):
    """One free number.

    Positive ones are searched by their logarithm, y = 1 is a factor of ten; of others it is their size, or their unit.
    """

    key: str
    start: float
    positive: bool
    width: float = 1.0  # of y = 1, where it is not positive; 0: it is fixed
    least: float = -math.inf

    def linear_from(self, value: float) -> Number:
        """The same number as a linear function that begins at a value: near 0 a logarithm has no end.

        That of a positive one has the width of a factor of ten, there or at its start, whichever is larger.
        """
        if not self.positive:
            return self._replace(start=value)
        return self._replace(start=value, positive=False, width=DECADE * max(value, self.start), least=0.0)

    def at(self, y: float | Array) -> float | Array:
        """Its value."""
        with np.errstate(over="ignore"):
            return self.start * np.exp(DECADE * y) if self.positive else self.start + self.width * y

    def slope(self, value: float) -> float:
        """Derivative of its value by y."""
        return DECADE * value if self.positive else self.width

    @property
    def channel(self) -> int | None:
        """Column of the state that it is an offset of."""
        return CHANNELS.index(self.key.removeprefix(OFFSET)) if self.key.startswith(OFFSET) else None


def numbers_of(scene: Scene, keys: Sequence[str], data: Measured) -> tuple[Number, ...]:
    """The free numbers, with the values of the scene as starts.

    Refused: a key that is given twice, is not in the scene, does not enter smoothly, or starts from 0 where only
    positive numbers are allowed.
    """
    twice = [key for i, key in enumerate(keys) if key in keys[:i]]
    if twice:
        raise Refused(f"free: {twice[0]}: given twice")
    found = tuple(_offset(key, data) if key.startswith(OFFSET) else _number(scene, key) for key in keys)
    if all(number.channel is not None for number in found):
        raise Refused(f"free: {', '.join(keys) or 'nothing'}; allowed: at least one parameter of the scene, such as"
                      " left_contact.hertz_N_per_m1_5")
    return found


def acts(scene: Scene, key: str) -> bool:
    """Whether a number or section decides what acts from outside: that of a controller, or of an external force."""
    section, forced = key.partition(".")[0], {force.section for force in scene.system.external}
    return section in forced or (section in BY_SECTION and BY_SECTION[section].node != "plant")


def _offset(key: str, data: Measured) -> Number:
    known = [CHANNELS[i] for i in data.channels]
    if key.removeprefix(OFFSET) not in known:
        raise Refused(f"free: {key}: not measured; {allowed(key, [OFFSET + name for name in known])}")
    return Number(key, 0.0, False)


def _number(scene: Scene, key: str) -> Number:
    parameter, section = check_key(scene, key), key.partition(".")[0]
    value = float(scene.values[section][parameter.key])
    if parameter.low < 0.0:
        return Number(key, value, False, max(abs(value), 1.0))
    if value == 0.0:
        raise Refused(f"free: {key}: the search starts from the scene's value, 0; allowed: a start > 0, as by the"
                      f" setting {key}=VALUE")
    return Number(key, value, True)
