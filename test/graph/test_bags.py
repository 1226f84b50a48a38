"""What a graph of four real processes records over real DDS, beside the simulation without ROS."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import rewritten, started, whole
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from processes import DEADLINE, wait_for
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import JointState

from grasp_ros import scene
from grasp_ros.cli import report
from grasp_ros.graph import bag
from grasp_ros.graph.bag.recorder import HEAD
from grasp_ros.graph.bag.summary import summary
from grasp_ros.graph.bag.verify import answers_of, laws_of, verify
from grasp_ros.graph.processes import Graph
from grasp_ros.graph.ros import messages
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.energy import energy
from grasp_ros.physics.layout import LEFT, OBJECT
from grasp_ros.scene.topics import CLOCK, JOINT_STATES, LYAPUNOV_NAMES
from grasp_ros.simulation import simulate
from lab.reference.grasp import grasp_of, impact_forces

pytestmark = pytest.mark.slow  # real processes


def content(directory: Path) -> list[tuple[str, int, bytes]]:
    """What the bag holds of simulated time; /diagnostics comes in wall time."""
    with (directory / "bag" / "bag.mcap").open("rb") as file:
        rows = make_reader(file).iter_messages()
        return [(channel.topic, message.log_time, message.data) for _, channel, message in rows
                if channel.topic != "/diagnostics"]


def test_graph_bag_and_simulation_are_equal_bit_for_bit(two_runs: tuple[Path, Path]) -> None:
    recording = bag.read(two_runs[0] / "bag")
    simulated = simulate(scene.load("case_01", ["time.duration_s=3"]), sampled=True)
    assert len(recording.tick) == 3001
    assert simulated.state.tobytes() == recording.state.tobytes()
    assert simulated.command.tobytes() == recording.command.tobytes()
    assert simulated.t.tobytes() == recording.t.tobytes()
    assert np.array_equal(recording.effort[1:], recording.command[:-1])
    assert simulated.inputs.tobytes() == recording.inputs.tobytes()
    assert len({*simulated.events}) >= 12  # the run has contacts to be equal in


def test_an_input_that_differs_is_found_and_a_bag_may_end_early_but_lack_no_tick(two_runs: tuple[Path, Path]) -> None:
    recording = bag.read(two_runs[0] / "bag")
    assert verify(recording).holds
    effort = recording.effort.copy()
    effort[300, 0] = np.nextafter(effort[300, 0], np.inf)
    found = verify(replace(recording, effort=effort)).difference
    assert found is not None
    assert found[:3] in ((300, "joint_states", "left velocity"), (300, "joint_states", "left effort"))
    fewer = replace(recording, counts={**recording.counts, "timing": recording.counts["timing"] - 2})
    assert "; the bag lacks 2 messages that its recorder has written" in verify(fewer).words
    cut = {name: getattr(recording, name)[:500] for name in ("tick", "state", "effort", "command", "lyapunov")}
    begin = replace(recording, lost={"end": "closed"}, **cut)
    assert np.isnan(begin.inputs[-1]).all()
    assert begin.inputs[:-1].tobytes() == recording.inputs[:499].tobytes()
    assert verify(begin).words == "500 states follow from the recorded inputs, bit for bit"
    gap = {name: np.delete(values, 100, axis=0) for name, values in cut.items()}
    assert np.flatnonzero(np.isnan(replace(recording, **gap).inputs[:, 0])).tolist() == [99, 498]
    words = verify(replace(recording, **gap)).words
    assert words.startswith("100 states follow from the recorded inputs, bit for bit; tick 100 is missing")


def test_a_bag_that_begins_late_says_what_was_compared_and_why_no_more(two_runs: tuple[Path, Path]) -> None:
    """Of a monitor that came to a plant that does not wait for it, and knew the laws later still."""
    recording = bag.read(two_runs[0] / "bag")
    rows = {name: getattr(recording, name)[100:].copy() for name in ("tick", "state", "effort", "command", "lyapunov")}
    rows["lyapunov"][:50, LYAPUNOV_NAMES.index("closed")] = 0.0
    late = replace(recording, starts=recording.starts[:0], **rows, outputs={
        name: values[100:] for name, values in recording.outputs.items()})
    found = verify(late)
    words = dict(report.describe_recording(late, summary(late)) + report.describe_verification(found))
    assert words["verified"] == ("nothing from the recorded inputs: the bag begins at tick 100, not at the beginning of"
                                 " the scene")
    assert words["same without ROS"] == "equal, bit for bit: the states and commands of every recorded tick"
    assert words["energy balance"] == "closes at 2900 of 3001 ticks, the others are not known"
    assert words["certificate"] == "none: at 50 of 2901 ticks the monitor did not know the law of the commands"
    assert not found.holds
    stiffer = {"left_feedback.position_gain_N_per_m": 9.0}  # who came at tick 100 cannot know from when on
    changed = simulate(recording.scene, sampled=True, changes={50: stiffer})
    found = verify(replace(late, state=changed.state[100:], command=changed.command[100:], changes={100: stiffer}))
    assert not found.answers["left"].differs
    assert found.same is None


CONVERTED = [
    ("--dst-storage mcap", "3001 states follow from the recorded inputs, bit for bit"),
    ("--dst-storage mcap --exclude-topic /lyapunov", "the bag lacks lyapunov of 3001 ticks, the first 0"),
    ("--dst-storage mcap --exclude-topic /clock", "the bag lacks /clock of 3001 ticks"),
    ("--dst-storage mcap --exclude-topic /left/effort_command", "not known: the bag has no message on left/effort_c"),
    ("--dst-storage mcap --include-topic /joint_states", "nothing at its beginning on scene and run; allowed: all"),
    ("--dst-storage mcap --compress zstd --compress-mode message", "its messages are compressed one by one; allowed:"),
    ("--dst-storage mcap --compress zstd", "its file is compressed as a whole; allowed: chunks, as `rosbags-convert"),
    ("--dst-storage sqlite3", "its storage is sqlite3; allowed: MCAP, as `rosbags-convert"),
]


@pytest.mark.parametrize(("options", "words"), CONVERTED, ids=[options for options, _ in CONVERTED])
def test_a_bag_that_another_program_has_written_anew_is_read_or_refused_for_its_own_reason(
    two_runs: tuple[Path, Path], tmp_path: Path, command: Any, options: str, words: str
) -> None:
    convert = [sys.executable, "-m", "rosbags.convert", "--src", two_runs[0] / "bag", "--dst", tmp_path / "new"]
    subprocess.run([*convert, *options.split()], check=True, timeout=DEADLINE)
    found = command("verify", "new")
    assert words in found.stdout + found.stderr
    assert found.returncode == (2 if "allowed" in words else 1 if "lacks" in words or "no message" in words else 0)
    if found.returncode == 0:
        shown = command("inspect", "new").stdout
        assert "written anew by another program, which does not say what was lost" in shown
        assert command("recover", "new").returncode == 0
        assert "3001 states follow" in command("verify", "new_recovered").stdout


ANEW = [
    ({"use_chunking": False}, "its messages are not in chunks; allowed: chunks, as `rosbags-convert"),
    ({"compression": CompressionType.LZ4}, "its chunks have the compression 'lz4'; allowed: zstd, or none, as"),
    ({"compression": CompressionType.NONE, "index_types": IndexType.NONE, "repeat_channels": False,
      "repeat_schemas": False, "use_statistics": False, "use_summary_offsets": False}, "3001 states follow"),
    ({"by_topic": True}, "3001 states follow"),
    *(({"late_ns": late_ns}, f": time {max(late_ns, 0)} ns in the bag, stamp {max(-late_ns, 0)} ns: another recorder"
       " wrote it; allowed: a bag") for late_ns in (21, 1_796_000_000 * 10**9, -10**6)),
]


@pytest.mark.parametrize(("options", "words"), ANEW, ids=["no chunks", "lz4", "no index", "topic by topic",
                                                         "late by 21 ns", "of a wall clock", "early by a tick"])
def test_a_bag_of_another_make_is_read_or_refused_and_not_called_damaged(
    two_runs: tuple[Path, Path], tmp_path: Path, command: Any, options: dict[str, Any], words: str
) -> None:
    rewritten(two_runs[0] / "bag" / "bag.mcap", tmp_path / "new.mcap", **options)
    found = command("verify", "new.mcap")
    assert words in found.stdout + found.stderr
    assert found.returncode == (2 if "allowed" in words else 0)
    if found.returncode:
        assert words.partition(";")[0] in command("recover", "new.mcap").stderr
    elif "by_topic" in options:
        assert command("recover", "new.mcap").returncode == 0
        assert words in command("verify", "new_recovered").stdout


def test_a_record_longer_than_any_of_a_bag_is_refused_and_left_out_of_a_new_bag(
    two_runs: tuple[Path, Path], tmp_path: Path, command: Any
) -> None:
    whole, attached = (two_runs[0] / "bag" / "bag.mcap").read_bytes(), 2**23 + 1
    long = HEAD.pack(Opcode.ATTACHMENT, attached) + bytes(attached)
    (tmp_path / "new.mcap").write_bytes(whole[:8] + long + whole[8:-8])  # without its end: no checksum of the file
    words = f"a record of {attached} bytes; allowed: at most {2**23}"
    assert f"{words}, as `rosbags-convert" in command("verify", "new.mcap").stderr
    recovered = command("recover", "new.mcap")
    assert recovered.returncode == 0
    assert words in recovered.stdout + recovered.stderr
    assert "3001 states follow" in command("verify", "new_recovered").stdout


@pytest.mark.parametrize(("without", "tick", "lost"), [
    ({"/lyapunov": 0}, 0, {"lyapunov": 3001}), ({"/lyapunov": 2_999_000_000}, 2999, {"lyapunov": 2}),
    ({"/joint_states": 2_990_000_000}, 3001, {"joint_states": 11})])
def test_what_does_not_follow_without_the_messages_that_a_bag_lacks_is_not_told(
    two_runs: tuple[Path, Path], tmp_path: Path, command: Any, without: dict[str, int], tick: int, lost: dict[str, int]
) -> None:
    rewritten(two_runs[0] / "bag" / "bag.mcap", tmp_path / "new.mcap", without=without)
    whole, found = (json.loads(command("inspect", str(path), "--json").stdout)
                    for path in (two_runs[0] / "bag", tmp_path / "new.mcap"))
    assert lost.items() <= found["missing"].items()
    assert found["contacts"] == whole["contacts"]
    assert found["balanced_ticks"] == min(tick, found["ticks"])
    assert (found["work_J"] is None) is ("lyapunov" in lost)
    verified = command("verify", "new.mcap")
    name, number = next(iter(lost.items()))
    assert (verified.returncode, f"the bag lacks {name} of {number} ticks" in verified.stdout) == (1, True)
    if "lyapunov" in lost:
        assert f"closes at {tick} of 3001 ticks, the others are not known" in command("inspect", "new.mcap").stdout


def test_the_directory_of_a_run_is_no_bag_and_says_where_it_is(two_runs: tuple[Path, Path], command: Any) -> None:
    found = command("inspect", str(two_runs[0]))
    assert found.returncode == 2
    assert found.stderr == f"grasp: {two_runs[0]}: the directory of a run; its bag is {two_runs[0] / 'bag'}\n"


def test_four_processes_and_one_record_the_same_bytes(two_runs: tuple[Path, Path]) -> None:
    first, second = (content(directory) for directory in two_runs)
    assert first == second
    assert len(first) == 7 * 3001 + 4  # and the scene, how it runs, two laws


def test_bag_holds_every_tick_of_every_topic(two_runs: tuple[Path, Path]) -> None:
    recording = bag.read(two_runs[0] / "bag")
    assert recording.missing == {topic.name: 0 for topic in (CLOCK, *recording.scene.topics)}
    assert recording.scene.values == scene.load("case_01", ["time.duration_s=3"]).values
    assert {"python", "numpy", "grasp_ros", "rclpy"} <= set(recording.versions)


def test_monitor_values_follow_from_the_recorded_states(two_runs: tuple[Path, Path]) -> None:
    recording = bag.read(two_runs[0] / "bag")
    level = recording.energy
    assert np.array_equal(recording.lyapunov[:, :4], np.stack([*level[:3], level.mode.astype(float)], axis=1))
    assert recording.closed
    alone = energy(recording.scene.system, recording.state, feedback=False)
    assert np.array_equal(recording.lyapunov[:, LYAPUNOV_NAMES.index("V_plant")], alone.V_c)
    work, rest = (recording.lyapunov[1:, LYAPUNOV_NAMES.index(name)] for name in ("work", "unexplained"))
    assert np.allclose(np.diff(alone.V_c), work + rest, rtol=0.0, atol=1e-12)
    assert (recording.lyapunov[:, 4] <= 1e-12).all()  # the energy balance closes
    assert recording.lyapunov[:, 4].sum() < -1.0  # what the impacts and dampers have taken
    assert not recording.lyapunov[:, 5].any()
    assert set(recording.lyapunov[:, 3]) == {0.0, 1.0, 2.0, 3.0}
    for side, force in zip(("left", "right"), impact_forces(grasp_of(recording.scene), recording.state), strict=True):
        assert np.array_equal(recording.outputs[f"contact/{side}"], force)
        assert force.max() > 10.0


def test_run_reports_and_draws(two_runs: tuple[Path, Path]) -> None:
    printed = (two_runs[0].parent / "stdout").read_text()
    for row in ("lost +nothing", "right controller +the scene's law", "verified +3001 states follow from the recorded",
                "same without ROS +equal, bit for bit"):
        assert re.search(f"^{row}", printed, re.M)
    assert (two_runs[0] / "figure.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["noise", "hammer", "no_contact", "rates", "everything", "friction_slide"])
def test_a_scene_with_effects_is_the_same_everywhere(tmp_path: Path, name: str) -> None:
    """Simulation, graph and bag; and nothing is there that the scene does not name.

    The last two in four processes, the others in one.
    """
    more = ["object_pulse.start_s=0.3", "left_actuator.limit_N=30"] if name == "everything" else []
    settings = ["time.duration_s=1.0", *more]
    one = name in ("noise", "hammer", "no_contact", "rates")
    graph = Graph(scene.load(name, settings), tmp_path / "run", ACCURACY, one_process=one)
    with started(graph) as statuses:
        graph.wait([])
    assert set(statuses.values()) == {0}
    recording = whole(graph.bag)
    simulated = simulate(recording.scene, sampled=True)
    for ours, own in ((recording.state, simulated.state), (recording.inputs, inputs := simulated.inputs),
                      (recording.command, simulated.command)):
        assert ours.tobytes() == own.tobytes()
    if more:  # a delay, a limit, and a pulse that all act
        assert inputs[0].tolist() == [0.0, 0.0, 0.0]
        assert (np.nanmax(np.abs(inputs[:, LEFT])), np.nanmax(inputs[:, OBJECT])) == (30.0, 30.0)
    assert not recording.lyapunov[:, 5].any()
    assert recording.lyapunov[:, 8].all()  # the laws are known
    assert not any(answers.differs for answers in answers_of(recording).values())
    assert {topic for topic, _, _ in content(tmp_path / "run")} == {
        "/scene", "/run", "/clock", *(f"/{topic.name}" for topic in recording.scene.topics),
        *(f"/{name.removesuffix('_controller')}/parameters" for name in recording.scene.controllers),
    }
    assert set(statuses) == ({"graph"} if one else {"plant", "monitor", *recording.scene.controllers})


def test_numbers_set_on_a_running_controller_are_recorded_and_replayed(tmp_path: Path, node: Any) -> None:
    peer, executor = node
    clients = {name: AsyncParameterClient(peer, name) for name in ("left_controller", "plant")}
    graph = Graph(scene.load("case_01", ["time.duration_s=100"]), tmp_path / "run", ACCURACY)  # stopped when asked

    def answer(name: str, number: Parameter) -> Any:
        future = clients[name].set_parameters([number])
        wait_for(lambda: executor.spin_once(timeout_sec=0.01) or future.done(), f"an answer of {name}")
        return future.result().results[0]

    with started(graph) as statuses:
        wait_for(clients["left_controller"].services_are_ready, "the controller")
        wait_for(clients["plant"].services_are_ready, "the plant")
        wait_for(lambda: graph.bag.exists(), "the bag")  # the controller has the scene when the monitor has it
        gain = "left_feedback.position_gain_N_per_m"
        wait_for(lambda: answer("left_controller", Parameter(gain, value=9)).successful, "the new gain")
        refused = answer("left_controller", Parameter(gain, value=-100.0))
        assert not refused.successful
        assert "a sum >= 0" in refused.reason
        fixed = answer("plant", Parameter("object.mass_kg", value=4.0))
        assert not fixed.successful
        assert "does not change in a run" in fixed.reason
        states: list[JointState] = []  # the nodes answer before the first tick, too
        peer.create_subscription(JointState, JOINT_STATES.name, states.append, messages.qos(JOINT_STATES))
        wait_for(lambda: executor.spin_once(timeout_sec=0.05) or len(states) > 100, "the ticks with the new gain")
    assert set(statuses.values()) == {0}
    recording = bag.read(graph.bag)
    assert list(recording.changes.values()) == [{gain: 9.0}]
    simulated = simulate(recording.scene, sampled=True, grid=recording.t, changes=recording.changes)
    assert recording.state.tobytes() == simulated.state.tobytes()
    assert verify(recording).same
    assert set(laws_of(recording).values()) == {"the scene's law"}
    tick = next(iter(recording.changes))
    x, v = recording.state[tick, :2]
    assert recording.command[tick, 0] == -9.0 * x - 0.5 * v
    assert not recording.lyapunov[:, 5].any()


def test_a_graph_that_ends_while_it_is_looked_at_is_no_failure(tmp_path: Path) -> None:
    graph = Graph(scene.load("case_01"), tmp_path / "run", ACCURACY)
    ended = subprocess.Popen([sys.executable, "-c", ""])
    os.waitid(os.P_PID, ended.pid, os.WEXITED | os.WNOWAIT)  # and nobody has asked for its status yet
    graph._see_whether_stopped("plant", ended)
    assert ended.wait(DEADLINE) == 0
