"""Drills: a process is killed, frozen, or asked to end."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from functools import partial
from signal import Signals

from grasp_ros.scene.topics import JOINT_STATES, LYAPUNOV
from lab.drills.faults.drill import SUSPENDED, Drill, node
from lab.drills.faults.stage import NODES, Stage

FROZEN_SECONDS = 5.0
MISSED_SECONDS = 3.0
MOMENT_SECONDS = 1.0  # a freeze that nobody may take for an end
SIGNALS = ("SIGKILL", "SIGSTOP", "SIGHUP", "SIGQUIT", "SIGTERM", "SIGINT")
ALONE_SIGNALS = ("SIGKILL", "SIGTERM")
ASKING = ("SIGHUP", "SIGQUIT", "SIGTERM", "SIGINT")  # the graph to end
UNDER, ALONE, PATIENT = "under `grasp run`", "in four terminals, with `on_silence:=end`", "in four terminals"
PARENT = "parent process"  # in what nodes say of it
QUICK = ("SIGKILL-monitor", "SIGKILL-grasp")


def drills() -> list[Drill]:
    """Every signal to every process, and some at other moments."""
    found = []
    for number in SIGNALS:
        found += [_one(UNDER, Stage.run, number, name) for name in (*NODES, "grasp run")]
    for number in ALONE_SIGNALS:
        found += [_one(ALONE, partial(Stage.terminals, on_silence="end"), number, name) for name in NODES]
    found += [_one(PATIENT, Stage.terminals, "SIGSTOP", name) for name in NODES]
    back = [
        Drill(f"SIGKILL-{name}-back", PATIENT, f"SIGKILL of the {name.replace('_', ' ')}, and another one is started",
              Stage.terminals, partial(replace, name=name), culprit=node(name))
        for name in ("left_controller", "right_controller")
    ]
    return [*found, *back, *_at_other_moments()]


def _one(group: str, start: Callable[[Stage], None], number: str, name: str) -> Drill:
    words = f"{number} of {'`grasp run`' if name == 'grasp run' else 'the ' + name.replace('_', ' ')}"
    key = f"{number}-{name.split()[0]}" + ("" if group == UNDER else "-alone")
    if number == "SIGSTOP":
        words += f", SIGCONT after {FROZEN_SECONDS:g} s"
    kill = partial(Stage.signal, name=name, number=Signals[number])
    strike = partial(freeze, name=name) if number == "SIGSTOP" else kill
    asked = name == "grasp run" and number in ASKING
    seen = LYAPUNOV if name == "monitor" else JOINT_STATES
    # A user who asks `grasp run` to end is no culprit, and nobody waits for it while it is frozen.
    culprit = node(name) if name != "grasp run" else PARENT if number == "SIGKILL" else ""
    return Drill(key, group, words, start, strike, seen=seen, asked=asked, quick=key in QUICK, culprit=culprit)


def replace(stage: Stage, name: str) -> None:
    """Kill a node, and start it again once the others have missed it."""
    stage.signal(name, signal.SIGKILL)
    stage.started.pop(name).wait()
    time.sleep(MISSED_SECONDS)
    stage.node(name)
    reached = stage.published
    stage.wait(lambda: stage.published > reached, 20.0)


def freeze(stage: Stage, name: str, seconds: float = FROZEN_SECONDS) -> None:
    """Stop a process and let it go on later, if it is still there."""
    pid = stage.pid(name)
    stage.signal(name, signal.SIGSTOP)
    stage.wait(lambda: pid not in stage.living(), seconds)
    if pid in stage.living():
        stage.signal(name, signal.SIGCONT)


def freeze_all(stage: Stage) -> None:
    """Stop one node after the other for a moment."""
    for name in NODES:
        freeze(stage, name, MOMENT_SECONDS)


def suspend(stage: Stage) -> None:
    """Stop all processes, as a machine does that goes to sleep; before it wakes up nobody can notice anything."""
    there = stage.living()
    for pid in there:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(FROZEN_SECONDS)
    stage.happens()
    stage.asleep = stage.accident - FROZEN_SECONDS, stage.accident
    for pid in there:
        os.kill(pid, signal.SIGCONT)


def _at_other_moments() -> list[Drill]:
    group, one_process = "at other moments", _run_with("--one-process")
    return [
        Drill("freeze-a-moment", group, f"SIGSTOP of each node in turn, SIGCONT after {MOMENT_SECONDS:g} s", Stage.run,
              freeze_all, culprit=SUSPENDED),
        Drill("suspend", group, f"SIGSTOP of all processes at once, SIGCONT after {FROZEN_SECONDS:g} s", Stage.run,
              suspend, culprit=SUSPENDED),
        Drill("kill-while-paused", group, "SIGKILL of the left controller of a paused graph",
              _run_with("--paused"), _while_paused, settle=False, culprit=node("left_controller")),
        Drill("kill-while-starting", group, "SIGKILL of the left controller while it starts", Stage.run,
              partial(_while_starting, name="left_controller"), settle=False, nothing_to_keep=True,
              culprit=node("left_controller")),
        Drill("kill-monitor-while-starting", group, "SIGKILL of the monitor while it starts", Stage.run,
              partial(_while_starting, name="monitor"), settle=False, nothing_to_keep=True,
              culprit=node("monitor")),
        Drill("kill-run-while-starting", group, "SIGKILL of `grasp run` while its nodes start", Stage.run,
              partial(_while_starting, name="grasp run", with_node="monitor"), settle=False, nothing_to_keep=True,
              culprit=PARENT),
        Drill("kill-free-controller", group, "SIGKILL of the left controller of a free-running graph",
              _run_with("--free-running"), partial(Stage.signal, name="left_controller", number=signal.SIGKILL),
              culprit=node("left_controller")),
        Drill("kill-one-process", group, "SIGKILL of the one process of `--one-process`", one_process,
              partial(Stage.signal, name="graph", number=signal.SIGKILL), seen=LYAPUNOV, culprit=node("graph")),
        Drill("freeze-one-process", group, f"SIGSTOP of the one process of `--one-process`, SIGCONT after"
              f" {FROZEN_SECONDS:g} s", one_process, partial(freeze, name="graph"), seen=LYAPUNOV,
              culprit=node("graph")),
        Drill("kill-run-of-one-process", group, "SIGKILL of `grasp run --one-process`", one_process,
              partial(Stage.signal, name="grasp run", number=signal.SIGKILL), culprit=PARENT),
        Drill("ctrl-c-twice", group, "Ctrl-C, and another one while it ends", Stage.run, _twice,
              asked=True),  # by the user: nobody is to blame
    ]


def _run_with(word: str) -> Callable[[Stage], None]:
    return lambda stage: stage.run(word)


def _while_starting(stage: Stage, name: str, with_node: str = "") -> None:
    """Kill it, or rather once a node is there."""
    stage.wait(lambda: stage.has(with_node or name), 60.0)
    stage.signal(name, signal.SIGKILL)


def _while_paused(stage: Stage) -> None:
    stage.wait(lambda: stage.published >= 0, 60.0)
    time.sleep(MOMENT_SECONDS)
    stage.signal("left_controller", signal.SIGKILL)


def _twice(stage: Stage) -> None:
    stage.signal("grasp run", signal.SIGINT)
    time.sleep(0.05)
    stage.signal("grasp run", signal.SIGINT)
