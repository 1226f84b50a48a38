"""Pause, resume, step and reset a running graph; its bag verifies; a bag is published again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import call, rewritten
from processes import DEADLINE, GRASP, START, children, ran, wait_for
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from grasp_ros import scene
from grasp_ros.graph import bag
from grasp_ros.graph.bag.verify import verify
from grasp_ros.graph.ros import messages
from grasp_ros.graph.serialization import raw_stamp_ns
from grasp_ros.scene.topics import JOINT_STATES
from lab.drills import steering

pytestmark = pytest.mark.slow  # real processes
SEED, CALLS = 13, 40
PIPES = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)


def answer_of(shell: Any, words: str) -> str:
    """What a shell of `ctl` says to a line."""
    shell.stdin.write(f"{words}\n")
    shell.stdin.flush()
    return str(shell.stdout.readline())


@pytest.fixture(scope="module")
def steered(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[int]]:
    """A run that was steered at random: its directory, and the states that its bag must have from each beginning on."""
    directory = tmp_path_factory.mktemp("steered") / "run"
    with steering.steered(scene.load("case_01", ["time.duration_s=100"]), directory) as plant:
        done = steering.steer(plant, CALLS, SEED)
        assert {"pause done", "resume done", "resume refused", "step done", "step refused", "reset done"} <= set(done)
        command = [*GRASP, "ctl", "step", "7"]
        said = ran(*command)
        assert (said.returncode, said.stderr) == (0, "")
        plant.tick += 7
        assert f"case_01: paused at tick {plant.tick} of 100000" in said.stdout
        plant.settle()
        plant.expect("resume")
        refused = ran(*command)
        assert (refused.returncode, refused.stdout) == (1, "")
        assert "not paused; allowed: step of a paused plant" in refused.stderr
        plant.tick = plant.expect("pause")["tick"]
        plant.settle()  # it is paused as soon as this tick is answered
    return directory, [*plant.lengths, plant.tick + 1]


@pytest.mark.thorough
def test_random_steering_leaves_a_bag_that_verifies(steered: tuple[Path, list[int]]) -> None:
    """`python -m lab steering --calls 1000` makes more calls."""
    directory, lengths = steered
    assert len(lengths) > 5
    assert steering.problems(directory / "bag", lengths) == []
    lengths[2] += 1
    assert "first difference: run 2" in " ".join(steering.problems(directory / "bag", lengths))
    assert bag.read(directory / "bag").closed


def test_one_flipped_bit_in_a_bag_is_found_and_named(steered: tuple[Path, list[int]]) -> None:
    recording = bag.read(steered[0] / "bag")
    row, state = int(recording.starts[1]) - 2, recording.state.copy()
    state[row].view(np.int64)[4] ^= 1
    (x, other), tick = (float(states[row, 4]) for states in (recording.state, state)), recording.tick[row]
    words = f"joint_states, right position: recorded {other!r} ({other.hex()}), computed {x!r} ({x.hex()})"
    assert verify(replace(recording, state=state)).words == f"NOT EQUAL, first at tick {tick}, {words}"


@pytest.mark.parametrize("rate", [1.5, 100.0])  # the second is faster than any reader, and waits for it
def test_a_bag_is_published_again_with_its_clock(
    recorded: Path, node: tuple[Any, SingleThreadedExecutor], launch: Any, rate: float
) -> None:
    peer, slow = node
    slow.remove_node(peer)
    seen: dict[str, list[int]] = {"states": [], "clock": []}
    for kind, name, rows in ((JointState, "joint_states", seen["states"]), (Clock, "/clock", seen["clock"])):
        note = partial(lambda rows, cdr: rows.append(raw_stamp_ns(cdr)), rows)
        peer.create_subscription(kind, name, note, messages.qos(JOINT_STATES), raw=True)
    executor = EventsExecutor(context=peer.context)
    executor.add_node(peer)  # which has all its readers: a new one may be missed
    player = launch(*GRASP, "replay", str(recorded), "--rate", str(rate))
    begin = time.monotonic()
    while player.poll() is None:
        assert time.monotonic() < begin + DEADLINE
        executor.spin_once(timeout_sec=0.05)
    assert time.monotonic() - begin > 1.5 / rate
    assert player.returncode == 0
    last = time.monotonic()
    while time.monotonic() < last + 0.5:  # what is still on its way
        executor.spin_once(timeout_sec=0.05)
    executor.shutdown()
    for name, rows in seen.items():
        assert rows == [tick * 1_000_000 for tick in range(3001)], name


@pytest.mark.parametrize(("kind", "seconds"), [((), 0.0), (("--free-running",), 4.0)])
def test_a_plant_that_was_stepped_to_the_end_is_put_back_or_let_finish(
    grasp_run: Any, launch: Any, kind: tuple[str, ...], seconds: float
) -> None:
    """The monitor closed its bag at the last tick, and lost a free run's steps, which did not wait for it.

    Steps follow the wall clock where a run does: commands of a controller at a rate of its own timed out.
    """
    run = grasp_run("arm_alone", "--set", "time.duration_s=4", "--paused", "--no-figure", *kind)
    shell = launch(*GRASP, "ctl", **PIPES)
    ask = partial(answer_of, shell)
    wait_for(lambda: "paused at tick 0 of" in ask("status"), "the first state")
    begin = time.monotonic()
    assert ask("step 4000").startswith("arm_alone: paused at tick 4000 of 4000")
    assert time.monotonic() - begin > seconds
    assert ask("reset").startswith("arm_alone: paused at tick 0 of 4000, t = 0 s, resets: 1")
    assert ask("step 4000").startswith("arm_alone: paused at tick 4000 of 4000")
    shell.communicate("resume\n", timeout=DEADLINE)
    out, err = run.communicate(timeout=DEADLINE)
    assert (run.returncode, "8002 states follow" in out) == (0, True), out + err


def test_a_monitor_that_was_behind_has_all_commands_of_a_free_run(
    grasp_run: Any, launch: Any, tmp_path: Path
) -> None:
    """It took the last hundred that waited when the plant had ended: others that had acted were not in the bag."""
    run = grasp_run("arm_alone", "--set", "time.duration_s=0.45", "--paused", "--no-figure", "--free-running")
    shell = launch(*GRASP, "ctl", **PIPES)
    ask = partial(answer_of, shell)
    wait_for(lambda: "paused at tick 0 of" in ask("status"), "the first state")
    assert ask("step 1").startswith("arm_alone: paused at tick 1 of")  # it has begun: the monitor has had a command
    monitor = children(tmp_path)["monitor"]
    os.kill(monitor, signal.SIGSTOP)
    assert ask("step 448").startswith("arm_alone: paused at tick 449 of 450")  # at the last one the plant waits for it
    shell.communicate("resume\n", timeout=DEADLINE)
    os.kill(monitor, signal.SIGCONT)
    out, err = run.communicate(timeout=DEADLINE)
    assert (run.returncode, "451 states follow" in out) == (0, True), out + err


def test_resets_in_a_row_lose_nothing_of_a_free_run(grasp_run: Any, launch: Any, tmp_path: Path) -> None:
    """A monitor took what came after a reset for what came before: contact forces and laws were missing."""
    run = grasp_run("case_01", "--set", "time.duration_s=0.2", "--paused", "--no-figure", "--free-running")
    shell = launch(*GRASP, "ctl", **PIPES)
    ask = partial(answer_of, shell)
    wait_for(lambda: "paused at tick 0 of" in ask("status"), "the first state")
    for number in range(1, 9):
        assert ask("step 5").startswith("case_01: paused at tick 5")
        assert ask("reset").startswith(f"case_01: paused at tick 0 of 200, t = 0 s, resets: {number}")
    shell.communicate("resume\n", timeout=DEADLINE)
    out, err = run.communicate(timeout=DEADLINE)
    assert run.returncode == 0, out + err
    recording = bag.read(tmp_path / "run" / "bag")
    assert not any(recording.missing.values())
    assert recording.closed


def test_a_bag_of_another_program_is_published_from_its_first_message_on_or_refused(
    recorded: Path, tmp_path: Path
) -> None:
    """A foreign topic ended in a traceback, times of a wall clock in a wait without end."""
    [file] = recorded.glob("*.mcap")
    for name, options in (("beside", {"beside": "/theirs"}), ("wall", {"late_ns": 1_800_000_000 * 10**9})):
        rewritten(file, tmp_path / f"{name}.mcap", **options)
    refused = ran(*GRASP, "replay", str(tmp_path / "beside.mcap"))
    assert refused.returncode == 2
    assert "/theirs: std_msgs/msg/String is not a topic of its scene" in refused.stderr
    assert ran(*GRASP, "replay", str(tmp_path / "wall.mcap"), "--rate", "20").returncode == 0


def test_a_bag_is_not_published_beside_another_one(recorded: Path, launch: Any, command: Any) -> None:
    """Nor beside a graph, which holds the same place; both would lose their states to each other."""
    words = ("replay", str(recorded))
    player = launch(*GRASP, *words)
    wait_for(lambda: b"player" in Path(f"/proc/{player.pid}/cmdline").read_bytes(), "the first one")
    found = command(*words)
    assert (found.returncode, found.stdout) == (2, "")
    assert "grasp: a graph or a replay already runs in ROS domain" in found.stderr


def test_a_shell_steers_asks_and_sets(tmp_path: Path, launch: Any) -> None:
    """Over one node, so that discovery is paid for once."""
    plant = [*START, "plant", "--ros-args", "-p", "scene:=arm_alone", "-p", "paused:=true"]
    launch(*plant, stderr=subprocess.DEVNULL)
    launch(*START, "left_controller", stderr=subprocess.DEVNULL)
    shell = launch(*GRASP, "ctl", **PIPES)
    ask = partial(answer_of, shell)
    wait_for(lambda: "paused at tick 0 of" in ask("status"), "the first state")
    assert ask("step 7").startswith("arm_alone: paused at tick 7 of")
    gain = "left_feedback.position_gain_N_per_m"
    assert ask(f"set left_controller {gain} 9") == ask(f"get left_controller {gain}") == f"{gain}: 9.0\n"
    assert ask("reset").startswith("arm_alone: paused at tick 0 of")
    assert ask("resume").startswith("arm_alone: running at tick")
    message = json.loads(ask("echo joint_states 1"))
    assert message["name"] == ["left"]
    assert "One arm by itself" in ask("echo scene 1")  # said before this reader came
    refused = ["set plant steps 0", f"set plant steps {10 ** 20}", f"set plant steps [{10 ** 20}]", f"step {2 ** 63}",
               "set plant steps [1,a]", "step",  # while it is there
               f"step {10 ** 20 - 1}", "echo a//b", "get a!b", 'get ""', "pause now", "nonsense",
               "step x", "step 0",
               "set left_controller law x", f"set left_controller {gain} -100",
               "set left_controller left_feedback.position_gain 9"]
    _, err = shell.communicate("\n".join([*refused, "help"]), timeout=DEADLINE)
    for words in ("steps", "not paused; allowed: step", "pause now: not allowed; allowed: pause, resume, step [N]",
                  "nonsense: not allowed", "step x: not allowed; allowed: a whole number >= 1",
                  "step 0: not allowed; allowed: a whole number >= 1", "law: set at the start only",
                  f"steps: {10 ** 20 - 1} is not allowed", "must not contain repeated", "Invalid service name",
                  f"steps: {10 ** 20} is not allowed", "steps: [1, 'a'] is not allowed",
                  f"steps: [{10 ** 20}] is not allowed",
                  "allowed: a sum >= 0",
                  "left_feedback.position_gain: no such parameter; did you mean " + gain):
        assert words in err
    assert shell.returncode == 2  # that of the worst line, which nobody takes; of one that fails it is 1


def test_a_pause_ends_a_step_that_goes_on(node: tuple[Any, SingleThreadedExecutor], launch: Any) -> None:
    """It said "already paused", and the plant went on."""
    plant = [*START, "plant", "--ros-args", "-p", "scene:=arm_alone", "-p", "paused:=true", "-p", "steps:=15000"]
    launch(*plant, stderr=subprocess.DEVNULL)
    launch(*START, "left_controller", stderr=subprocess.DEVNULL)
    begun = json.loads(call("step", node).message)
    assert (begun["goal"]["tick"], begun["asked"]) == (15000, 15000)
    wait_for(lambda: json.loads(call("status", node).message)["tick"] > 10, "some steps")
    paused = call("pause", node)
    found = [json.loads(answer.message) for answer in (paused, call("status", node))]
    assert paused.success
    assert [(own["state"], own["steps"], own["tick"]) for own in found] == [("paused", 0, found[0]["tick"])] * 2
    assert found[0]["tick"] < 15000


@pytest.mark.parametrize("words", ["yes help | head -n 5000 | {} | head -n 1", "{} <&-"])
def test_a_shell_ends_with_its_reader_and_without_an_input(words: str) -> None:
    command = "set -o pipefail; " + words.format(f"{sys.executable} -m grasp_ros.cli ctl")
    found = ran("bash", "-c", command)
    assert (found.returncode in (0, 141), found.stderr) == (True, "")  # 141: `yes`, which nobody reads any more


def test_a_shell_whose_reader_has_left_has_the_status_of_its_worst_line() -> None:
    words = f"printf 'nonsense\\nhelp\\n' | {sys.executable} -m grasp_ros.cli ctl | true; exit ${{PIPESTATUS[1]}}"
    found = ran("bash", "-c", words)
    assert (found.returncode, found.stderr.startswith("nonsense: not allowed")) == (2, True)


def test_a_shell_that_waits_for_words_ends_with_a_signal(launch: Any) -> None:
    shell = launch(*GRASP, "ctl", **PIPES)
    shell.stdin.write("nonsense\nhelp\n")
    shell.stdin.flush()
    assert shell.stdout.readline().startswith("pause, resume")
    shell.send_signal(signal.SIGINT)
    assert shell.wait(DEADLINE) == 130
    out, err = shell.communicate()
    assert (out, err.count("\n")) == ("", 1)


def test_an_output_that_is_full_is_a_sentence() -> None:
    command = f"{sys.executable} -m grasp_ros.cli ctl help >/dev/full"
    found = ran("bash", "-c", command)
    assert (found.returncode, found.stderr) == (1, "standard input or output: No space left on device\n")


def test_a_graph_runs_without_any_standard_stream(tmp_path: Path) -> None:
    command = f"{sys.executable} -m grasp_ros.cli run case_02 --set time.duration_s=0.2 --no-figure -o run <&- >&- 2>&-"
    subprocess.run(["bash", "-c", command], cwd=tmp_path, timeout=2 * DEADLINE, check=True)
    assert len(bag.read(tmp_path / "run" / "bag").t) == 201


def test_where_nobody_answers_ctl_says_so(launch: Any) -> None:
    """All at once: each waits for long."""
    asked = {"status": "no plant answers in ROS domain", "get nobody steps": "no nobody answers in ROS domain",
             "echo nothing": "nobody publishes /nowhere/nothing"}
    waiting = [launch(*GRASP, "ctl", *words.split(), "--namespace", "/nowhere", **PIPES) for words in asked]
    for process, said in zip(waiting, asked.values(), strict=True):
        out, err = process.communicate(timeout=DEADLINE)
        assert (process.returncode, out, said in err) == (1, "", True), err


def test_an_answer_that_is_no_plants_is_named(node: tuple[Any, SingleThreadedExecutor], launch: Any) -> None:
    def answer(_: Any, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = True, "hello"
        return response

    node[0].create_service(Trigger, "plant/status", answer)
    asks = launch(*GRASP, "ctl", "status", **PIPES)
    wait_for(lambda: node[1].spin_once(timeout_sec=0.05) is None and asks.poll() is not None, "an answer")
    assert (asks.communicate()[1], asks.returncode) == ("plant/status: 'hello' is no answer of a plant\n", 1)


def test_a_number_of_steps_that_no_plant_can_do_is_refused() -> None:
    found = ran(*GRASP, "ctl", "step", "1" * 5000)
    assert found.returncode == 2
    assert found.stderr.startswith("step 1111")
    assert found.stderr.endswith("1: not allowed; allowed: a whole number >= 1\n")
