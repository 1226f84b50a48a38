"""What there is to look at: markers, the description of the robot, layouts, and the view in a terminal."""

from __future__ import annotations

import io
import json
import os
import pty
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from graphs import started
from processes import START, stranger, wait_for
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rich.console import Console
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from grasp_ros import scene
from grasp_ros.graph import bag
from grasp_ros.graph.nodes.picture import TOUCHING, markers
from grasp_ros.graph.processes import Graph
from grasp_ros.graph.ros import messages
from grasp_ros.graph.terminal import SIGNS, Moment, View
from grasp_ros.graph.tools.watch import HINT
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.system import NAMES
from grasp_ros.scene.topics import CONTACTS, FRAME, LYAPUNOV_NAMES, ROBOT_DESCRIPTION
from grasp_ros.simulation import simulate
from lab.drills.nodes import plain_messages

pytestmark = pytest.mark.slow  # real processes
TRACK = 72  # columns
ASIDE, NEWTONS_PER_METRE = {"left": -0.06, "object": 0.0, "right": 0.06}, 100.0  # m; of an arrow
CONFIG = Path(__file__).parents[2] / "config"


def test_markers_show_the_states_and_only_where_somebody_looks(tmp_path: Path, node: Any, launch: Any) -> None:
    """The run waits for a controller until somebody looks."""
    peer, executor = node
    pictures: list[MarkerArray] = []
    texts: list[str] = []
    peer.create_subscription(MarkerArray, "markers", pictures.append, 100)
    peer.create_subscription(
        String, "robot_description", lambda m: texts.append(m.data), messages.qos(ROBOT_DESCRIPTION)
    )
    case = scene.load("case_01", ["time.duration_s=0.6"])
    graph = Graph(case, tmp_path / "run", ACCURACY, without=["left_controller"])
    with started(graph):
        wait_for(lambda: executor.spin_once(timeout_sec=0.05) or bool(texts), "the description of the robot")
        launch(*START, "left_controller")
        while graph.processes["plant"].poll() is None:
            executor.spin_once(timeout_sec=0.05)
        graph.wait([])
    recording = bag.read(graph.bag)
    states = dict(zip((recording.tick * case.period_ns).tolist(), recording.state, strict=True))
    assert len(pictures) > 3
    for picture in pictures:
        time_ns = plain_messages.to_ns(picture.markers[0].header.stamp)
        sent = serialize_message(markers(case, time_ns, states[time_ns]))
        assert picture == deserialize_message(sent, MarkerArray)  # colors as they travel
    joints = ElementTree.fromstring(texts[0]).findall("joint")
    assert {joint.get("name") for joint in joints} == {"left", "object", "right"}
    assert {joint.get("type") for joint in joints} == {"prismatic"}
    assert {joint.find("parent").get("link") for joint in joints} == {FRAME}  # type: ignore[union-attr]


def test_the_markers_show_what_the_drawing_of_the_same_state_shows(recorded: Path) -> None:
    """Places of the masses in a terminal's picture, contacts and forces as the bag has them."""
    recording = bag.read(recorded)
    view, level = View(recording.scene), recording.energy
    impacts = np.column_stack([recording.outputs[topic.name] for topic in CONTACTS.values()])
    ticks = [0, *np.flatnonzero(np.diff(level.mode)), *np.argmax(impacts, axis=0)]
    assert len(set(level.mode[ticks])) == 4
    for tick in ticks:
        state, impact = recording.state[tick], dict(zip(CONTACTS, impacts[tick], strict=True))
        line = view._line(state, TRACK).plain
        picture = markers(recording.scene, 0, state).markers
        boxes = {marker.id: marker for marker in picture if marker.ns == "masses"}
        places = {name: boxes[body].pose.position.x - ASIDE[name] for body, name in NAMES.items()}
        column = {name: (x / view._reach + 1.0) * 0.5 * (TRACK - 1) for name, x in places.items()}
        away = {name: abs(line.index(SIGNS[name]) + 1 - column[name]) for name in places}
        apart = np.diff([column[name] for name in ("left", "object", "right")]).min() > 4.0
        assert max(away.values()) <= 0.5 if apart else away["left"] <= 0.5  # others are moved aside where one hides
        assert re.fullmatch(r" *\[L\] *\(O\) *\[R\] *", line)
        red = {NAMES[body] for body, box in boxes.items() if (box.color.r, box.color.g, box.color.b) == TOUCHING}
        touching = {name for name, force in impact.items() if force > 0.0}
        assert red == (touching | {"object"} if touching else set())
        arrows = [marker for marker in picture if marker.ns == "contact forces" and marker.action == Marker.ADD]
        lengths = [abs(arrow.points[1].x - arrow.points[0].x) for arrow in arrows]
        assert np.allclose([length * NEWTONS_PER_METRE for length in lengths], [f for f in impact.values() if f > 0.0])


