"""Messages that are decoded many at a time have the numbers that rosbags gives them one by one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from grasp_ros import scene as scenes
from grasp_ros.graph import bag
from grasp_ros.graph.columns import alike
from grasp_ros.graph.recorder import Recorder
from grasp_ros.graph.rosbag2 import list_message
from grasp_ros.scene.topics import CLOCK, JOINT_STATES, LEFT_COMMAND, LYAPUNOV, LYAPUNOV_NAMES, Topic, state_of
from grasp_ros.simulation import simulate
from lab.drills import recorder as study

STORE = get_typestore(Stores.ROS2_JAZZY)


def message(
    topic: Topic, number: int, frame: str = "", names: tuple[str, ...] = ("a", "bc"), little: bool = True
) -> bytes:
    """One of a topic, with numbers of its own."""
    kinds = STORE.types
    stamp = kinds["builtin_interfaces/msg/Time"](sec=number - 2, nanosec=number)
    if topic == CLOCK:
        content = kinds[topic.type](clock=stamp)
    elif topic == LEFT_COMMAND:
        vectors = [kinds["geometry_msgs/msg/Vector3"](x=number + i, y=0.1, z=-0.0) for i in (0.5, np.nan)]
        wrench = kinds["geometry_msgs/msg/Wrench"](force=vectors[0], torque=vectors[1])
        content = kinds[topic.type](header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=frame), wrench=wrench)
    else:
        content = kinds[topic.type](
            header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=frame), name=list(names),
            position=np.arange(2.0) / number, velocity=np.zeros(0), effort=np.full(3, -1.0 / number),
        )
    return bytes(STORE.serialize_cdr(content, topic.type, little_endian=little))


def numbers_of(content: Any, name: str) -> Any:
    """A number, or a list of them, by its dotted name."""
    for part in name.split("."):
        content = getattr(content, part)
    return content


def check(topic: Topic, cdrs: list[bytes]) -> int:
    """Compare every number with what rosbags decodes; returns into how many groups they came."""
    groups, seen = list(alike(topic, cdrs)), []
    for group in groups:
        for place, row in zip(group.places.tolist(), group.numbers, strict=True):
            one: Any = STORE.deserialize_cdr(cdrs[place], topic.type)
            assert getattr(one, "name", None) == getattr(group.first, "name", None)
            assert row.dtype.names
            for name in row.dtype.names:
                wanted = np.asarray(numbers_of(one, name))
                assert row[name].astype(wanted.dtype).tobytes() == wanted.tobytes(), name
            seen.append(place)
    assert sorted(seen) == list(range(len(cdrs)))
    return len(groups)


@pytest.mark.parametrize("topic", [JOINT_STATES, LEFT_COMMAND, CLOCK])
def test_messages_of_one_recorder_are_one_group(topic: Topic) -> None:
    assert check(topic, [message(topic, number) for number in range(1, 50)]) == 1


@pytest.mark.parametrize("topic", [JOINT_STATES, LEFT_COMMAND])
def test_others_among_them_are_groups_of_their_own(topic: Topic) -> None:
    cdrs = [message(topic, number, frame) for number in range(1, 9) for frame in ("", "a", "b", "world")]
    assert check(topic, cdrs) == 4
    assert check(topic, cdrs + [message(topic, number, little=False) for number in range(1, 9)]) == 5
    assert check(topic, [message(topic, number, "x" * number) for number in range(1, 30)]) == 29


def test_other_names_are_another_group() -> None:
    cdrs = [message(JOINT_STATES, 1, names=names) for names in (("a", "bc"), ("b", "ac"), ("ab", "c"), ())]
    assert check(JOINT_STATES, cdrs * 3) == 4


def test_what_only_fills_up_does_not_count() -> None:
    """rclpy leaves there what was in the memory."""
    cdr = message(LEFT_COMMAND, 3)
    stray = cdr[:2] + b"\x01\x02" + cdr[4:17] + b"\x07\x08\x09" + cdr[20:]
    assert len(stray) == len(cdr)
    assert check(LEFT_COMMAND, [cdr, stray]) == 1


def test_what_is_no_message_is_refused_wherever_it_stands() -> None:
    whole = [message(JOINT_STATES, number) for number in range(1, 9)]
    cdr = whole[0]
    for wrong in (cdr[:-1], cdr + bytes(8), b"", b"\x07" + cdr[1:], cdr[:12] + b"\xff" + cdr[13:]):
        with pytest.raises(SerdeError):
            list(alike(JOINT_STATES, [*whole, wrong]))


@pytest.mark.parametrize("name", ["case_01", "everything", "arm_alone"])
def test_a_recording_has_the_numbers_that_another_reader_decodes(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bag, "BATCH_BYTES", 20_000)  # several batches
    run = simulate(scenes.load(name, ["time.duration_s=0.5"]), sampled=True)
    study.write(tmp_path / "bag", run)
    recording, scene = bag.read(tmp_path / "bag"), run.scene
    found: dict[str, list[Any]] = {}
    with Reader(tmp_path / "bag") as reader:
        for connection, time_ns, raw in reader.messages():
            found.setdefault(connection.topic, []).append((time_ns, STORE.deserialize_cdr(raw, connection.msgtype)))
    times, states = zip(*found["/joint_states"], strict=True)
    assert [tick * scene.period_ns for tick in recording.tick.tolist()] == list(times)
    assert recording.state.tobytes() == np.array([state_of(one)[0] for one in states]).tobytes()
    assert recording.effort.tobytes() == np.array([state_of(one)[1][:2] for one in states]).tobytes()
    assert recording.lyapunov.tobytes() == np.array([one.position for _, one in found["/lyapunov"]]).tobytes()
    for topic, column in recording.outputs.items():
        assert column.tobytes() == np.array([one.wrench.force.x for _, one in found[f"/{topic}"]]).tobytes()
    for side, topic in zip(scene.system.laws, scene.controllers.values(), strict=True):
        commands = np.array([one.wrench.force.x for _, one in found[f"/{topic.name}"]])
        assert recording.command[:, side].tobytes() == commands.tobytes()


def test_a_list_of_another_length_is_refused(tmp_path: Path) -> None:
    run = simulate(scenes.load("case_01", ["time.duration_s=0.01"]), sampled=True)
    recorder = Recorder(tmp_path / "bag", run.scene, {})
    for time_ns, messages in study.ticks_of(run):
        if time_ns == 10_000_000:
            messages[-1] = LYAPUNOV, list_message(time_ns, LYAPUNOV_NAMES[:8], np.zeros(8))
        recorder.write_tick(time_ns, messages)
    recorder.close()
    with pytest.raises(bag.BagError, match="/lyapunov: 8 numbers; allowed: 9"):
        bag.read(tmp_path / "bag")


@pytest.mark.parametrize("times", [(0, 1, 1), (0, 2, 1), (0, 1, 0.5)])
def test_ticks_that_are_none_are_refused_across_batches(
    tmp_path: Path, times: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = simulate(scenes.load("case_01", ["time.duration_s=0.01"]), sampled=True)
    _, messages = next(study.ticks_of(run))
    recorder = Recorder(tmp_path / "bag", run.scene, {})
    for time in times:
        recorder.write_tick(round(time * run.scene.period_ns), messages)
    recorder.close()
    wrong = round(times[-1] * run.scene.period_ns)
    for most in (0, bag.BATCH_BYTES):
        monkeypatch.setattr(bag, "BATCH_BYTES", most)
        with pytest.raises(bag.BagError, match=f": {wrong} ns; allowed: ticks of the scene in their order"):
            bag.read(tmp_path / "bag")
