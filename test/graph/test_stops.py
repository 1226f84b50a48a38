"""How a graph and its nodes end: signals, a plant that is gone, an energy balance that does not close."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import rclpy
from graphs import call, started, status, whole
from processes import DEADLINE, GRASP, START, children, ended, growing, node_command, ran, wait_for, write_law

from grasp_ros import scene
from grasp_ros.cli.graph import _report
from grasp_ros.graph import bag
from grasp_ros.graph.processes import Graph
from grasp_ros.graph.ros.node import ACKNOWLEDGE_SECONDS
from grasp_ros.graph.stopping import STOP_SIGNALS
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.scene.topics import LYAPUNOV_NAMES
from grasp_ros.simulation import simulate
from lab.drills import recorder

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("number", "moment"),
    [(signal.SIGINT, "recording"), pytest.param(signal.SIGHUP, "recording", marks=pytest.mark.thorough),
     (signal.SIGTERM, "starting"), pytest.param(signal.SIGQUIT, "starting", marks=pytest.mark.thorough),
     (signal.SIGINT, "waiting")],
)
def test_interrupted_run_ends_cleanly(grasp_run: Any, tmp_path: Path, number: signal.Signals, moment: str) -> None:
    process = grasp_run("case_01", *(["--without", "left_controller"] if moment == "waiting" else []))
    if moment in ("recording", "waiting"):  # for somebody else: there is a bag, without a tick
        growing(tmp_path / "run" / "bag", 200_000 if moment == "recording" else 0)
    else:
        wait_for(lambda: (tmp_path / "run" / "case_01.yaml").exists(), "the first process")
    process.send_signal(number)
    out, _ = ended(process, 0 if moment == "recording" else 130)
    if moment == "recording":
        assert "not verified and not drawn; `grasp verify` and `grasp plot` run/bag" in out
        recording = whole(tmp_path / "run" / "bag")
        ticks = len(recording.tick)
        assert 100 < ticks < 20001
        full = simulate(scene.load("case_01"), sampled=True)
        assert full.state[:ticks].tobytes() == recording.state.tobytes()
    assert not children(tmp_path)


def test_a_monitor_that_is_behind_records_all_that_came_before_a_signal(tmp_path: Path, node: Any) -> None:
    case, patient = scene.load("case_01", ["time.duration_s=100"]), {"peer_timeout_s": DEADLINE}
    graph = Graph(case, tmp_path / "run", ACCURACY, plant=patient)
    with started(graph):
        wait_for(lambda: status(node)["tick"] > 100, "ticks")
        before = status(node)["tick"]
        graph.processes["monitor"].send_signal(signal.SIGSTOP)  # until the end, which lets it go on
        wait_for(lambda: status(node)["tick"] > before + 100, "a plant that is ahead")
        assert call("pause", node).success
        wait_for(lambda: status(node)["state"] == "paused", "a pause")
        tick = status(node)["tick"]
    assert len(whole(tmp_path / "run" / "bag").tick) >= tick  # DDS may need more than a second for the last


def test_a_reader_that_was_killed_keeps_no_node_for_long(tmp_path: Path, node: Any) -> None:
    """It acknowledges nothing, and DDS lists it for 20 s."""
    graph = Graph(scene.load("case_01", ["time.duration_s=100"]), tmp_path / "run", ACCURACY)
    with started(graph):
        wait_for(lambda: status(node)["tick"] > 100, "ticks")
        graph.processes["left_controller"].kill()
        begin = time.monotonic()
    assert time.monotonic() - begin < ACKNOWLEDGE_SECONDS


def test_an_interrupted_check_says_where_the_bag_is(grasp_run: Any, tmp_path: Path) -> None:
    process, whole = grasp_run("case_01", "--one-process"), tmp_path / "run" / "bag" / "metadata.yaml"
    wait_for(lambda: whole.exists() and not children(tmp_path), "the end of the run")
    time.sleep(0.3)  # of two seconds for reading, check and figure
    process.send_signal(signal.SIGINT)
    _, err = ended(process, 130)
    assert err.splitlines()[-1] == ("grasp: interrupted; run/bag was not checked to the end and not drawn;"
                                    " `grasp verify` and `grasp plot` do that")
    assert len(bag.read(tmp_path / "run" / "bag").tick) == 20001


@pytest.mark.parametrize("numbers", [
    pytest.param(STOP_SIGNALS, id="one way"),
    pytest.param(STOP_SIGNALS[::-1], id="the other way", marks=pytest.mark.thorough),
])
def test_lonely_nodes_end_cleanly_on_a_signal(launch: Any, tmp_path: Path, numbers: tuple[signal.Signals, ...]) -> None:
    """All four at the same time, each in a domain of its own."""
    domains = {"plant": 120, "left_controller": 121, "right_controller": 122, "monitor": 123}
    started = {
        name: launch(*START, name, cwd=tmp_path, stderr=subprocess.PIPE,
                     env={**os.environ, "ROS_DOMAIN_ID": str(domain)})
        for name, domain in domains.items()
    }
    for (name, process), number in zip(started.items(), numbers, strict=True):
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domains[name])
        observer = rclpy.create_node("observer", context=context)
        wait_for(lambda observer=observer, name=name: name in observer.get_node_names(), name)
        process.send_signal(number)
        ended(process)
        observer.destroy_node()
        context.shutdown()


WRONG_PLANT = """
import sys
from grasp_ros.graph import __main__ as start
from grasp_ros.graph.health import peers
from grasp_ros.simulation.sampled_plant import SampledPlant
step = SampledPlant.step
def push_harder(plant, commands):
    step(plant, 1.5 * commands)
    plant.effort = commands
