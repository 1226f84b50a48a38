"""Drills: the terminal, the pipe, the disk or the directory is gone, and what lies around afterwards."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil

from grasp_ros import scene as scenes
from grasp_ros.graph import bag
from grasp_ros.scene.topics import LEFT_COMMAND
from grasp_ros.simulation import simulate
from lab.drills import recorder
from lab.drills.faults.drill import Drill, Evidence, Skipped, play
from lab.drills.faults.stage import NODES, Stage

CHECKOUT = Path(__file__).parents[3]  # where `python -m lab` runs
GROUP, NAMES, FILES = "terminal, disk and directory", "names and waiting", "files"
DELETED = "was deleted"
DISK_BYTES, LIMIT_BLOCKS = 3_500_000, 6_600  # of a file system, and of `ulimit -f`, in units of 512 bytes
IDLE_SECONDS, IDLE_SHARE = 3.0, 0.05  # of a core, while there is nothing to do
CUTS, FILE_COUNT = 40, 200


def drills() -> list[Drill]:
    """All of them."""
    return [
        # Nobody can read what is said.
        Drill("closed-terminal", GROUP, "its terminal is closed", _in_terminal, _close_output, mute=True),
        Drill("closed-pipe", GROUP, "nobody reads its output any more", _in_pipe, _close_output, mute=True),
        Drill("full-disk", GROUP, "the disk becomes full", _on_small_disk, _until_the_end, by_itself=True,
              culprit="no space is left on the disk"),
        Drill("file-limit", GROUP, "a limit of the file size (`ulimit -f`)", _with_limit, _until_the_end,
              by_itself=True, culprit="files may not be larger"),
        Drill("deleted-bag", GROUP, "the directory of the bag is deleted", Stage.run,
              lambda stage: shutil.rmtree(stage.bag), nothing_to_keep=True, culprit=DELETED),
        Drill("deleted-run", GROUP, "the whole directory of the run is deleted", Stage.run,
              lambda stage: shutil.rmtree(stage.bag.parent), nothing_to_keep=True, culprit=DELETED),
        # From here on what counts is measured, not said, or nothing happens.
        _own("shared-memory", GROUP, "files in /dev/shm after a SIGKILL of all four nodes", _shared_memory),
        _own("idle", NAMES, "a plant that waits, alone: at most 5 % of a core", _idle),
        _own("remapped-input", NAMES, "a plant whose command topic has another name than its controller's", _remapped,
             culprit=LEFT_COMMAND.name),
        Drill("remapped", NAMES, "all topics and /clock remapped, in all nodes alike", _all_remapped, _nothing),
        _own("power-cut", FILES, f"a power cut: the bag cut off at {CUTS} places", _power_cut),
        _own("damaged-files", FILES,
             f"{FILE_COUNT} damaged scenes, results, bags and journals (`python -m lab readers`)", _damaged),
    ]


def _own(name: str, group: str, fault: str, play: Callable[[Stage], Evidence], culprit: str = "") -> Drill:
    return Drill(name, group, fault, _nothing, _nothing, play=play, culprit=culprit)


def _nothing(_: Stage) -> None:
    """Nothing happens."""


def _in_terminal(stage: Stage) -> None:
    master, slave = os.openpty()
    stage.start("grasp run", ["setsid", "--ctty", *stage.run_words()], stdin=slave, stdout=slave, stderr=slave,
                start_new_session=False)
    os.close(slave)
    stage.terminal = master
    stage.output.follow(master)


def _in_pipe(stage: Stage) -> None:
    stage.terminal, end = os.pipe()
    stage.start("grasp run", stage.run_words(), stdout=end, stderr=end)
    os.close(end)
    stage.output.follow(stage.terminal)


def _close_output(stage: Stage) -> None:
    stage.output.leave(stage.terminal)


def _on_small_disk(stage: Stage) -> None:
    if subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False).returncode:
        raise Skipped("no file system may be mounted here")
    disk = stage.folder / "disk"
    disk.mkdir()
    script = ('mount -t tmpfs -o size="$0" none "$1" && target="$1" && copy="$2" && shift 2 && trap : INT && "$@";'
              ' status=$?; cp -r "$target/run" "$copy"; exit $status')
    given = [script, str(DISK_BYTES), str(disk), str(stage.folder)]
    stage.start("grasp run", ["unshare", "-rm", "sh", "-c", *given, *stage.run_words(folder="disk/run")])


def _with_limit(stage: Stage) -> None:
    stage.start("grasp run", ["sh", "-c", 'ulimit -f "$0" && exec "$@"', str(LIMIT_BLOCKS), *stage.run_words()])


def _until_the_end(stage: Stage) -> None:
    stage.wait(lambda: stage.ended("grasp run"), 60.0)


def _shared_memory(stage: Stage) -> Evidence:
    """All nodes are killed; then another graph comes and goes: what the killed left may be cleared by then."""
    stage.terminals()
    stage.settle()
    shared = stage.shared_memory()
    for name in NODES:
        stage.signal(name, signal.SIGKILL)
    for process in stage.started.values():
        process.wait()
    left = sum(Path(name).exists() for name in shared)
    stage.started.clear()
    shutil.rmtree(stage.bag)
    stage.forget()
    evidence = play(Drill("", "", "", Stage.terminals, _nothing), stage)
    after = sum(Path(name).exists() for name in shared)
    evidence.said = f"{left} files after the kill, {after} after the next graph in this domain"
    evidence.shared = after
    return evidence


def _idle(stage: Stage) -> Evidence:
    stage.node("plant")
    stage.wait(lambda: stage.said("waiting"), 60.0)
    share = psutil.Process(stage.pid("plant")).cpu_percent(IDLE_SECONDS) / 100.0
    stage.signal("plant", signal.SIGINT)
    stage.wait(lambda: stage.ended("plant"), 15.0)
    said = f"{100.0 * share:.0f} % of a core" if share > IDLE_SHARE else f"at most {100.0 * IDLE_SHARE:.0f} % of a core"
    return Evidence(said=said, went_on=True, exits={"plant": stage.started["plant"].returncode}, nothing_to_keep=True,
                    wrong=said if share > IDLE_SHARE else "", left=len(stage.living()))


def _remapped(stage: Stage) -> Evidence:
    """The plant must say for whom it waits, and go on waiting."""
    for name in NODES:
        stage.node(name, *(["-r", "left/effort_command:=elsewhere"] if name == "plant" else []))
    stage.wait(lambda: stage.said("left/effort_command"), 60.0)
    words = [line.text for line in stage.output.lines if "left/effort_command" in line.text]
    for name in NODES:
        stage.signal(name, signal.SIGINT)
    stage.wait(lambda: not stage.living(), 15.0)
    return Evidence(said=words[0].rpartition("]: ")[2] if words else "", noticed=0.0, nothing_to_keep=True,
                    exits={name: process.wait() for name, process in stage.started.items()}, left=len(stage.living()),
                    traceback=stage.output.traceback)


def _all_remapped(stage: Stage) -> None:
    names = ("left/effort_command", "right/effort_command", "contact/left", "contact/right", "lyapunov")
    words = [word for name in names for word in ("-r", f"{name}:=elsewhere/{name}")]
    for name in NODES:
        stage.node(name, *words, "-r", "/clock:=/elsewhere/clock")


def _power_cut(stage: Stage) -> Evidence:
    """A recording in which every chunk is on the disk, cut off: what is read grows with the length, and is right."""
    run = simulate(scenes.load(stage.scene.name, ["time.duration_s=2"]), sampled=True)
    path, cut = stage.folder / "whole", stage.folder / "cut"
    recorder.write(path, run)
    whole, kept, wrong = next(path.glob("*.mcap")).read_bytes(), -1, ""
    cut.mkdir()
    for size in np.linspace(1, len(whole), CUTS, dtype=int).tolist():
        (cut / "cut.mcap").write_bytes(whole[:size])
        try:
            recording = bag.read(cut)
        except bag.BagError:
            wrong = wrong or ("" if kept < 0 else f"unreadable at byte {size}")
            continue
        count = len(recording.tick)
        if count < kept or recording.state.tobytes() != run.state[:count].tobytes():
            wrong = f"wrong at byte {size}"
        kept = count
    return Evidence(said="each opens with all ticks of its whole chunks", went_on=True, wrong=wrong)


def _damaged(stage: Stage) -> Evidence:
    words = [sys.executable, "-m", "lab", "readers", "--count", str(FILE_COUNT), "-o", str(stage.folder / "readers")]
    found = subprocess.run(words, capture_output=True, text=True, check=False, cwd=CHECKOUT)
    good = found.returncode == 0
    return Evidence(said="refused in a sentence, or read as what they are", went_on=good, nothing_to_keep=True,
                    exits={"python -m lab readers": found.returncode}, wrong="" if good else found.stdout[-200:])
