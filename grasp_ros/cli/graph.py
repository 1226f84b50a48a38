"""`grasp run`, `replay`, `watch` and `ctl`: the graph, and a bag in its place."""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import signal
import sys
import time
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

from grasp_ros.cli.arguments import add_accuracy, add_command, add_scene, named, sides_of
from grasp_ros.cli.bags import add_limits, check_limits, keeps
from grasp_ros.cli.checks import load_scene, prepare
from grasp_ros.cli.output import has_notes
from grasp_ros.exact.compilation.kernel_cache import kernels_on_disk
from grasp_ros.graph.bag import BagError, EmptyBagError
from grasp_ros.graph.host import check_reach, hold, network
from grasp_ros.graph.parameters import PEER_SECONDS, Running, check_factor
from grasp_ros.graph.processes import Graph, become
from grasp_ros.graph.stopping import STOP_SIGNALS, note_signals, on_signals
from grasp_ros.physics.errors import Failed, Refused, need
from grasp_ros.scene.topics import JOINT_STATES


def add_to(commands: Any) -> None:
    """Add the subcommands."""
    sub = add_command(commands, "run", _run)
    add_scene(sub)
    add_accuracy(sub)
    sub.add_argument("-o", "--output", type=named, metavar="DIRECTORY", help="new directory for the scene and the bag")
    sub.add_argument(
        "--without", action="append", default=[], metavar="CONTROLLER",
        help="do not start left_controller or right_controller; wait for another one on its topic",
    )
    sub.add_argument(
        "--controller", dest="laws", action="append", default=[], metavar="SIDE=MODULE:OBJECT",
        help="your controller instead of the scene's: a callable of tick, time, x, v and further named values that"
        " returns the force",
    )
    sub.add_argument(
        "--free-running", type=float, nargs="?", const=1.0, metavar="FACTOR",
        help="follow the wall clock, FACTOR simulated seconds per second (default 1), instead of lockstep",
    )
    _add_namespace(sub, "namespace of all names, also /clock; for several graphs")
    sub.add_argument("--one-process", action="store_true", help="run all nodes in one process and one thread")
    sub.add_argument("--paused", action="store_true", help="begin paused at the first state, see ctl")
    sub.add_argument(
        "--peer-timeout", type=float, default=PEER_SECONDS, metavar="S",
        help="wall time without a heartbeat or an answer after which a node is silent"
        f" (default {PEER_SECONDS:g} s)",
    )
    sub.add_argument(
        "--on-silence", choices=("end", "wait"), default="end", help="reaction when a node is gone or silent"
    )
    sub.add_argument("--no-check", action="store_true", help="do not simulate the run again to compare every bit")
    sub.add_argument("--no-figure", action="store_true", help="draw no figure")
    add_limits(sub)
    _add_network(sub)
    sub = add_command(commands, "replay", _replay)
    sub.add_argument("bag", type=named, help="directory or file of a bag")
    sub.add_argument("--rate", type=float, default=1.0, metavar="R", help="playback: bag time / wall time (default 1)")
    _add_network(sub)
    sub = add_command(commands, "watch", _watch)
    sub.add_argument("bag", type=named, nargs="?", help="a bag (default: the running graph)")
    sub.add_argument("--rate", type=float, metavar="R", help="playback: bag time / wall time (default 1)")
    sub.add_argument("--from", dest="first", type=float, metavar="S", help="time in the bag to begin at, in s")
    _add_namespace(sub, "namespace of the graph")
    _add_network(sub)
    sub = add_command(commands, "ctl", _ctl)
    sub.add_argument("words", nargs="*", metavar="WORD", help="pause, resume, step [N], reset, status, get NODE"
                     " [NAME ...], set NODE NAME VALUE, echo TOPIC [N], without N until a Ctrl-C; none: a shell that"
                     " stays connected, whose exit status is the worst of its lines")
    _add_namespace(sub, "namespace of the graph")
    _add_network(sub)


def _add_namespace(sub: argparse.ArgumentParser, text: str) -> None:
    sub.add_argument("--namespace", type=_namespace, default="/", metavar="NS", help=text)


def _namespace(word: str) -> str:
    if re.fullmatch(r"/|(/[A-Za-z](_?[A-Za-z0-9])*_?)+", word) is None:
        raise argparse.ArgumentTypeError(f"{word!r} is not allowed; allowed: / and names of ROS such as /lab/one")
    return word