LATE = """
from std_msgs.msg import String
from grasp_ros import scene
from grasp_ros.graph.ros import messages
from lab.drills.nodes import plain_messages
from grasp_ros.graph.parameters import Running
from grasp_ros.scene.topics import *
case = scene.load("case_01")
topics = [SCENE, RUN, *case.topics]
out = {topic: node.create_publisher(messages.TYPES[topic.type], topic.name, messages.qos(topic)) for topic in topics}
out[SCENE].publish(String(data=case.to_yaml()))
out[RUN].publish(String(data=Running().to_yaml()))
tick = 0
while True:  # what belongs to a state comes up to 90 ticks behind it, as from a monitor that is busy
    rclpy.spin_once(node, timeout_sec=0.002)
    tick += 1
    for number, topic in enumerate(case.topics):
        k = tick - (0, 3, 3, 1, 1, 90)[number]
        if k < 0:
            continue
        ns, v = k * case.period_ns, 1e-4 * k
        if topic == JOINT_STATES:
            message = JointState(name=["left", "object", "right"], position=[v] * 3, velocity=[v] * 3, effort=[0.0] * 3)
            message.header.stamp = messages.to_time(ns)
        else:
            values = [v, v, *[0.0] * 6, 1.0]
            message = plain_messages.lyapunov(ns, values) if topic == LYAPUNOV else plain_messages.wrench(ns, v)
        out[topic].publish(message)
"""


def test_a_live_picture_is_one_state_and_no_writer_waits_for_it(node: Any, launch: Any) -> None:
    """Every number of the message k is 1e-4 k, and some topics are late."""
    peer, _ = node
    launch(*stranger("late", LATE))
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "90", "LINES": "30", "LC_ALL": "C.UTF-8"}
    launch(*START, "watch", stdout=theirs, stderr=theirs, env=environment)
    shown = ""
    while len(re.findall(r"t = 1\.\d+ s", shown)) < 3:
        shown += os.read(ours, 65536).decode(errors="replace")
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown)
    pictures = [part for part in text.split("Case 1, Fig. 2: standard parameters")[1:-1] if " t = " in part]
    found = next(row for row, picture in enumerate(pictures) if "V_c" in picture)  # discovery takes its time
    assert len(pictures[found:]) > 5
    for picture in pictures[found:]:
        time_s = float(re.findall(r"t = (\S+) s", picture)[0])
        left = re.findall(r"left +(\S+) +(\S+) +(\S+) +(\S+)", picture)[0]
        level = re.findall(r"V_c +(\S+) J", picture)[0]
        assert {round(float(word), 4) for word in (*left, level)} == {round(0.1 * time_s, 4)}
    for topic in ("joint_states", "lyapunov", "left/effort_command", "contact/right"):
        def readers(name: str = topic) -> set[ReliabilityPolicy]:
            found = peer.get_subscriptions_info_by_topic(name)  # also one that has just been killed
            return {one.qos_profile.reliability for one in found if one.node_name == "watch"}

        wait_for(lambda: bool(readers()), "the name of the reader")  # which discovery tells later than the reader
        assert readers() == {ReliabilityPolicy.BEST_EFFORT}


def test_the_picture_of_the_page_is_one_state() -> None:
    """That of the standard case without ROS; what the page adds is the speed."""
    text = (CONFIG.parent / "docs" / "how-to" / "operate-the-graph.md").read_text(encoding="utf-8")
    [page] = re.findall(r"^```\n(╭.*?╯)$", text, re.M | re.S)
    tick = round(1000 * float(re.findall(r"t = (\S+) s", page)[0]))
    [words] = re.findall(r"t = \S+ s +(\d+ ticks/s)", page)
    run = simulate(scene.load("case_01", ["time.duration_s=8"]), sampled=True)
    view, level, impacts = View(run.scene, HINT), run.energy, run.impacts
    for row in (0, tick):
        known = {"V": level.V[row], "V_c": level.V_c[row], "mode": float(level.mode[row]), "closed": 1.0, "alarm": 0.0,
                 "V_plant": 0.0}
        moment = Moment(float(run.t[row]), run.state[row], dict(zip(CONTACTS, run.command[row], strict=True)),
                        dict(zip(CONTACTS, impacts[row], strict=True)), known, words)
        picture = view.draw(moment)
    console = Console(width=80, file=io.StringIO(), color_system=None)
    console.print(picture)
    assert page == console.file.getvalue().strip()  # type: ignore[attr-defined]


def test_layouts_name_topics_and_values_that_are_there() -> None:
    case = scene.load("case_01")
    topics = {f"/{topic.name}": topic for topic in case.topics}
    layout = json.loads((CONFIG / "foxglove.json").read_text())
    plots = [panel for name, panel in layout["configById"].items() if name.startswith("Plot")]
    paths = [path["value"] for panel in plots for path in panel["paths"]]
    assert len(paths) == 10
    for path in paths:
        topic, field, _ = re.match(r"([^.]+)\.(position\[(\d)\]|wrench\.force\.x)$", path).groups()  # type: ignore[union-attr]
        assert ("position" in field) is (topics[topic].type == "sensor_msgs/msg/JointState")
    assert [path["label"] for path in plots[2]["paths"]] == [LYAPUNOV_NAMES[i] for i in (0, 1, 6)]
    curves = [curve.get("name") for curve in ElementTree.parse(CONFIG / "plotjuggler.xml").iter("curve")]
    assert len(curves) == 10
    assert {f"/lyapunov/{name}/position" for name in ("V", "V_c", "V_plant")} <= set(curves)
    assert all(any(str(curve).startswith(f"{topic}/") for topic in topics) for curve in curves)
