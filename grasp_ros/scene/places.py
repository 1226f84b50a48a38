"""Numbers of a scene: what each is, and which go straight into one place of the arrays of its system."""

from __future__ import annotations

import os

from grasp_ros.physics.control import Column
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Law, Of, V, X
from grasp_ros.scene.parameter import Parameter
from grasp_ros.scene.scene import Scene

Place = tuple[str, int, int]  # array of a system, row, column
_ARM = {"mass_kg": Of.MASS, "stiffness_N_per_m": Of.STIFFNESS, "damping_Ns_per_m": Of.DAMPING}
_PAIR = {"hertz_N_per_m1_5": Law.HERTZIAN, "dissipation_s_per_m": Law.DISSIPATION}
_GAIN = {"position_gain_N_per_m": Column.POSITION_GAIN, "velocity_gain_Ns_per_m": Column.VELOCITY_GAIN,
         "set_point_m": Column.SET_POINT, "feed_forward_N": Column.FEED_FORWARD}
PLACES: dict[str, Place] = {
    f"{section}.{key}": place
    for side, name in ((LEFT, "left"), (RIGHT, "right"))
    for section, array, columns in (
        (f"{name}_arm", "bodies", _ARM), (f"{name}_contact", "pairs", _PAIR), (f"{name}_feedback", "laws", _GAIN),
    )
    for key, column in columns.items()
    for place in [(array, int(side), column)]
} | {
    f"{section}.{key}": ("state", place, 0)
    for section, x, v in (("left_arm", X.L, V.L), ("object", X.O, V.O), ("right_arm", X.R, V.R))
    for key, place in (("position_m", x), ("velocity_m_per_s", v))
} | {
    "object.mass_kg": ("bodies", int(OBJECT), Of.MASS),
    "object_friction.viscous_Ns_per_m": ("bodies", int(OBJECT), Of.DAMPING),
    "object_friction.coulomb_N": ("coulomb", 0, 0),
}


def place_of(scene: Scene, key: str) -> Place | None:
    """The only place where a number of a scene enters; None: a mass has a weight, too, and others have no place."""
    return None if "tilt" in scene.values and key.endswith(".mass_kg") else PLACES.get(key)


def check_scene(scene: object) -> None:
    """Refuse what is no scene."""
    if not isinstance(scene, Scene):
        hint = f"load({scene!r})" if isinstance(scene, (str, os.PathLike)) else "load and compose"
        raise Refused(f"scene: {type(scene).__name__} is not allowed; allowed: a Scene, see {hint}")


def parameter_of(scene: Scene, name: str) -> Parameter:
    """What a number of a scene is, by "section.key"; lists are refused."""
    check_scene(scene)
    if (parameter := scene.parameter(name)).several:
        raise Refused(f"{scene.name}: {name}: is a list; allowed: single numbers")
    return parameter
