"""A measured motion: of a bag, of a file of `grasp simulate`, or of a table with its scene."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping
from pathlib import Path
from stat import S_ISDIR
from typing import NamedTuple, TypeAlias

import numpy as np

from grasp_ros.graph.bag.reading import read
from grasp_ros.graph.bag.recording import Recording
from grasp_ros.graph.bag.verify import answers_of
from grasp_ros.physics import given
from grasp_ros.physics.domain import LARGEST_POSITION
from grasp_ros.physics.errors import Refused, allowed
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import BODIES, NAMES
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.files import decoding, format_of, reading
from grasp_ros.simulation.sampled_plant import tick_times
from grasp_ros.simulation.tables import COLUMNS, HEADS, TIME
from grasp_ros.simulation.trajectory import Trajectory
from grasp_ros.simulation.trajectory_file import load

CHANNELS = tuple(HEADS[column.name] for column in COLUMNS[:6])  # names of the states, in their order
INPUTS = tuple(HEADS[f"input_{NAMES[body]}"] for body in sorted(BODIES))  # by body
INITIAL = tuple(f"{section}.{key}" for section in ("left_arm", "object", "right_arm")
                for key in ("position_m", "velocity_m_per_s"))  # their values at t = 0, by "section.key"
COMMANDS = tuple(HEADS[f"command_{name}"] for name in SIDES)
T = HEADS[TIME.name]
ROUNDED = 1e-6  # of a control period, by which times of a table may differ from the ticks
FEWEST = 10  # samples
Source: TypeAlias = str | os.PathLike[str] | Recording | Trajectory


class Measured(NamedTuple):
    """n samples of a motion.

    Without recorded inputs the controllers of the scene act.
    """

    name: str
    scene: Scene
    t: Array  # (n,) s, ascending
    state: Array  # (n, 6) m and m/s; NaN: a channel that is not measured
    inputs: Array | None  # (n - 1, 3) N by body, from each sample to the next
    sampled: bool  # whether commands are held over control periods
    why_unknown: str = ""  # why what acted does not follow from the controllers of the scene; empty if it does
    unused: bool = False  # whether a table has inputs, which a scene without `loop` does not hold

    @property
    def acting(self) -> str:
        """What acts on the bodies, in words."""
        if self.inputs is not None:
            return "the inputs of the data"
        if self.unused:
            return "the continuous feedback of the scene (forces in the table act only in a scene with loop)"
        return "the held commands of the scene" if self.sampled else "the continuous feedback of the scene"

    @property
    def channels(self) -> list[int]:
        """Columns of the state that are measured."""
        return [column for column in range(6) if not np.isnan(self.state[:, column]).any()]


def measured(source: Source, scene: Scene | None, by_sensors: bool = False) -> Measured:
    """A motion from what holds it; a scene replaces that of the source, and a table must have one.

    By sensors: what those of the scene have measured, in place of the exact states of a bag. A source that cannot be
    read, holds too little, or holds what is no number, is refused.
    """
    name = "run"
    if not isinstance(source, (Recording, Trajectory)):
        path = Path(given.instance("data", source, (str, os.PathLike), "a path, a Recording or a Trajectory"))
        with reading(path):
            directory = S_ISDIR(path.stat().st_mode)
        name = str(path)
        if directory or path.suffix.lower() == ".mcap":
            source = read(path)
        elif format_of(path, (".mcap", ".npz", ".csv")) == ".npz":
            source = load(path)
    if by_sensors and not isinstance(source, Recording):
        raise Refused("measured by sensors: allowed: of a bag")
    if isinstance(source, Recording):
        found = _of_recording(source, by_sensors)
    elif isinstance(source, Trajectory):
        found = _of_trajectory(source, name)
    elif scene is None:
        raise Refused(f"{name}: a table does not name its scene; allowed: with a scene (--scene, or scene=)")
    else:
        found = _of_table(path, scene)
    if scene is not None:
        if found.inputs is not None and scene.period_ns != found.scene.period_ns:
            raise Refused(f"{found.name}: its inputs change every {found.scene.time_of(1):g} s; allowed: a scene with"
                          f" that time.control_period_s, not {scene.time_of(1):g}")
        found = found._replace(scene=scene, sampled=found.sampled or scene.sampled)
    return _checked(found)


def _of_recording(recording: Recording, by_sensors: bool) -> Measured:
    name = str(recording.path)
    if not recording.whole:
        why = f"resets: {recording.resets}" if recording.resets else "not all ticks of its run"
        raise Refused(f"{name}: {why}; allowed: a bag of one run from its begin, with all of its ticks")
    answers = answers_of(recording)
    others = [side for side, found in answers.items() if found.differs]
    silent = [found.topic for found in answers.values() if not found.commands]
    why_unknown = ""
    if recording.changes:
        why_unknown = "numbers were set while it ran"
    elif not recording.running.lockstep:
        why_unknown = "commands came by the wall clock"
    elif others:
        why_unknown = f"another law acted on the {' and the '.join(others)} arm"
    elif silent:
        why_unknown = f"no message on {' and '.join(silent)} says which law acted"
    state = recording.measured if by_sensors else recording.state
    return Measured(name, recording.scene, recording.t, state, recording.inputs[:-1], True, why_unknown)


def _of_trajectory(run: Trajectory, name: str) -> Measured:
    ticks = tick_times(run.scene)[: len(run.t)]
    held = run.sampled and np.array_equal(run.t, ticks)
    why_unknown = "other controllers acted" if run.controllers else ""
    inputs = run.inputs[: len(run.t) - 1] if held else None
    return Measured(name, run.scene, run.t, run.state, inputs, run.sampled, why_unknown)


def _of_table(path: Path, scene: Scene) -> Measured:
    """Columns as `Trajectory.to_csv` names them: the time, states, and the inputs of a scene that holds them.

    Inputs change at the ticks, from which their times may differ by a rounding. A body that nothing drives needs none.
    """
    columns = _columns(path)
    t, inputs = columns[T], None
    missing = np.full(len(t), np.nan)
    state = np.stack([columns.get(name, missing) for name in CHANNELS], axis=1)
    has_inputs = not columns.keys().isdisjoint((*INPUTS, *COMMANDS))
    if scene.sampled and has_inputs:
        driven = {*scene.system.laws, *(force.body for force in scene.system.external)}
        lacks = [name for body, name in enumerate(INPUTS) if body in driven and name not in columns]
        if lacks:
            raise Refused(f"{path}: no column {', '.join(lacks)}, the force that acted; allowed: one for each body that"
                          " is driven, or neither forces nor commands")
        ticks = tick_times(scene)[: len(t)]
        if len(ticks) < len(t) or not (np.abs(t - ticks) <= ROUNDED * scene.time_of(1)).all():
            raise Refused(f"{path}: {T}: not the ticks of {scene.name}, every"
                          f" {scene.time_of(1):g} s from 0 to {scene.duration:g} s, at which its inputs change")
        t, nothing = ticks, np.zeros(len(t))
        inputs = np.stack([columns.get(name, nothing) for name in INPUTS], axis=1)[:-1]
    return Measured(str(path), scene, t, state, inputs, scene.sampled, unused=has_inputs and not scene.sampled)


def _columns(path: Path) -> Mapping[str, Array]:
    """Numbers (n,) by the names in the first line; NaN where nothing stands."""
    with decoding(path, "a table", also=(csv.Error,)), reading(path):
        heads, *lines = [*csv.reader(path.read_text(encoding="utf-8-sig").splitlines())] or [[""]]
    names = [*map(str.strip, heads)]
    if T not in names or not {*CHANNELS} & {*names}:
        raise Refused(f"{path}: line 1: {', '.join(names)}; allowed: {T} and at least one of {', '.join(CHANNELS)},"
                      " with commas between them")
    for column, name in enumerate(names):
        if name not in HEADS.values():
            raise Refused(f"{path}: column {name!r}: not known; {allowed(name, [*HEADS.values()])}")
        if name in names[:column]:
            raise Refused(f"{path}: line 1: {', '.join(names)}; allowed: each name once")
    rows = []
    for number, line in enumerate(lines, 2):
        if not line:  # an empty one
            continue
        if len(line) != len(names):
            raise Refused(f"{path}: line {number}: {len(line)} entries; allowed: {len(names)}")
        try:
            rows.append([given.read_number(word.strip() or "nan") for word in line])
        except ValueError as error:
            raise Refused(f"{path}: line {number}: {error}; allowed: numbers") from None
    return dict(zip(names, np.array(rows, dtype=float).reshape(-1, len(names)).T, strict=True))


def _checked(found: Measured) -> Measured:
    """Refuse what no fit can use."""
    name, present = found.name, found.scene.system.present
    if len(found.t) < FEWEST:
        raise Refused(f"{name}: {len(found.t)} samples; allowed: at least {FEWEST}")
    t = given.ascending(f"{name}: {T}", found.t, found.scene.duration, strictly=True)
    found = found._replace(t=t)  # kernels read a row of numbers, no column of a table
    for column, channel in enumerate(CHANNELS):
        gone = ~(np.abs(found.state[:, column]) <= LARGEST_POSITION)
        if gone.any() and not np.isnan(found.state[:, column]).all():
            at = int(np.argmax(gone))
            raise Refused(f"{name}: {channel}: {float(found.state[at, column])!r} at t = {t[at]:g} s; allowed: numbers"
                          f" throughout, of a size <= {LARGEST_POSITION:g}, or a column that is not there")
        if not gone.any() and BODIES[column // 2] not in present:
            raise Refused(f"{name}: {channel}: {found.scene.name} has no such body")
    if not found.channels:
        raise Refused(f"{name}: no state is measured")
    for kind, part in (("positions", 0), ("velocities", 1)):
        columns = [column for column in found.channels if column % 2 == part]
        if columns and not np.ptp(found.state[:, columns], axis=0).any():
            raise Refused(f"{name}: {kind} do not change; allowed: a motion, or no such columns")
    if found.inputs is not None and not np.isfinite(found.inputs).all():
        raise Refused(f"{name}: inputs are missing; allowed: a number for every control period")
    return found
