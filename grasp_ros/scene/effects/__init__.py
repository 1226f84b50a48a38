"""The effects that a scene can name: one file each, and one line each here.

The order is that of the topics in a bag and that in which effects build the system.
"""

from collections.abc import Mapping
from typing import Any

from grasp_ros.physics.system import System
from grasp_ros.scene.effects import bodies, contact, feedback, force, friction, loop, saturation, sensing, tilt, time

EFFECTS = (
    *time.EFFECTS,
    *bodies.EFFECTS,
    *feedback.EFFECTS,
    *contact.EFFECTS,
    *loop.EFFECTS,
    *sensing.EFFECTS,
    *saturation.EFFECTS,
    *friction.EFFECTS,
    *tilt.EFFECTS,
    *force.EFFECTS,
)
BY_SECTION = {effect.section: effect for effect in EFFECTS}


def build(values: Mapping[str, Mapping[str, Any]]) -> System:
    """What the numbers of a scene describe, as arrays; they need not be in their ranges."""
    system = System()
    for effect in EFFECTS:
        if effect.section in values:
            effect.build(values, system)
    for array in (system.bodies, system.pairs, system.state):
        array.setflags(write=False)
    return system