SampledPlant.step = push_harder
peers.LOOK_SECONDS = 0.9  # the monitor ends before the next look
sys.exit(start.main("plant"))
"""


STUCK = """
import ctypes
from grasp_ros.graph import stopping

stopping.GRACE_SECONDS = 0.5
stopping.note_signals([])
stopping.end_late_by_force("left_controller", [])
print("there", flush=True)
{}
"""
HELD = {
    "a law that does not return": "while True:\n    pass",
    "a lock that is never free": "lock = ctypes.create_string_buffer(256)\n"
                                 "while True:\n    ctypes.CDLL(None).pthread_mutex_lock(lock)",
}


@pytest.mark.parametrize("held", HELD)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_cannot_end_is_ended_by_force(launch: Any, held: str, number: signal.Signals) -> None:
    process = launch(sys.executable, "-c", STUCK.format(HELD[held]), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline() == "there\n"
    process.send_signal(number)
    assert ended(process, 1)[1] == "left_controller: has not ended within 0.5 s: ended by force\n"


HANGING_END = """
import sys, threading
from rclpy.context import Context
from grasp_ros.graph import __main__ as start, stopping
stopping.GRACE_SECONDS = 0.5
Context.try_shutdown = lambda _: threading.Event().wait()
sys.exit(start.main("plant"))
"""


@pytest.mark.parametrize(("name", "status"), [("none", 2), ("case_01", 0)])
def test_a_finished_node_keeps_its_status_where_dds_does_not_end(launch: Any, name: str, status: int) -> None:
    numbers = {"scene": name, "free_running": "true", "real_time_factor": "10.0", "time.duration_s": "0.1"}
    words = node_command("plant", **numbers)[len(START) + 1 :]
    process = launch(sys.executable, "-c", HANGING_END, *words, stderr=subprocess.PIPE)
    assert ended(process, status)[1].endswith("plant: has not ended within 0.5 s: ended by force\n")


def test_a_second_signal_writes_to_no_file(tmp_path: Path) -> None:
    """Python writes the numbers of signals to a descriptor, which must stay ours after the first one."""
    script = """
import os, signal, sys, threading, time
from grasp_ros.graph.stopping import end_late_by_force, note_signals
received = []
note_signals(received)
end_late_by_force("node", [])
signal.raise_signal(signal.SIGINT)
last = time.monotonic() + 8.0
while not any(thread.name == "end" for thread in threading.enumerate()) and time.monotonic() < last:
    pass
files = [open(f"{sys.argv[1]}/{number}", "wb") for number in range(8)]
signal.raise_signal(signal.SIGINT)
os._exit(len(received))
"""
    found = ran(sys.executable, "-c", script, str(tmp_path))
    assert (found.returncode, found.stderr) == (2, "")
    assert [path.stat().st_size for path in tmp_path.iterdir()] == [0] * 8


def test_a_signal_of_a_law_ends_no_node() -> None:
    """Such as that of a timer; Python tells of all. Its reactions to ours hide them not."""
    script = """
