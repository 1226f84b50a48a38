"""The fault drills: a handful of them, and that each way to fail is seen."""

from __future__ import annotations

import csv
import math
import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from grasp_ros.graph.ros import messages
from grasp_ros.scene.topics import JOINT_STATES, SCENE
from lab.drills.faults import run
from lab.drills.faults.drill import Evidence, Verdict, node
from lab.drills.faults.output import Output, plain
from lab.drills.faults.stage import NODES
from lab.drills.nodes.fault_injector import FaultInjector

GOOD = Evidence(said="it is gone", noticed=0.5, exits={"grasp run": 1})


@pytest.mark.slow
@pytest.mark.thorough
def test_quick_drills_pass_and_are_written(lab_command: Any, tmp_path: Path) -> None:
    result = lab_command("faults", "--quick", "--docs", "docs")
    assert result.returncode == 0, result.stdout + result.stderr
    drills = run.chosen((), quick=True)
    text = (tmp_path / "docs" / "faults.csv").read_text()
    verdicts = {row["fault"]: row["verdict"] for row in csv.DictReader(text.splitlines())}
    assert len(drills) >= 3
    for drill in drills:
        assert verdicts[drill.fault] in ("survived", "ended with a message")
    counted = [line for line in (tmp_path / "docs" / "faults.md").read_text().splitlines()
               if line.startswith(f"| {drills[0].group} |")]
    assert len(counted) == 1
    assert str(tmp_path) not in text
    assert "/tmp" not in text


@pytest.mark.parametrize(
    ("change", "verdict"),
    [
        ({}, Verdict.SENTENCE), ({"went_on": True, "said": "", "noticed": math.nan}, Verdict.SURVIVED),
        ({"traceback": "KeyError: 1", "went_on": True}, Verdict.TRACEBACK), ({"left": 1}, Verdict.LEFT),
        ({"hung": True}, Verdict.HUNG), ({"lost": 0.3}, Verdict.LOST),
        ({"lost": math.inf, "nothing_to_keep": True}, Verdict.SENTENCE), ({"wrong": "x"}, Verdict.WRONG),
        ({"said": ""}, Verdict.SILENT), ({"said": "", "mute": True}, Verdict.SENTENCE),
        ({"noticed": 9.0}, Verdict.LATE), ({"noticed": math.nan}, Verdict.LATE),
        ({"noticed": 9.0, "asked": True}, Verdict.SENTENCE), ({"culprit": "/plant"}, Verdict.NAME),
        ({"culprit": "/plant", "went_on": True}, Verdict.NAME),
        ({"culprit": "it is", "went_on": True}, Verdict.SURVIVED),
        ({"culprit": "it is", "went_on": True, "said": ""}, Verdict.SILENT),
        ({"culprit": "^$|it is", "went_on": True, "said": ""}, Verdict.SURVIVED),
        ({"skipped": "no network"}, Verdict.SKIPPED),
    ],
)
def test_each_way_to_end_is_seen(change: dict[str, Any], verdict: Verdict) -> None:
    assert replace(GOOD, **change).verdict is verdict
    assert verdict.passes is (verdict in (Verdict.SENTENCE, Verdict.SURVIVED, Verdict.SKIPPED))


def test_a_drill_that_is_not_there_is_refused(lab_command: Any) -> None:
    result = lab_command("faults", "--only", "earthquake")
    assert result.returncode == 2
    assert "--only: earthquake: no such fault; allowed: SIGHUP-grasp, " in result.stderr


def test_drills_have_names_of_their_own() -> None:
    names = [drill.name for drill in run.all_drills()]
    assert len(names) == len(set(names)) > 80


def test_a_drill_says_who_is_to_be_blamed() -> None:
    """Or why nobody is: see there."""
    nobody = {drill.name for drill in run.all_drills() if not drill.culprit}
    assert nobody <= {
        "SIGSTOP-grasp", "SIGHUP-grasp", "SIGQUIT-grasp", "SIGTERM-grasp", "SIGINT-grasp", "ctrl-c-twice",
        "rogue-large", "rogue-frame", "second-plant", "frozen-reader", "closed-terminal", "closed-pipe",
        "shared-memory", "idle", "remapped", "power-cut", "damaged-files", "peer",
    }


@pytest.mark.parametrize(("said", "blamed"), [
    ("grasp: plant: was killed by SIGKILL; DIR/run/bag has what was recorded", ["plant"]),
    ("grasp: plant: left/effort_command: no heartbeat of /left_controller for 1.5 s", ["left_controller"]),
    ("monitor: joint_states: /plant has ended; the bag has N ticks", ["plant"]),
    ("monitor: this node was suspended for 5.1 s", ["monitor"]),
])
def test_who_speaks_of_another_is_not_blamed(said: str, blamed: list[str]) -> None:
    assert [name for name in NODES if replace(GOOD, said=said, culprit=node(name)).verdict.passes] == blamed


@pytest.mark.slow
def test_what_is_sent_is_read_or_the_drill_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has the quality of service of its topic: else DDS connects nobody."""
    monkeypatch.setattr(FaultInjector._wait, "__defaults__", (5.0,))
    times, read = tmp_path / "times.npy", list[str]()
    np.save(times, np.zeros(1))
    injector = FaultInjector(int(os.environ["ROS_DOMAIN_ID"]), str(times), 1, JOINT_STATES.name)
    send = partial(injector.publish, list(SCENE), {"data": "no scene"})
    context = rclpy.Context()
    rclpy.init(context=context)
    reader = rclpy.create_node("reader", context=context)
    try:
        assert send() == {"failed": "scene is not read by all who should"}
        reader.create_subscription(String, SCENE.name, lambda text: read.append(text.data), messages.qos(SCENE))
        assert send()["sent"] == 1
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(reader)
        executor.spin_once(timeout_sec=5.0)
    finally:
        reader.destroy_node()
        context.shutdown()
        injector.close()
    assert read == ["no scene"]


def test_sentences_are_found_among_bars_of_progress() -> None:
    output = Output()
    bar = "a: 1%|| 0/2 [00:00<?, ?tick/s]"
    for text in (f"{bar}[WARN] [17.5] [plant]: waits", bar, "a:  2%|x | 1/2 [00:00<00:08, 2.5tick/s]",
                 f"{bar}a: 3%|| 0/2 [0<1, 1.5s/tick]grasp: DIR: over", "[INFO] [17.5] [plant]: on"):
        output._take(1.0, text)
    assert [line.text for line in output.news(0.0, 2.0)] == ["[WARN] [17.5] [plant]: waits", "grasp: DIR: over"]
    assert plain(output.lines[0].text, []) == "plant: waits"
    found = plain("grasp: /a/b/run: t = 1.5 s, tick 7, 30 bytes", [Path("/a/b")])
    assert found == "grasp: DIR/run: t = T s, tick N, N bytes"
    assert output.traceback == ""
    for text in (f"{bar}Traceback (most recent call last):", "  File", "ValueError: no"):
        output._take(3.0, text)
    assert output.traceback == "ValueError: no"
