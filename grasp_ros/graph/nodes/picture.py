"""What RViz and Foxglove draw: a description of the robot, and markers of the masses, springs and contact forces."""

from __future__ import annotations

import time
from collections.abc import Iterable

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA, Header, String
from visualization_msgs.msg import Marker, MarkerArray

from grasp_ros.graph.ros.messages import State, to_time
from grasp_ros.graph.ros.node import GraspNode
from grasp_ros.physics.layout import OBJECT, Of
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import FRAME, MARKERS, ROBOT_DESCRIPTION

FRAME_SECONDS = 1 / 30  # wall time between two pictures
SIZE, ROD = 0.06, 0.008  # m: edge of a mass, width of a spring and of an arrow
ASIDE = {"left": -SIZE, "object": 0.0, "right": SIZE}  # m: faces touch where positions are equal
NEWTONS_PER_METRE = 100.0  # of an arrow
COLORS = {"left": (0.0, 0.45, 0.70), "object": (0.35, 0.35, 0.35), "right": (0.84, 0.37, 0.0)}
TOUCHING = (0.80, 0.47, 0.65)  # a mass in contact


def robot_description(scene: Scene) -> str:
    """URDF with a prismatic joint for each name of `joint_states`: `robot_state_publisher` makes tf of it."""
    reach = 10.0 * max(1.0, float(np.abs(scene.initial_state[0::2]).max()))
    parts = [f'<link name="{FRAME}"/>']
    for body in scene.system.present:
        name, color = NAMES[body], " ".join(str(part) for part in COLORS[NAMES[body]])
        parts.append(
            f'<link name="{name}_mass"><visual><geometry><box size="{SIZE} {SIZE} {SIZE}"/></geometry>'
            f'<material name="{name}"><color rgba="{color} 1"/></material></visual></link>'
            f'<joint name="{name}" type="prismatic"><parent link="{FRAME}"/><child link="{name}_mass"/>'
            f'<origin xyz="{ASIDE[name]} 0 0"/><axis xyz="1 0 0"/>'
            f'<limit lower="{-reach}" upper="{reach}" effort="1e6" velocity="1e6"/></joint>'
        )
    return f'<robot name="grasp">{"".join(parts)}</robot>'


def markers(scene: Scene, time_ns: int, state: Array) -> MarkerArray:
    """Masses as boxes, springs as lines from their rest, contact forces as arrows on the object."""
    system, found = scene.system, []
    forces = {NAMES[side]: system.impact(side, state.tolist()) for side in system.contacts}
    touching = {side for side, force in forces.items() if force > 0.0}
    for body in system.present:
        name, x = NAMES[body], float(state[COLUMN[body]])
        shown = ASIDE[name]
        pressed = name in touching or (body == OBJECT and touching)
        box = _marker(body, "masses", Marker.CUBE, time_ns, TOUCHING if pressed else COLORS[name])
        box.pose.position.x = x + shown
        box.scale.x = box.scale.y = box.scale.z = SIZE
        found.append(box)
        if body != OBJECT and system.bodies[body, Of.STIFFNESS] > 0.0:
            found.append(_line(10 + body, "springs", Marker.LINE_LIST, time_ns, (shown, x + shown), COLORS[name]))
    for number, (side, force) in enumerate(forces.items()):
        sign, x = (1.0 if side == "left" else -1.0), float(state[COLUMN[OBJECT]])
        ends = (x - sign * force / NEWTONS_PER_METRE, x)
        arrow = _line(20 + number, "contact forces", Marker.ARROW, time_ns, ends, TOUCHING)
        arrow.action = Marker.ADD if force > 0.0 else Marker.DELETE
        found.append(arrow)
    return MarkerArray(markers=found)


def _marker(number: int, group: str, kind: int, time_ns: int, color: Iterable[float]) -> Marker:
    red, green, blue = color
    header = Header(stamp=to_time(time_ns), frame_id=FRAME)
    return Marker(header=header, ns=group, id=number, type=kind, color=ColorRGBA(r=red, g=green, b=blue, a=1.0))


def _line(
    number: int, group: str, kind: int, time_ns: int, ends: tuple[float, float], color: Iterable[float]
) -> Marker:
    marker = _marker(number, group, kind, time_ns, color)
    height = SIZE if kind == Marker.ARROW else 0.0
    marker.points = [Point(x=x, y=0.0, z=height) for x in ends]
    marker.scale.x, marker.scale.y, marker.scale.z = ROD, 2.0 * ROD, 3.0 * ROD
    return marker


class Picture:
    """Publishes both where somebody looks, at most thirty times a second."""

    def __init__(self, node: GraspNode, scene: Scene) -> None:
        self._scene, self._next = scene, 0.0
        self._markers = node.publisher(MARKERS)
        self._description = node.publisher(ROBOT_DESCRIPTION)
        self._description.publish(String(data=robot_description(scene)))

    def show(self, state: State) -> None:
        """Draw a state, if it is time and somebody looks."""
        now = time.monotonic()
        if now >= self._next:
            self._next = now + FRAME_SECONDS
            if self._markers.get_subscription_count():
                self._markers.publish(markers(self._scene, state.time_ns, np.array(state.numbers)))
