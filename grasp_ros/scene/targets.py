"""Numbers of a scene: what each is, and which go straight into one number of the arrays of its system."""

from __future__ import annotations

import os

from grasp_ros.physics.errors import Refused
from grasp_ros.physics.system import Target
from grasp_ros.scene.effects import EFFECTS
from grasp_ros.scene.effects.base import Parameter
from grasp_ros.scene.scene import Scene

TARGETS: dict[str, Target] = {f"{effect.section}.{key}": target for effect in EFFECTS
                            for key, target in effect.targets.items()}


def target_of(scene: Scene, key: str) -> Target | None:
    """The only target where a number of a scene enters; None: a mass has a weight, too, and others have none."""
    return None if "tilt" in scene.values and key.endswith(".mass_kg") else TARGETS.get(key)


def check_scene(scene: object) -> None:
    """Refuse what is no scene."""
    if not isinstance(scene, Scene):
        hint = f"load({scene!r})" if isinstance(scene, (str, os.PathLike)) else "load and compose"
        raise Refused(f"scene: {type(scene).__name__} is not allowed; allowed: a Scene, see {hint}")


def parameter_of(scene: Scene, name: str) -> Parameter:
    """What a number of a scene is, by "section.key"; lists are refused."""
    if (parameter := scene.parameter(name)).several:
        raise Refused(f"{scene.name}: {name}: is a list; allowed: single numbers")
    return parameter
