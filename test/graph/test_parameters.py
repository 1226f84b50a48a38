"""Parameters of the nodes: what may be set, and when it acts."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from graphs import written
from processes import GRASP, START, end_nodes, ran, wait_for
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterValue, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.clock import ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from rclpy.time import Time as RosTime
from rosbags.typesys import Stores, get_typestore
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from grasp_ros import scene
from grasp_ros.graph import __main__, bag
from grasp_ros.graph.bag.verify import laws_of, verify
from grasp_ros.graph.lockstep.synchronizer import Tick
from grasp_ros.graph.nodes.controller import Controller
from grasp_ros.graph.nodes.lyapunov_monitor import LyapunovMonitor
from grasp_ros.graph.nodes.monitor import Monitor
from grasp_ros.graph.nodes.plant import Plant
from grasp_ros.graph.parameters import FREE, NODES
from grasp_ros.graph.ros.messages import State
from grasp_ros.graph.serialization import list_message
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT
from grasp_ros.scene.topics import CHANGES, NAMED_LIST
from grasp_ros.simulation import simulate
from lab.drills import recorder

pytestmark = pytest.mark.slow  # real nodes
GAIN = "left_feedback.position_gain_N_per_m"


@pytest.fixture
def loop(make: Any, executor: SingleThreadedExecutor) -> tuple[Plant, Controller, SingleThreadedExecutor]:
    """A plant and its controller in this process."""
    plant, controller = make(Plant, scene="arm_alone"), make(Controller, "left_controller")
    for node in (plant, controller):
        executor.add_node(node)
    wait_for(lambda: executor.spin_once(timeout_sec=0.1) or plant.tick > 10, "some ticks")
    return plant, controller, executor


def test_a_node_takes_what_it_dumps(loop: tuple[Any, ...]) -> None:
    for node in loop[:2]:
        present = list(node.get_parameters(list(node._parameters)))
        assert len(present) > 8
        for parameter in present:
            as_text = [Parameter(parameter.name, value=repr(parameter.value))]  # so `ros2 param load` sends 1e-14
            for same in ([parameter], as_text if isinstance(parameter.value, float) else []):
                assert node.set_parameters_atomically(same).successful, parameter.name
        fixed = node.set_parameters_atomically([Parameter("peer_timeout_s", value=3.0)])
        assert not fixed.successful
        unknown = node.set_parameters_atomically([Parameter("peer_timeout", value=3.0)])
        assert unknown.reason == "peer_timeout: no such parameter; did you mean peer_timeout_s?"


@pytest.mark.parametrize("text", ["true", "yes", "1_0", "null", "[1.0]", "", "[", "&a 1.0", "1" + "0" * 399])
def test_a_text_that_is_no_number_is_refused(loop: tuple[Any, ...], text: str) -> None:
    controller = loop[1]
    gain = next(name for name, value in controller._parameters.items() if "." in name and type(value.value) is float)
    held = controller.get_parameter(gain).value
    refused = controller.set_parameters_atomically([Parameter(gain, value=text)])
    assert not refused.successful
    assert f"{gain}: {text!r} is not allowed; allowed: a number" in refused.reason
    assert controller.get_parameter(gain).value == held


def test_what_rclpy_cannot_read_ends_no_node(make: Any, node: Any) -> None:
    """Its own callbacks raise for a parameter of a type that there is none, and for a negative time."""
    controller, (peer, executor) = make(Controller, "left_controller", use_sim_time=True), node
    executor.add_node(controller)
    clock = peer.create_publisher(Clock, "/clock", 1)

    def answer(kind: Any, name: str, *values: Any) -> Any:
        client = peer.create_client(kind, f"/left_controller/{name}")
        wait_for(lambda: executor.spin_once(timeout_sec=0.1) or client.service_is_ready(), "the service")
        request = kind.Request(parameters=[ParameterMsg(name=key, value=value) for key, value in values])
        asked = client.call_async(request)
        wait_for(lambda: executor.spin_once(timeout_sec=0.1) or asked.done(), "an answer")
        return asked.result()

    strange, no = ("period_s", ParameterValue(type=99)), ("use_sim_time", ParameterValue(type=1, bool_value=False))
    results = answer(SetParameters, "set_parameters", no, strange, no).results
    assert [result.successful for result in results] == [False] * 3
    assert results[0].reason == "use_sim_time: set at the start only, with -p or a parameter file"
    assert "99" in results[1].reason
    assert not answer(SetParametersAtomically, "set_parameters_atomically", strange).result.successful
    for seconds in (-5, 7):
        clock.publish(Clock(clock=Time(sec=seconds)))
    seven = RosTime(seconds=7, clock_type=ClockType.ROS_TIME)
    wait_for(lambda: executor.spin_once(timeout_sec=0.1) or controller.get_clock().now() == seven, "the time")


def test_numbers_that_somebody_else_refuses_never_act(loop: tuple[Any, ...]) -> None:
    plant, controller, executor = loop
    refusing = [True]

    def acting() -> Any:
        return controller._scene.system.laws[LEFT].row[0]

    def refuse(_: Any) -> SetParametersResult:
        return SetParametersResult(successful=not refusing[0], reason="not now")

    controller._on_set_parameters_callbacks.append(refuse)  # the door of rclpy lets a later one be asked first
    tick = plant.tick
    assert controller.set_parameters([Parameter(GAIN, value=9.0)])[0].reason == "not now"
    wait_for(lambda: executor.spin_once(timeout_sec=0.1) or plant.tick > tick + 10, "some ticks")
    assert acting() == controller.get_parameter(GAIN).value == 5.0
    refusing.clear()
    refusing.append(False)
    assert controller.set_parameters([Parameter(GAIN, value=9.0)])[0].successful
    wait_for(lambda: executor.spin_once(timeout_sec=0.1) or acting() == 9.0, "the new gain")


@pytest.mark.thorough
def test_no_number_that_was_set_is_missed_by_a_monitor_that_is_behind(
    context: rclpy.Context, make: Any, tmp_path: Path
) -> None:
    """One for each state that the plant may be ahead of it."""
    plant = make(Plant, scene="arm_alone", wait_for_monitor=True, **{"time.duration_s": 0.6})
    controller = make(Controller, "left_controller", wait_for_monitor=True)
    monitor = Monitor(context=context, parameter_overrides=[Parameter("bag", value=str(tmp_path / "bag"))])
    loop, behind = (SingleThreadedExecutor(context=context) for _ in range(2))
    for executor, node in ((loop, plant), (loop, controller), (behind, monitor)):
        executor.add_node(node)

    def spin() -> None:  # many at a time, because `wait_for` sleeps after each look: thousands of messages wait
        for executor in 50 * [loop, behind]:
            executor.spin_once(timeout_sec=0.001)

    wait_for(lambda: spin() or plant.tick > 2, "ticks")
    while plant.tick < 490:
        assert controller.set_parameters([Parameter(GAIN, value=1.0 + plant.tick)])[0].successful
        loop.spin_once(timeout_sec=0.1)
    wait_for(lambda: spin() or monitor.finished, "end")
    end_nodes(monitor)
    recording = bag.read(tmp_path / "bag")
    assert len(recording.changes) > 400
    assert laws_of(recording) == {"left": "the scene's law"}
    assert not any(recording.missing.values())
    assert recording.lost["lost announcements"] == recording.lost["refused announcements"] == "0"


def test_the_laws_of_two_resets_in_a_row_each_act_in_their_run() -> None:
    """A free run's states need no commands: after a reset its laws may come later, and those of the next reset, too.

    So may a law of the last tick before a reset: it never acts, and none behind it may wait for it.
    """
    arm = scene.load("arm_alone")
    numbers, monitor = arm.numbers_of("left_controller"), LyapunovMonitor(arm)

    def announce(gain: float, tick: int = 0) -> None:
        stamp = tick * arm.period_ns
        monitor.announce("left", list_message(stamp, [*numbers], [*{**numbers, GAIN: gain}.values()]))

    def acting() -> list[float]:
        return [deserialize_message(cdr, JointState).position[[*numbers].index(GAIN)] for _, cdr in monitor.begin(0)]

    announce(1.0)
    assert acting() == [1.0]
    monitor.evaluate([Tick(0, False, State(0, arm.initial_state.tolist(), [0.0, 0.0, 0.0]), {}, 0, 0)])
    monitor.restart()
    announce(2.0)
    announce(3.0)
    assert acting() == [2.0]
    monitor.restart()
    assert acting() == [3.0]
    announce(4.0, tick=5)
    monitor.restart()
    announce(5.0)
    assert acting() == [5.0]


def test_an_announcement_with_a_number_missing_is_refused_in_words() -> None:
    arm = scene.load("arm_alone")
    numbers = [*arm.numbers_of("left_controller")]
    with pytest.raises(Refused, match=f"left/parameters: {len(numbers)} names, 1 numbers"):
        LyapunovMonitor(arm).announce("left", list_message(0, numbers, [1.0]))


def test_an_announcement_that_is_lost_is_seen_in_the_bag(tmp_path: Path) -> None:
    run = simulate(scene.load("arm_alone", ["time.duration_s=0.004"]), sampled=True)
    ticks, numbers, types = [], run.scene.numbers_of("left_controller"), get_typestore(Stores.ROS2_JAZZY)
    for tick, (time_ns, rows) in enumerate(recorder.ticks_of(run)):
        values = np.array([*{**numbers, GAIN: 5.0 + tick}.values()])
        said = types.deserialize_cdr(list_message(time_ns, list(numbers), values), NAMED_LIST)
        said.header.frame_id = str(1 + 2 * tick)  # its number
        beside = [(CHANGES["left"], bytes(types.serialize_cdr(said, NAMED_LIST)))] if tick < 3 else []
        ticks.append((time_ns, [*beside, *rows]))
    recording = bag.read(written(tmp_path / "bag", run.scene, ticks))
    assert recording.unheard == {"left/parameters": 2}
    assert recording.missing["left/parameters"] == 2
    assert laws_of(recording) == {"left": "not known: the bag lacks 2 announcements of its numbers"}
    followed = "5 states follow from the recorded inputs, bit for bit; the bag lacks 2 announcements on left/parameters"
    assert verify(recording).words == followed


def test_a_bag_that_lacks_every_announcement_has_the_energy_of_its_monitor(tmp_path: Path) -> None:
    """Of a bag that was filtered, say: the monitor knew another law than the scene's, and nobody else does."""
    before = scene.load("arm_alone", ["time.duration_s=0.004"])
    stiffer = simulate(before.changed({GAIN: 9.0}), sampled=True)
    ticks = [(time_ns, [row for row in rows if row[0] != CHANGES["left"]])
             for time_ns, rows in recorder.ticks_of(stiffer)]
    recording = bag.read(written(tmp_path / "bag", before, ticks))
    assert recording.missing["left/parameters"] == 1
    assert np.array_equal(recording.energy.V, stiffer.energy.V)
    assert laws_of(recording) == {"left": "not known: the bag lacks 1 announcements of its numbers"}
    assert verify(recording).difference is None


