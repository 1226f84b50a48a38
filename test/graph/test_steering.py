"""Pause, resume, step and reset a running graph; its bag verifies; a bag is published again."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from graphs import call, rewritten, status, whole
from processes import DEADLINE, GRASP, START, children, ended, node_command, ran, wait_for
from rclpy.experimental import EventsExecutor
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from grasp_ros import scene
from grasp_ros.graph import bag
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


@pytest.fixture
def paused(grasp_run: Any, launch: Any) -> Callable[..., tuple[Any, Any, Callable[[str], str]]]:
    """Starts a run that waits at its first state: its process, a shell of `ctl`, and what asks it."""
    def call(*words: str) -> tuple[Any, Any, Callable[[str], str]]:
        run, shell = grasp_run(*words, "--paused", "--no-figure"), launch(*GRASP, "ctl", **PIPES)
        ask = partial(answer_of, shell)
        wait_for(lambda: "paused at tick 0 of" in ask("status"), "the first state")
        return run, shell, ask

    return call


def test_random_steering_leaves_a_bag_that_verifies(tmp_path: Path) -> None:
    """`python -m lab steering --calls 1000` makes more calls."""
    step = [*GRASP, "ctl", "step", "7"]
    with steering.steered(scene.load("case_01", ["time.duration_s=100"]), tmp_path / "run") as plant:
        done = steering.steer(plant, CALLS, SEED)
        assert {"pause done", "resume done", "resume refused", "step done", "step refused", "reset done"} <= set(done)
        said = ran(*step)
        assert (said.returncode, said.stderr) == (0, "")
        plant.tick += 7
        assert f"case_01: paused at tick {plant.tick} of 100000" in said.stdout
        plant.settle()
        plant.expect("resume")
        refused = ran(*step)
        assert (refused.returncode, refused.stdout) == (1, "")
        assert "not paused; allowed: step of a paused plant" in refused.stderr
        plant.tick = plant.expect("pause")["tick"]
        plant.settle()  # it is paused as soon as this tick is answered
    lengths = [*plant.lengths, plant.tick + 1]
    assert len(lengths) > 5
    assert steering.problems(tmp_path / "run" / "bag", lengths) == []
    lengths[2] += 1
    assert "first difference: run 2" in " ".join(steering.problems(tmp_path / "run" / "bag", lengths))
    assert bag.read(tmp_path / "run" / "bag").closed


def test_a_second_plant_gives_way_and_leaves_the_run_as_it_is(paused: Any, launch: Any) -> None:
    """Controllers took its scene, and kept it when it had ended; or the first plant ended, too."""
    run, shell, ask = paused("case_01", "--set", "time.duration_s=2")
    _, err = ended(launch(*node_command("plant", scene="case_04"), stderr=subprocess.PIPE), 1)
    assert "another plant publishes here" in err
    assert "running" in ask("resume")
    ended(shell)
    out, err = ended(run)
    assert "2001 states follow from the recorded inputs, bit for bit" in out
    assert re.search("same without ROS +equal, bit for bit", out)


@pytest.mark.parametrize("rate", [1.5, 100.0])  # the second is faster than any reader, and waits for it
def test_a_bag_is_published_again_with_its_clock(recorded: Path, node: Any, launch: Any, rate: float) -> None:
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


@pytest.mark.parametrize(("kind", "seconds"), [((), 0.0), (("--free-running",), 2.0)])
def test_a_plant_that_was_stepped_to_the_end_is_put_back_or_let_finish(
    paused: Any, kind: tuple[str, ...], seconds: float
) -> None:
    """Steps follow the wall clock where a run does: a controller may have a rate of its own."""
    run, shell, ask = paused("arm_alone", "--set", "time.duration_s=2", *kind)
    begin = time.monotonic()
    assert ask("step 2000").startswith("arm_alone: paused at tick 2000 of 2000")
    assert time.monotonic() - begin > seconds
    assert ask("reset").startswith("arm_alone: paused at tick 0 of 2000, t = 0 s, resets: 1")
    assert ask("step 2000").startswith("arm_alone: paused at tick 2000 of 2000")
    shell.communicate("resume\n", timeout=DEADLINE)
    assert "4002 states follow" in ended(run)[0]


def test_a_monitor_that_was_behind_has_all_commands_of_a_free_run(paused: Any, tmp_path: Path) -> None:
    run, shell, ask = paused("arm_alone", "--set", "time.duration_s=0.45", "--free-running")
    assert ask("step 1").startswith("arm_alone: paused at tick 1 of")  # it has begun: the monitor has had a command
    monitor = children(tmp_path)["monitor"]
    os.kill(monitor, signal.SIGSTOP)
    assert ask("step 448").startswith("arm_alone: paused at tick 449 of 450")  # at the last one the plant waits for it
    shell.communicate("resume\n", timeout=DEADLINE)
    os.kill(monitor, signal.SIGCONT)
    assert "451 states follow" in ended(run)[0]


def test_resets_in_a_row_lose_nothing_of_a_free_run(paused: Any, tmp_path: Path) -> None:
    run, shell, ask = paused("case_01", "--set", "time.duration_s=0.2", "--free-running")
    for number in range(1, 9):
        assert ask("step 5").startswith("case_01: paused at tick 5")
        assert ask("reset").startswith(f"case_01: paused at tick 0 of 200, t = 0 s, resets: {number}")
    shell.communicate("resume\n", timeout=DEADLINE)
    ended(run)
    assert whole(tmp_path / "run" / "bag").closed


def test_a_bag_of_another_program_is_published_from_its_first_message_on_or_refused(
    recorded: Path, tmp_path: Path
) -> None:
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
    launch(*node_command("plant", scene="arm_alone", paused="true"), stderr=subprocess.DEVNULL)
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


def test_a_pause_ends_a_step_that_goes_on(node: Any, launch: Any) -> None:
    launch(*node_command("plant", scene="arm_alone", paused="true", steps=15000), stderr=subprocess.DEVNULL)
    launch(*START, "left_controller", stderr=subprocess.DEVNULL)
    begun = json.loads(call("step", node).message)
    assert (begun["goal"]["tick"], begun["asked"]) == (15000, 15000)
    wait_for(lambda: status(node)["tick"] > 10, "some steps")
    answer = call("pause", node)
    found = [json.loads(answer.message), status(node)]
    assert answer.success
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


def test_where_nobody_answers_ctl_and_watch_say_so(launch: Any) -> None:
    """All at once: each waits for long. None needs a home directory."""
    here = f"in ROS domain {os.environ['ROS_DOMAIN_ID']}, namespace /nowhere, on this host"
    asked = {"ctl status": f"no plant answers {here}", "ctl get nobody steps": f"no nobody answers {here}",
             "ctl echo nothing": f"nobody publishes /nowhere/nothing {here}",
             "watch": f"no plant has come for 10 s {here}"}
    homeless = {**os.environ, "HOME": "/proc/nowhere"}
    waiting = [launch(*GRASP, *words.split(), "--namespace", "/nowhere", env=homeless, **PIPES) for words in asked]
    for process, said in zip(waiting, asked.values(), strict=True):
        out, err = ended(process, 1)
        assert said in err
        assert out in ("", f"waiting for a plant {here}")


def test_an_answer_that_is_no_plants_is_named(node: Any, launch: Any) -> None:
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


def test_what_a_reset_has_made_impossible_is_waited_for_no_longer(node: Any, launch: Any) -> None:
    words = {"state": "running", "tick": 1, "ticks": 2, "time_s": 0.0, "scene": "S", "resets": 0}

    def answer(name: str, _: Any, response: Trigger.Response) -> Trigger.Response:
        found = words | ({"goal": {"state": "paused"}} if name == "pause" else {})
        words["resets"] = int(name == "pause")
        response.success, response.message = True, json.dumps(found)
        return response

    for name in ("pause", "status"):
        node[0].create_service(Trigger, f"plant/{name}", partial(answer, name))
    asks = launch(*GRASP, "ctl", "pause", **PIPES)
    wait_for(lambda: node[1].spin_once(timeout_sec=0.05) is None and asks.poll() is not None, "an answer")
    said = "somebody else has reset the plant meanwhile; S: running at tick 1 of 2, t = 0 s, resets: 1\n"
    assert (asks.communicate()[1], asks.returncode) == (said, 1)


def test_a_question_whose_answer_is_lost_is_asked_again_and_what_acts_is_asked_once(node: Any, launch: Any) -> None:
    asked: list[str] = []

    def answer(name: str, _: Any, response: Trigger.Response) -> Trigger.Response:
        asked.append(name)
        if asked == ["status"]:
            raise ConnectionError  # nobody is answered
        words = {"state": "paused", "tick": 1, "ticks": 2, "time_s": 0.0, "scene": "S", "resets": 0}
        response.success, response.message = True, json.dumps(words)
        return response

    for name in ("pause", "status"):
        node[0].create_service(Trigger, f"plant/{name}", partial(answer, name))
    asks = launch(*GRASP, "ctl", "pause", **PIPES)

    def ended_by() -> bool:
        with suppress(ConnectionError):
            node[1].spin_once(timeout_sec=0.05)
        return asks.poll() is not None

    wait_for(ended_by, "an answer")
    assert asks.communicate()[0] == "S: paused at tick 1 of 2, t = 0 s, resets: 0\n"
    assert asked == ["status", "status", "pause"]
