"""A graph or a bag in a terminal: a picture of one moment (masses, forces, energy, contacts, rates), and its keys."""

from __future__ import annotations

import os
import re
import select
import sys
import termios
import time
import tty
from collections.abc import Mapping
from contextlib import closing, suppress
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from rich.console import Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from grasp_ros.graph.parameters import check_factor
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.model import Array, Mode
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.topics import CONTACTS, named

if TYPE_CHECKING:  # a running graph has none
    from grasp_ros.graph.bag.recording import Recording

FRAME_SECONDS = 0.1
HINT = "Space pause   ← → step   q quit"
STYLES = {"left": "bold blue", "object": "bold white", "right": "bold red"}
SIGNS = {"left": "[L]", "object": "(O)", "right": "[R]"}
WIDEST, NARROW, LEAST = 80, 66, 40  # columns of the picture: at most, below which words are short, and at least
CONTACT: dict[float, str] = {Mode.NONE: "none", Mode.LEFT: "left", Mode.RIGHT: "right", Mode.BOTH: "left and right"}
BALANCE: dict[float, Text | str] = {0.0: "closes", 1.0: Text("ALARM", style="bold red")}
UNKNOWN = "not known"
_KEY = re.compile(rb"\x1b[\[O][CD]| |q")
_BEGUN = re.compile(rb"\x1b[\[O]?$")  # of an arrow key whose end has not come yet
KEY_BYTES = 1024  # taken at once


class Moment(NamedTuple):
    """What is shown."""

    time: float  # s
    state: Array  # (6,), m and m/s; NaN for what is not there
    commands: Mapping[str, float]  # N, by side
    impacts: Mapping[str, float]  # N, by side
    level: Mapping[str, float]  # by `topics.LYAPUNOV_NAMES`
    words: str  # where it comes from, and how fast
    answers: bool = True  # whether the commands answer this state; otherwise they are the forces that acted until it


class View:
    """Draws moments of one scene, whose initial state gives the scale of the line, and a hint to the keys there are."""

    def __init__(self, scene: Scene, hint: str = "") -> None:
        self.scene, self.hint = scene, hint
        positions = np.abs(scene.initial_state[0::2])
        self._reach = 1.25 * float(positions.max()) or 1.0
        self._most = 0.0  # energy shown so far, J

    def draw(self, moment: Moment, width: int = WIDEST) -> RenderableType:
        """A renderable of rich for a terminal with so many columns."""
        width = min(max(width, LEAST), WIDEST)
        self._reach = max(self._reach, float(np.nanmax(np.abs(moment.state[0::2]))))
        hint = [Text(self.hint, style="dim")] if self.hint else []
        gap, left, right = (width - 9) // 2, f"{-self._reach:.3g} m", f"{self._reach:.3g} m"
        ruler = Text(f"{left:<{gap}}0{right:>{width - gap - 9}}", style="dim")
        parts = Group(
            self._line(moment.state, width - 8), ruler, "", self._bodies(moment, width < NARROW), "",
            *self._energy(moment.level, width), *hint,
        )
        below = f"t = {moment.time:.3f} s   {moment.words}"
        return Panel(parts, title=Text(self.scene.title), subtitle=Text(below), width=width)

    def _line(self, state: Array, track: int) -> Text:
        """Each body at its position; one that is behind another is moved aside by a character."""
        row, taken = Text(" " * track), -1
        for body in sorted(NAMES, key=lambda body: COLUMN[body]):
            x = float(state[COLUMN[body]])
            if np.isnan(x):
                continue
            sign, style = SIGNS[NAMES[body]], STYLES[NAMES[body]]
            middle = round((x / self._reach + 1.0) * 0.5 * (track - 1))
            begin = min(max(middle - 1, taken + 1, 0), track - 3)
            row = Text.assemble(row[:begin], (sign, style), row[begin + 3 :])
            taken = begin + 2
        return row

    def _bodies(self, moment: Moment, narrow: bool) -> Table:
        table = Table(box=None, padding=(0, 1 if narrow else 2), collapse_padding=narrow, pad_edge=not narrow)
        force = "f, N" if narrow else "command, N" if moment.answers else "acted, N"
        for heading in ("", "x, m", "v, m/s", force, "fw, N" if narrow else "impact, N"):
            table.add_column(heading, justify="right" if heading else "left")
        decimals = 3 if narrow else 5
        for body, name in NAMES.items():
            x, v = moment.state[COLUMN[body] : COLUMN[body] + 2]
            if not np.isnan(x):
                forces = [moment.commands.get(name), moment.impacts.get(name)] if name in SIDES else [None, None]
                words = ["" if force is None or np.isnan(force) else f"{force:+.{decimals - 1}f}" for force in forces]
                table.add_row(Text(name, style=STYLES[name]), f"{x:+.{decimals}f}", f"{v:+.{decimals}f}", *words)
        return table

    def _energy(self, level: Mapping[str, float], width: int) -> list[RenderableType]:
        if np.isnan(level.get("V_plant", np.nan)):
            return [Text("energy and contacts: no messages on lyapunov")]
        closed, bar = level.get("closed") == 1.0, max(width - 50, 6)
        names = ("V_c", "V") if closed else ("V_plant",)
        table = Table(box=None, padding=(0, 1 if width < NARROW else 2), show_header=False, pad_edge=width >= NARROW)
        for name in names:
            value = level[name]
            finite = bool(np.isfinite(value))  # what a bag says need not be
            self._most = max(self._most, value) if finite else self._most
            filled = round(bar * (max(value, 0.0) / self._most)) if finite and self._most else 0
            table.add_row(name, f"{value:.6g} J", Text("█" * filled, style="green" if closed else "yellow"))
        table.add_row("contact", CONTACT.get(level["mode"], UNKNOWN), "")
        table.add_row("balance", BALANCE.get(level["alarm"], UNKNOWN), "")
        return [table] if closed else [
            table, "V: law unknown" if width < NARROW else "V: law unknown, or not the announced one"]