def test_help_names_what_can_be_set(
    loop: tuple[Any, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It starts no node."""
    plant, controller, _ = loop
    monkeypatch.setattr(__main__, "note_signals", None)  # nothing comes that far
    ros = ("use_sim_time", "start_type_description_service", "qos_overrides")
    for name, node, later in (("plant", plant, {*FREE}), ("left_controller", controller, set())):
        declared = {key for key in node._parameters if not key.startswith(ros) and "." not in key}
        assert declared | later == {*NODES[name]}
    for name in ("plant", "left_controller", "right_controller", "monitor"):
        for words in (["--help"], ["-h", "--ros-args", "-p", "scene:=case_99"]):
            monkeypatch.setattr(sys, "argv", ["", name, *words])
            assert __main__.start() == 0
            said, err = capsys.readouterr()
            assert not err
            assert said.startswith(f"usage: {name} ")
            assert all(f"  {key} " in said for key in NODES[name])


REFUSED = [
    ("ROS_DOMAIN_ID", "1.5", "allowed: 0 to 232"), ("ROS_DOMAIN_ID", "-1", "allowed: 0 to 232"),
    ("ROS_DOMAIN_ID", "233", "allowed: 0 to 232"),
    ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", "no node would find another"),
    ("ROS_AUTOMATIC_DISCOVERY_RANGE", "local", "allowed: LOCALHOST, SUBNET, SYSTEM_DEFAULT"),
    ("RMW_IMPLEMENTATION", "rmw_other_cpp", "allowed here: rmw_fastrtps_cpp"),
    ("FASTRTPS_DEFAULT_PROFILES_FILE", "nowhere.xml", "No such file or directory"),
    ("FASTDDS_DEFAULT_PROFILES_FILE", __file__, "; allowed: an XML file of profiles"),
]


@pytest.mark.parametrize(("name", "value", "why"), REFUSED, ids=[f"{name}={value}" for name, value, _ in REFUSED])
def test_where_no_graph_can_be_none_starts(
    command: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str, value: str, why: str
) -> None:
    monkeypatch.setenv(name, value)
    for words in (["run", "case_01"], ["watch"], ["ctl", "status"]):
        found = command(*words)
        assert found.returncode == 2
        assert f"{name}: {value!r} is not allowed" in found.stderr
        assert why in found.stderr
    monkeypatch.setattr(__main__, "note_signals", None)  # nothing comes that far
    monkeypatch.setattr(sys, "argv", ["", "monitor"])
    assert __main__.start() == 2
    assert why in capsys.readouterr().err


def test_a_warning_that_the_user_makes_an_error_is_no_fault() -> None:
    found = ran(*START, "monitor", env={**os.environ, "PYTHONWARNINGS": "error"})
    assert found.returncode == 1
    assert found.stderr.startswith("monitor: PYTHONWARNINGS makes it an error: DeprecationWarning: ")


ASKING = "def law(tick, time, x, v, x_object):\n    return x_object - x\n"
CAMERA = "class law:\n    def __init__(self):\n        raise ValueError('no camera')\n"
NOT_BEGUN = [  # variables of the environment, the law, and what is said of them
    ("ROS_LOG_DIR=/proc/nowhere", CAMERA, "ROS does not start: .*'/proc/nowhere'.* ROS_LOG_DIR=/proc/nowhere"),
    ("ROS_SECURITY_ENABLE=true ROS_SECURITY_STRATEGY=Enforce", CAMERA, "it does not say why; .*ROS_SECURITY_STR"),
    ("ROS_STATIC_PEERS=no.such.host.invalid", CAMERA, "Unable to resolve peer no.such.host.* ROS_STATIC_PEERS=no"),
    ("", CAMERA, "grasp: left_controller: law: laws:law: .* cannot be initialised: ValueError: no camera, .*line 3$"),
    ("", ASKING, "asks for x_object; the scene has no object"),
]


@pytest.mark.parametrize(("variables", "source", "words"), NOT_BEGUN)
def test_a_run_whose_nodes_refuse_what_they_are_given_is_refused_and_leaves_nothing(
    tmp_path: Path, variables: str, source: str, words: str
) -> None:
    (tmp_path / "laws.py").write_text(source)
    environment = {**os.environ, **dict(word.split("=") for word in variables.split())}
    found = ran(*GRASP, "run", "arm_alone", "--controller", "left=laws:law", "-o", "run", env=environment, cwd=tmp_path)
    assert found.returncode == 2
    assert re.search(words, found.stderr, re.M)
    assert "Traceback" not in found.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("words", [[*START, "plant"], [*GRASP, "run", "case_01"]])
@pytest.mark.parametrize(
    ("limit", "said"),
    [
        ("-v 1000000", "memory (`ulimit -v`): 1000000 kB is not allowed; allowed: 2097152 or more"),
        ("-n 25", "open files (`ulimit -n`): 25 is not allowed; allowed: 32 or more"),
    ],
)
def test_a_limit_in_which_no_node_has_room_is_named(tmp_path: Path, words: list[str], limit: str, said: str) -> None:
    found = ran("sh", "-c", f'ulimit {limit}; exec "$@"', "sh", *words, cwd=tmp_path)
    assert (found.returncode, len(found.stderr.splitlines())) == (2, 1)
    assert said in found.stderr


def test_one_process_needs_to_find_nobody(tmp_path: Path) -> None:
    run = [*GRASP, "run", "arm_alone", "--set", "time.duration_s=0.1", "--one-process", "--no-figure"]
    found = ran(*run, env={**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, cwd=tmp_path)
    assert found.returncode == 0, found.stderr
