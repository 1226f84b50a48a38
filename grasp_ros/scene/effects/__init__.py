"""The effects that a scene can name, from a file each."""

from collections.abc import Collection, Mapping
from importlib import import_module
from typing import Any

from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import Effect

# In the order of the topics in a bag, in which effects build the system, too.
FILES = ("time", "bodies", "feedback", "contact", "loop", "rate", "sensing", "saturation", "friction", "tilt", "force")
EFFECTS: tuple[Effect, ...] = tuple(
    effect for name in FILES for effect in import_module(f"{__name__}.{name}").EFFECTS)
BY_SECTION = {effect.section: effect for effect in EFFECTS}
PAPER = frozenset(  # the sections of the paper's grasp
    ("time", "left_arm", "object", "right_arm", "left_contact", "right_contact", "left_feedback", "right_feedback")
)


def named(sections: Collection[str]) -> list[Effect]:
    """The effects of some sections, in the order of the registry."""
    return [effect for effect in EFFECTS if effect.section in sections]


def build(values: Mapping[str, Mapping[str, Any]]) -> System:
    """What the numbers of a scene describe, as arrays; they need not be in their ranges."""
    system = System()
    for effect in named(values):
        for key, target in effect.targets.items():
            system.put(target, values[effect.section].get(key, 0.0))
        effect.build(values, system)
    for array in (system.bodies, system.pairs, system.state):
        array.setflags(write=False)
    return system