class Key(Enum):
    """What a key asks for."""

    PAUSE = b" "
    FORWARD = b"C"
    BACK = b"D"
    QUIT = b"q"


class Keys:
    """Keys pressed on the standard input until `close`, one by one and not shown; Ctrl-C stays a signal."""

    def __init__(self) -> None:
        # Whether there can be any: not without a terminal, nor in the background, where a terminal stops who sets it.
        self.there, self._rest = False, b""
        self._file = sys.stdin.fileno() if sys.stdin and not sys.stdin.closed else -1
        with suppress(OSError):  # not a terminal, or not that of this session
            if self._file >= 0 and os.tcgetpgrp(self._file) == os.getpgrp():
                self._before = termios.tcgetattr(self._file)
                self.there = True
                self._take()

    def _take(self) -> None:
        """Set the terminal, again after a Ctrl-Z: the shell has put it back."""
        with suppress(OSError, termios.error):  # it is gone
            if self.there and os.tcgetpgrp(self._file) == os.getpgrp():
                tty.setcbreak(self._file, termios.TCSANOW)

    def close(self) -> None:
        """Give the terminal back; does nothing the second time."""
        if self.there:
            self.there = False
            termios.tcsetattr(self._file, termios.TCSADRAIN, self._before)

    def pressed(self, seconds: float = 0.0) -> list[Key]:
        """Keys in their order; waits for the first one, at most so many seconds. A terminal that is gone is a QUIT."""
        self._take()
        ready, _, _ = select.select([self._file] if self.there else [], [], [], seconds)
        if not ready:
            return []
        came = os.read(self._file, KEY_BYTES)
        if not came:
            return [Key.QUIT]
        came = self._rest + came
        begun = _BEGUN.search(came)
        self._rest = begun[0] if begun else b""
        return [Key(word[-1:]) for word in _KEY.findall(came)]


def play(recording: Recording, rate: float, first: float | None = None) -> None:
    """Draw a recording as time goes by; the last picture stays. On a terminal keys pause, step and end it.

    `rate` is in seconds of the recording in a second; `first` is where it begins, in s, by default at the first tick.
    """
    times = recording.t
    first = float(times[0]) if first is None else first
    check_factor(rate, "--rate")
    if not times[0] <= first <= times[-1]:
        raise Refused(f"--from: {first!r} is not allowed; allowed: {times[0]:g} to {times[-1]:g} s")
    row, paused, at, since = 0, False, first, time.monotonic()  # what is shown; since when time goes by, from where
    with Live(auto_refresh=False) as live, closing(Keys()) as keys:
        view = View(recording.scene, HINT if keys.there else "")
        while True:
            if not paused:
                row = int(np.searchsorted(times, at + (time.monotonic() - since) * rate, side="right")) - 1
            moment = moment_of(recording, row, "paused" if paused else f"{rate:g} s per second")
            live.update(view.draw(moment, live.console.width), refresh=True)
            if not paused and row == len(times) - 1:
                return
            for key in keys.pressed(FRAME_SECONDS):
                if key is Key.QUIT:
                    return
                paused = key is not Key.PAUSE or not paused  # a step pauses, too
                if key is not Key.PAUSE:
                    row = min(max(row + (1 if key is Key.FORWARD else -1), 0), len(times) - 1)
                at, since = float(times[row]), time.monotonic()


def moment_of(recording: Recording, row: int, words: str) -> Moment:
    """What the view shows of a tick of a recording."""
    lockstep = recording.running.lockstep
    forces = recording.command if lockstep else recording.effort
    commands = {side: float(forces[row, body]) for side, body in SIDES.items() if body in recording.scene.system.laws}
    impacts = {side: float(recording.outputs[topic.name][row]) for side, topic in CONTACTS.items()
               if topic.name in recording.outputs}
    level = named(recording.lyapunov[row])
    return Moment(float(recording.t[row]), recording.state[row], commands, impacts, level, words, lockstep)