def _add_network(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--network", action="store_true", help="let other hosts take part; default: this host alone")


def _reach(options: argparse.Namespace) -> None:
    """Let the processes that come be reached from where the options say, and refuse where none can be."""
    check_reach(os.environ, alone=getattr(options, "one_process", False))
    if options.network:
        os.environ.update(network(os.environ))


def _run(options: argparse.Namespace) -> int:
    need("this", "rclpy", "mcap", "rosbags", "zstandard")
    _reach(options)
    laws = {f"{side}_controller": law for side, law in sides_of(options.laws).items()}
    scene = load_scene(options.scene, options.settings)
    directory = options.output or Path("runs") / f"{scene.name}_{datetime.now():%Y_%m_%d-%H_%M_%S}"
    check_limits(options, lockstep=options.free_running is None)
    Running(options.accuracy)  # refuses what is wrong before anything is there, as those around it do
    plant: dict[str, bool | float | str] = {"paused": options.paused, "progress": has_notes()}
    if options.free_running is not None:
        check_factor(options.free_running, "--free-running")
        plant.update(free_running=True, real_time_factor=options.free_running, wait_for_controllers=True)
    spent = [(time.monotonic(), "begin")]
    if not kernels_on_disk():  # otherwise the plant alone loads them
        prepare()
        spent.append((time.monotonic(), "compilation"))
    first = not os.path.exists(directory.parent)
    graph = Graph(
        scene, directory, options.accuracy, without=options.without, laws=laws, plant=plant,
        one_process=options.one_process, namespace=options.namespace, peer_timeout=options.peer_timeout,
        on_silence=options.on_silence, quiet=not has_notes(),
    )
    try:
        stopped = _live(graph, spent)
        if stopped and graph.bag.exists() and not (graph.bag / "metadata.yaml").exists():
            raise Failed(f"{graph.bag}: was not closed")  # the monitor has said why, or was killed
        if not stopped or _has_ticks(graph.bag):
            return _report(graph, stopped, spent, options)
    except (Failed, BagError) as error:
        there = f"; {graph.bag} has what was recorded" if _has_ticks(graph.bag) else ""
        print(f"grasp: {error}{there}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        on_signals(signal.SIG_IGN)  # a second one would cut the sentence short
        raise KeyboardInterrupt(f"; {graph.bag} was not checked to the end and not drawn; `grasp verify` and"
                                " `grasp plot` do that" if _has_ticks(graph.bag) else "") from None
    except Refused:
        if graph.processes and not _has_ticks(graph.bag):  # a node refused what it was given
            shutil.rmtree(directory, ignore_errors=True)
            if first:
                directory.parent.rmdir()
        raise
    print(f"grasp: interrupted before the first tick; {directory} has the scene and the log", file=sys.stderr)
    return 130


def _has_ticks(bag: Path) -> bool:
    """Whether there is a bag to keep: with a state, which a run that waited to its end has not, or damaged."""
    from grasp_ros.graph.bag.opening import Opened

    try:
        return bag.exists() and any(topic == JOINT_STATES for topic, _ in Opened(bag).messages)
    except Refused as error:
        return not isinstance(error, EmptyBagError) and any(file.stat().st_size for file in bag.glob("*.mcap"))


def _live(graph: Graph, spent: list[tuple[float, str]]) -> bool:
    """Start a graph, wait for its end and stop it; returns whether a signal has ended it.

    `spent` gets the wall times at which something had ended.
    """
    received: list[int] = []
    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    note_signals(received)
    try:
        graph.start()
        graph.wait(received)
        spent.append((graph.begun or time.monotonic(), "start"))
        spent.append((time.monotonic(), "run"))
    finally:
        graph.stop()
        spent.append((time.monotonic(), "stop"))
        for number, handler in before.items():
            signal.signal(number, handler)
    return bool(received)


def _report(graph: Graph, stopped: bool, spent: list[tuple[float, str]], options: argparse.Namespace) -> int:
    """Print and draw what a run has recorded; the exit status says whether it is all there and right."""
    from grasp_ros.cli import report
    from grasp_ros.graph.bag.reading import read
    from grasp_ros.graph.bag.summary import summary
    from grasp_ros.graph.bag.verify import verify

    recording = read(graph.bag)
    rows, whole = report.describe_recording(recording, summary(recording)), keeps(recording, options)
    spent.append((time.monotonic(), "reading"))
    if stopped:
        rows.append(("interrupted", f"not verified and not drawn; `grasp verify` and `grasp plot` {graph.bag} do that"))
    else:
        ends = int(recording.scene_tick[-1]) == recording.scene.ticks
        whole = whole and ends and not recording.alarms and not any(recording.missing.values())
        if not ends:
            print(f"grasp: {graph.bag}: the run ended at {recording.t[-1]:g} s, before its scene", file=sys.stderr)
    if not (stopped or options.no_check):
        verification = verify(recording)
        whole = whole and verification.holds
        rows += report.describe_verification(verification)
        spent.append((time.monotonic(), "check"))
    if not (stopped or options.no_figure):
        from grasp_ros.simulation import plots

        figure = graph.directory / "figure.png"
        plots.draw(recording, figure)
        rows.append(("figure", str(figure)))
        spent.append((time.monotonic(), "figure"))
    parts = [f"{what} {end - begin:.1f}" for (begin, _), (end, what) in pairwise(spent)]
    rows.append(("wall time", f"{time.monotonic() - spent[0][0]:.1f} s: {', '.join(parts)}"))
    print(report.table(rows))
    return 0 if whole else 1


def _replay(options: argparse.Namespace) -> int:
    from grasp_ros.graph.bag.opening import Opened

    check_factor(options.rate, "--rate")
    states = Opened(options.bag).names[JOINT_STATES]
    _reach(options)
    held = hold(os.environ, states.removesuffix(f"/{JOINT_STATES.name}") or "/")
    held.set_inheritable(True)  # what this process becomes has it to its end
    become("player", {"bag": str(options.bag), "rate": options.rate})


def _watch(options: argparse.Namespace) -> int:
    if options.bag is None:
        for option, value in (("--rate", options.rate), ("--from", options.first)):
            if value is not None:
                raise Refused(f"{option} {value!r} is not allowed; allowed: with a bag")
        _reach(options)
        become("watch", {}, options.namespace)
    if options.namespace != "/" or options.network:
        raise Refused("--namespace and --network are of a graph; allowed: without a bag")
    from grasp_ros.graph.bag.reading import read
    from grasp_ros.graph.terminal import play

    play(read(options.bag), 1.0 if options.rate is None else options.rate, options.first)
    return 0


def _ctl(options: argparse.Namespace) -> int:
    _reach(options)
    become("remote", {"words": json.dumps(options.words)}, options.namespace)
