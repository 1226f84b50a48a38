"""Messages of a bag have the numbers that rosbags gives them, whoever has written them."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import rewritten, written
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from grasp_ros import scene as scenes
from grasp_ros.graph import bag
from grasp_ros.graph.bag.reading import recover
from grasp_ros.graph.bag.rosbag2 import text_message
from grasp_ros.graph.bag.summary import summary
from grasp_ros.graph.bag.verify import verify
from grasp_ros.graph.parameters import Running
from grasp_ros.graph.serialization import list_message
from grasp_ros.physics.layout import OBJECT
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene import topics
from grasp_ros.scene.topics import JOINT_STATES, LEFT_COMMAND, LEFT_CONTACT, LYAPUNOV, LYAPUNOV_NAMES, SCENE, Topic
from grasp_ros.simulation import Trajectory, simulate
from lab.drills import recorder as study

STORE = get_typestore(Stores.ROS2_JAZZY)
Ticks = list[study.Tick]


@pytest.fixture(scope="module")
def run() -> Trajectory:
    return simulate(scenes.load("case_01", ["time.duration_s=0.01"]), sampled=True)


@pytest.fixture
def ticks(run: Trajectory) -> list[study.Tick]:
    """What a recorder has of the run, to be changed."""
    return list(study.ticks_of(run))


def put(tick: study.Tick, topic: Topic, cdr: bytes) -> None:
    """Another message in the place of one of a tick."""
    tick[1][[own for own, _ in tick[1]].index(topic)] = topic, cdr


def changed(topic: Topic, cdr: bytes, path: str, value: Any) -> bytes:
    """A message with another value somewhere: "position.1" or "header.stamp.nanosec", say."""
    content: Any = STORE.deserialize_cdr(cdr, topic.type)
    *parents, last = path.split(".")
    place = content
    for name in parents[: -1 if last.isdecimal() else None]:
        place = getattr(place, name)
    if last.isdecimal():
        last, number = parents[-1], int(last)
        values = getattr(place, last).copy()
        values[number], value = value, values
    setattr(place, last, value)
    return bytes(STORE.serialize_cdr(content, topic.type))


def change(tick: study.Tick, topic: Topic, path: str, value: Any) -> None:
    """Change a message of a tick."""
    put(tick, topic, changed(topic, dict(tick[1])[topic], path, value))


def again(topic: Topic, cdr: bytes, little: bool, frame: str) -> bytes:
    """A message as another program may write it."""
    content: Any = STORE.deserialize_cdr(cdr, topic.type)
    content.header.frame_id = frame
    if topic in topics.COMMANDS.values():
        content.wrench.force.y = 3.0  # of which a reader takes the force along the line alone
    if topic.type == topics.NAMED_LIST:
        for name in ("name", "position", "velocity", "effort"):
            setattr(content, name, getattr(content, name)[::-1].copy())
    return bytes(STORE.serialize_cdr(content, topic.type, little_endian=little))


@pytest.mark.parametrize("little", [True, False])
def test_messages_of_another_make_have_the_same_numbers(tmp_path: Path, little: bool) -> None:
    """In another order of bytes or of names, in other frames; some of them among those of the recorder."""
    run = simulate(scenes.load("everything", ["time.duration_s=0.05"]), sampled=True)
    study.write(tmp_path / "bag", run)
    ticks = list(study.ticks_of(run))
    for number, (_, messages) in enumerate(ticks):
        if number % 3:
            messages[:] = [(topic, again(topic, cdr, little, "x" * number)) for topic, cdr in messages]
    written(tmp_path / "other", run.scene, ticks)
    bags = [bag.read(tmp_path / name) for name in ("bag", "other")]
    for name in ("tick", "state", "effort", "command", "lyapunov", "starts"):
        assert len({getattr(found, name).tobytes() for found in bags}) == 1, name
    assert len({b"".join(values.tobytes() for values in found.outputs.values()) for found in bags}) == 1


@pytest.mark.parametrize("topic", [JOINT_STATES, LEFT_COMMAND, LYAPUNOV])
def test_what_is_no_message_is_refused_wherever_it_stands(
    tmp_path: Path, run: Trajectory, ticks: Ticks, topic: Topic
) -> None:
    cdr = dict(ticks[5][1])[topic]
    wrong = cdr[:-1], cdr + bytes(8), b"", b"\x07" + cdr[1:], cdr[:12] + b"\xff" + cdr[13:]
    for number, noise in enumerate(wrong):
        put(ticks[5], topic, noise)
        written(tmp_path / str(number), run.scene, ticks)
        with pytest.raises(bag.BagError, match="; `grasp recover` leaves it out"):
            bag.read(tmp_path / str(number))


def test_what_strangers_send_on_timing_is_left_out(tmp_path: Path, run: Trajectory, ticks: Ticks) -> None:
    names = topics.timing_names(["left", "right"])
    own = np.arange(len(names)) + 0.5
    sent = [list_message(0, *message) for message in (
        (("a", "b"), np.ones(2)), (names, own - 0.25), (names, own), (("a", "b"), np.zeros(0)), (names, own * math.nan),
        (names[:-1], own[:-1]), (("reached", "overruns", "lost_s", "left_age_p99_all"), np.ones(4)),
    )]
    ticks[5][1].extend((topics.TIMING, cdr) for cdr in (*sent, b"", sent[2][:-3]))
    recording = bag.read(written(tmp_path / "bag", run.scene, ticks, running=Running(real_time_factor=1.0)))
    assert {name: values.tolist() for name, values in recording.timing.items()} == {
        name: [number - 0.25, number] for name, number in zip(names, own, strict=True)}
    assert summary(recording)["given_up_s"] == recording.timing["lost_s"][-1]
    assert not bag.read(written(tmp_path / "lockstep", run.scene, ticks)).timing


@pytest.mark.parametrize("name", ["case_01", "everything", "arm_alone"])
def test_a_recording_has_the_numbers_that_another_reader_decodes(tmp_path: Path, name: str) -> None:
    run = simulate(scenes.load(name, ["time.duration_s=0.5"]), sampled=True)
    study.write(tmp_path / "bag", run)
    recording, scene = bag.read(tmp_path / "bag"), run.scene
    found: dict[str, list[Any]] = {}
    with Reader(tmp_path / "bag") as reader:
        for connection, time_ns, raw in reader.messages():
            found.setdefault(connection.topic, []).append((time_ns, STORE.deserialize_cdr(raw, connection.msgtype)))
    times, states = zip(*found["/joint_states"], strict=True)
    assert [tick * scene.period_ns for tick in recording.tick.tolist()] == list(times)
    named = [{word: row for word, *row in zip(one.name, one.position, one.velocity, one.effort, strict=True)}
             for one in states]
    for body, word in NAMES.items():
        rows = np.array([one.get(word, (math.nan, math.nan, 0.0)) for one in named])
        assert recording.state[:, COLUMN[body] :][:, :2].tobytes() == rows[:, :2].tobytes()
        assert body == OBJECT or recording.effort[:, body].tobytes() == rows[:, 2].tobytes()
    assert recording.lyapunov.tobytes() == np.array([one.position for _, one in found["/lyapunov"]]).tobytes()
    for topic, column in recording.outputs.items():
        assert column.tobytes() == np.array([one.wrench.force.x for _, one in found[f"/{topic}"]]).tobytes()
    for side, topic in zip(scene.system.laws, scene.controllers.values(), strict=True):
        commands = np.array([one.wrench.force.x for _, one in found[f"/{topic.name}"]])
        assert recording.command[:, side].tobytes() == commands.tobytes()


@pytest.mark.parametrize(
    ("topic", "path", "value", "words"),
    [
        (JOINT_STATES, "position.1", np.nan, "tick 5: a number is not finite"),
        (JOINT_STATES, "effort.2", np.inf, "tick 5: a number is not finite"),
        (LEFT_COMMAND, "wrench.force.x", np.nan, "tick 5: a number is not finite"),
        (JOINT_STATES, "velocity.0", 1e200, "tick 5: a number is not finite, or beyond 1e\\+100"),
        (JOINT_STATES, "name.1", "left", "left, left, right; allowed: three numbers of left, object, right"),
        (JOINT_STATES, "effort.1", 99.0, "tick 5: an effort of the object; allowed: 0"),
        (JOINT_STATES, "header.stamp.nanosec", 7, "tick 5: its stamp is not the next one of the scene"),
        (LEFT_COMMAND, "header.stamp.nanosec", 4_000_000, "tick 5: its stamp is not that of the state"),
        (LYAPUNOV, "header.stamp.sec", 1, "tick 5: its stamp is not that of the state"),
        (JOINT_STATES, "name.2", "foot", "left, object, foot; allowed: three numbers of left, object, right"),
        (JOINT_STATES, "effort", np.zeros(2), "left, object, right; allowed: three numbers of left, object, right"),
        (LYAPUNOV, "position", np.zeros(8), "/lyapunov: 8 numbers; allowed: 9"),
        (LYAPUNOV, "name.0", "vigour", "/lyapunov: vigour, .*; allowed: V, "),
        (LEFT_CONTACT, "wrench.force.y", 3.0, r"contact/left: a force or torque other than force\.x; allowed: 0"),
    ],
)
def test_a_tick_that_cannot_be_true_is_refused_and_left_out_of_what_is_recovered(
    tmp_path: Path, run: Trajectory, ticks: Ticks, topic: Topic, path: str, value: Any, words: str
) -> None:
    change(ticks[5], topic, path, value)
    written(tmp_path / "bag", run.scene, ticks)
    with pytest.raises(bag.BagError, match=f"{words}.*; `grasp recover` leaves it out"):
        bag.read(tmp_path / "bag")
    found = recover(tmp_path / "bag", tmp_path / "new")
    assert [left.partition(":")[0] for left in found.left_out] == ["parts of 1 ticks, the first 5"]
    assert found.missing == "5"
    assert bag.read(tmp_path / "new").tick.tolist() == [tick for tick in range(11) if tick != 5]


@pytest.mark.parametrize(("value", "why"), [(np.nan, "/left/effort_command: a number is not finite"), (1.0, "")])
def test_a_command_of_a_free_run_that_cannot_be_read_is_left_out(
    tmp_path: Path, run: Trajectory, ticks: Ticks, value: float, why: str
) -> None:
    change(ticks[5], LEFT_COMMAND, "wrench.force.x", value)
    written(tmp_path / "bag", run.scene, ticks, running=Running(real_time_factor=1.0))
    found = recover(tmp_path / "bag", tmp_path / "new")
    assert [left.startswith(f"parts of 1 ticks, the first 5: {why}") for left in found.left_out] == [True] * bool(why)
    assert len(bag.read(tmp_path / "new").held["left"]) == 11 - bool(why)


@pytest.mark.parametrize("name", LYAPUNOV_NAMES)
@pytest.mark.parametrize("value", [1e9, np.nan])
def test_every_number_of_the_monitor_is_verified(tmp_path: Path, name: str, value: float) -> None:
    run = simulate(scenes.load("everything", ["time.duration_s=0.05"]), sampled=True)
    ticks = list(study.ticks_of(run))
    change(ticks[40], LYAPUNOV, f"position.{LYAPUNOV_NAMES.index(name)}", value)
    written(tmp_path / "bag", run.scene, ticks)
    found = verify(bag.read(tmp_path / "bag"))
    assert found.difference is not None
    assert not found.holds
    assert (found.difference.tick, found.difference.topic) == (40, "lyapunov")
    assert found.difference.name == ("V" if name == "closed" else name)  # V is not there where it is not closed


@pytest.mark.parametrize("name", ["alarm", "work"])
def test_a_balance_that_nobody_knows_does_not_close(tmp_path: Path, run: Trajectory, ticks: Ticks, name: str) -> None:
    for tick in ticks:
        change(tick, LYAPUNOV, f"position.{LYAPUNOV_NAMES.index(name)}", np.nan)
    found = summary(bag.read(written(tmp_path / "bag", run.scene, ticks)))
    assert found["balanced_ticks"] == 0
    assert np.isnan(found["work_J"])


def test_a_bag_with_a_reset_may_be_written_anew(tmp_path: Path, run: Trajectory, ticks: Ticks) -> None:
    """From a reset on its times are ahead of the stamps. A flipped bit is named by its tick of the bag."""
    again = [(ticks[-1][0] + run.scene.period_ns + time_ns, messages, time_ns) for time_ns, messages in ticks]
    written(tmp_path / "bag", run.scene, [*ticks, *again])
    rewritten(tmp_path / "bag" / "bag.mcap", tmp_path / "new.mcap")
    found = bag.read(tmp_path / "new.mcap")
    assert (found.resets, verify(found).ticks, verify(found).problem) == (1, 22, "")
    row = int(found.starts[1]) + 2
    for column, name in enumerate(f"{body} {part}" for body in NAMES.values() for part in ("position", "velocity")):
        state = found.state.copy()
        state[row].view(np.int64)[column] ^= 1
        (x, other), tick = (float(states[row, column]) for states in (found.state, state)), found.tick[row]
        words = f"joint_states, {name}: recorded {other!r} ({other.hex()}), computed {x!r} ({x.hex()})"
        assert verify(replace(found, state=state)).words == f"NOT EQUAL, first at tick {tick}, {words}"


@pytest.mark.parametrize(("times", "why"), [
    ((0, 1, 1), ": a second message of this tick; allowed: one"),
    ((0, 2, 1), "; allowed: ticks of the scene in their order"),
    ((0, 1, 0.5), "; allowed: ticks of the scene in their order"),
])
def test_ticks_that_are_none_are_refused(
    tmp_path: Path, run: Trajectory, ticks: Ticks, times: tuple[float, ...], why: str
) -> None:
    written(tmp_path / "bag", run.scene, [(round(time * run.scene.period_ns), ticks[0][1], 0) for time in times])
    wrong = round(times[-1] * run.scene.period_ns)
    with pytest.raises(bag.BagError, match=f": {wrong} ns{why}"):
        bag.read(tmp_path / "bag")


def test_a_message_that_is_twice_in_a_tick_is_refused_and_of_two_the_last_is_recovered(
    tmp_path: Path, run: Trajectory, ticks: Ticks
) -> None:
    other = changed(LEFT_CONTACT, dict(ticks[5][1])[LEFT_CONTACT], "wrench.force.x", 9.0)
    ticks[5][1].insert(0, (LEFT_CONTACT, other))
    written(tmp_path / "bag", run.scene, ticks)
    with pytest.raises(bag.BagError, match=r"contact/left: 5000000 ns: a second message of this tick; allowed: one"):
        bag.read(tmp_path / "bag")
    left_out = recover(tmp_path / "bag", tmp_path / "new").left_out
    assert left_out == ["messages on /contact/left before another one of their tick: 1"]
    assert verify(bag.read(tmp_path / "new")).ticks == 11


def test_another_scene_is_refused_and_said_to_be_left_out(tmp_path: Path, run: Trajectory, ticks: Ticks) -> None:
    ticks[0][1].insert(0, (SCENE, text_message(run.scene.to_yaml())))
    assert verify(bag.read(written(tmp_path / "same", run.scene, ticks))).holds
    ticks[5][1].append((SCENE, text_message(scenes.load("case_02").to_yaml())))
    written(tmp_path / "bag", run.scene, ticks)
    why = "/scene: another scene than in the bag's own record"
    with pytest.raises(bag.BagError, match=re.escape(f"{tmp_path / 'bag'}: {why}; `grasp recover` leaves it out")):
        bag.read(tmp_path / "bag")
    assert recover(tmp_path / "bag", tmp_path / "new").left_out == [f"parts of 1 ticks, the first 5: {why}"]


@pytest.mark.parametrize("whole", [[], [0]])
def test_numbers_that_were_announced_at_a_tick_that_is_lost_act_from_the_next_one_on(
    tmp_path: Path, run: Trajectory, ticks: Ticks, whole: list[int]
) -> None:
    """Else V and the law of all that follows would be those of other numbers."""
    numbers = {**run.scene.numbers_of("left_controller"), "left_feedback.position_gain_N_per_m": 9.0}
    announcement = list_message(ticks[5][0], [*numbers], [*numbers.values()], frame="2")
    ticks[5] = (ticks[5][0], [(topics.CHANGES["left"], announcement), *(ticks[5][1][row] for row in whole)])
    written(tmp_path / "bag", run.scene, ticks)
    found = recover(tmp_path / "bag", tmp_path / "new")
    assert (found.ticks, found.missing) == (10, "5")
    assert [left.partition(": no message on ")[0] for left in found.left_out] == [
        "parts of 1 ticks, the first 5"] * len(whole)
    assert bag.read(tmp_path / "new").changes == {6: {"left_feedback.position_gain_N_per_m": 9.0}}