import signal
from grasp_ros.graph import stopping
ends, received = [], []
stopping.end_by_force = ends.append
stopping.end_late_by_force("node", received)
for number in (signal.SIGALRM, signal.SIGINT):
    signal.signal(number, lambda *_: None)
    signal.raise_signal(number)
while not ends:
    pass
print(ends, received)
"""
    found = ran(sys.executable, "-c", script)
    assert found.stdout == "['node'] [2]\n"


def test_a_thread_that_a_law_has_left_keeps_no_node() -> None:
    words = "import sys, threading; from grasp_ros.graph import __main__, stopping; stopping.GRACE_SECONDS = 0.5;" \
        "threading.Thread(target=threading.Event().wait).start(); sys.exit(__main__.start())"
    found = ran(sys.executable, "-c", words, "plant", "--ros-args", "-p", "scene:=nowhere")
    assert found.returncode == 2
    words = r"plant: has not ended within 0\.5 s, kept by Thread-\d+ \(wait\): ended by force\n$"
    assert re.search(words, found.stderr), found.stderr


def test_a_process_that_a_law_has_left_ends_with_its_node(tmp_path: Path) -> None:
    (tmp_path / "laws.py").write_text(
        "import subprocess\nleft = subprocess.Popen(['sleep', '3600'])\n"
        "open('left', 'a').write(f'{left.pid} ')\nlaw = lambda tick, time, x, v: -x - v\n"
    )
    words = ["run", "arm_alone", "--set", "time.duration_s=0.1", "--controller", "left=laws:law", "--no-figure"]
    found = ran(*GRASP, *words, "-o", "run", cwd=tmp_path)
    assert found.returncode == 0
    [left] = (tmp_path / "left").read_text().split()
    assert "sleep" not in ran("cat", f"/proc/{left}/cmdline").stdout  # which is empty, or gone


@pytest.mark.parametrize(
    ("line", "options", "words"),
    [
        ("sys.exit(0)", [], r"left_controller: law: mine:law: SystemExit: 0, .*mine.py, line 4, at tick 50"),
        ("1 / 0", ["--one-process"], r"left_controller: law: mine:law: ZeroDivisionError: .*, line 4, at tick 50"),
        pytest.param("sys.exit(0)", ["--one-process"],
                     r"left_controller: law: mine:law: SystemExit: 0, .*, line 4, at tick 50",
                     marks=pytest.mark.thorough),
        ("os._exit(0)", [], r"left_controller: ended with exit status 0 before the run was over"),
        ("os._exit(0)", ["--one-process"], r"graph: ended with exit status 0 before the run was over"),
    ],
)
def test_a_law_that_ends_its_process_has_ended_no_run(
    grasp_run: Any, tmp_path: Path, line: str, options: list[str], words: str
) -> None:
    write_law(tmp_path, "if tick == 50:", f"    {line}")
    process = grasp_run("arm_alone", "--controller", "left=mine:law", *options)
    out, err = ended(process, 1)
    assert not out
    assert re.search(rf"^grasp: {words}(; run/bag has what was recorded)?$", err, re.M), err
    assert "_exit" in line or len(bag.read(tmp_path / "run" / "bag").tick) == 50


@pytest.mark.parametrize(("tick", "options"), [
    (-1, []), (0, ["--one-process"]), pytest.param(-1, ["--one-process"], marks=pytest.mark.thorough),
    pytest.param(0, [], marks=pytest.mark.thorough),
], ids=lambda value: {-1: "import", 0: "first answer"}.get(value) if isinstance(value, int) else None)
def test_a_law_that_is_a_node_itself_disturbs_no_end(
    grasp_run: Any, tmp_path: Path, tick: int, options: list[str]
) -> None:
    """`rclpy.init` sets signal handlers that would end all contexts of the process."""
    write_law(tmp_path, f"if tick == {tick}:", "    import rclpy", "    rclpy.init()",
              "    seen.append(rclpy.create_node('mine'))")
    with (tmp_path / "mine.py").open("a") as file:
        file.write("law(-1, 0.0, 0.0, 0.0)\n")
    process = grasp_run("arm_alone", "--controller", "left=mine:law", *options)
    growing(tmp_path / "run" / "bag")
    process.send_signal(signal.SIGINT)
    out, err = ended(process)
    assert "a fault" not in err
    assert "interrupted" in out


def test_a_monitor_without_a_plant_leaves_nothing(tmp_path: Path) -> None:
    """It has looked whether its bag can be written; `grasp run` would take a directory for the begin of the bag."""
    numbers = {"bag": "new/bag", "peer_timeout_s": "0.1", "start_timeout_s": "0.1", "on_silence": "end"}
    found = ran(*node_command("monitor", **numbers), cwd=tmp_path)
    assert "timeout of 0.1 s" in found.stderr
    assert not [*tmp_path.iterdir()]


def test_an_interrupted_run_whose_bag_cannot_be_closed_says_so(grasp_run: Any, tmp_path: Path) -> None:
    process = grasp_run("arm_alone")
    (growing(tmp_path / "run" / "bag").parent / "metadata.part").mkdir()  # where its metadata are written first
    process.send_signal(signal.SIGINT)
    out, err = ended(process, 1)
    assert not out
    assert re.search(r"\[monitor\]: .*run/bag: cannot be written: Is a directory\n", err)
    assert err.endswith("grasp: run/bag: was not closed; run/bag has what was recorded\n")


def test_a_bag_that_cannot_be_closed_is_a_sentence(launch: Any, tmp_path: Path) -> None:
    """No tick comes that would say it earlier."""
    names = {"monitor": ["bag:=bag"], "plant": ["scene:=arm_alone", "-p", "paused:=true"]}
    nodes = [launch(*START, name, "--ros-args", "-p", *words, cwd=tmp_path, stderr=subprocess.PIPE)
             for name, words in names.items()]
    assert any("recording" in line for line in nodes[0].stderr)
    shutil.rmtree(tmp_path / "bag")
    for node in nodes:
        node.send_signal(signal.SIGINT)
    _, err = ended(nodes[0], 1)
    nodes[1].communicate(timeout=DEADLINE)
    assert re.search(r"\[monitor\]: bag: (was deleted during the recording|cannot be written: No such file.*)\n$", err)


def test_a_bag_that_ends_before_its_scene_is_no_success(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whatever lets a run end early without a word: the report looks at the ticks."""
    case = scene.load("arm_alone", ["time.duration_s=0.2"])
    half = simulate(case.changed({"time.duration_s": 0.1}), sampled=True)
    recorder.write(tmp_path / "bag", replace(half, scene=case))
    quiet = Namespace(max_age=None, min_factor=None, no_check=True, no_figure=True)
    assert _report(Graph(case, tmp_path, ACCURACY), False, [(0.0, "begin")], quiet) == 1
    assert capsys.readouterr().err == f"grasp: {tmp_path / 'bag'}: the run ended at 0.1 s, before its scene\n"


def test_the_monitor_stops_a_graph_whose_energy_balance_does_not_close(launch: Any, tmp_path: Path) -> None:
    """A plant that pushes its arms harder than the commands say."""
    options = ["--ros-args", "-p", "wait_for_monitor:=true"]
    monitor = launch(*START, "monitor", "--ros-args", "-p", f"bag:={tmp_path / 'bag'}", stderr=subprocess.PIPE)
    others = [
        launch(sys.executable, "-c", WRONG_PLANT, *options, stderr=subprocess.PIPE),
        *(launch(*START, f"{side}_controller", *options, stderr=subprocess.DEVNULL) for side in ("left", "right")),
    ]
    _, err = ended(monitor, 1)
    _, last_words = ended(others[0], 1)
    assert "lyapunov: /monitor has ended: V_c rose by" in last_words
    assert re.search(r"V_c rose by \S+ J more than the work of the held forces, t = \S+ s, mode 0, state \[", err)
    found = bag.read(tmp_path / "bag")
    assert found.alarms == 1
    assert found.lyapunov[-1, LYAPUNOV_NAMES.index("alarm")] == 1.0
    assert not any(found.missing.values())
