"""Verification of a bag: its scene is simulated again with the recorded inputs, whatever controller produced them.

Every state must have the same bits, and so must all that follows from states and commands: the forces that acted, the
impact forces, and what the monitor computed. Which law gave the commands is a question of its own, see `laws_of`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.graph.bag.recorder import WRITTEN
from grasp_ros.graph.bag.recording import Recording
from grasp_ros.physics.control import is_due
from grasp_ros.physics.energy import energy, energy_balance
from grasp_ros.physics.given import instance
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array, Contact, impact_force, penetration
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene.effects.base import BODIES, SIDES
from grasp_ros.scene.topics import CHANGES, CLOCK, CONTACTS, EXTERNAL_FORCES, JOINT_STATES, LYAPUNOV, LYAPUNOV_NAMES
from grasp_ros.simulation import simulate
from grasp_ros.simulation.sampled_plant import SampledPlant


class Difference(NamedTuple):
    """One number that is not what it should be."""

    tick: int  # of the bag
    topic: str
    name: str
    recorded: float
    computed: float

    def __str__(self) -> str:
        return (f"tick {self.tick}, {self.topic}, {self.name}: recorded {self.recorded!r} ({self.recorded.hex()}),"
                f" computed {self.computed!r} ({self.computed.hex()})")


class Verification(NamedTuple):
    """What became of a bag that was simulated again."""

    ticks: int  # whose states were computed from the recorded inputs, and compared
    difference: Difference | None  # the first
    problem: str  # why not all of the bag could be compared; empty if all was
    answers: dict[str, Answers]  # whose commands these are, by side
    # Whether `simulate` gives its states and commands, those that it has; None: not known, of other laws, a reset, no
    # lockstep, missing commands, or of a begin that the bag lacks, in which another law may have acted.
    same: bool | None

    @property
    def holds(self) -> bool:
        """Whether everything was compared and is equal."""
        return self.difference is None and not self.problem and self.same is not False

    @property
    def words(self) -> str:
        """For a reader."""
        if self.difference is not None:
            return f"NOT EQUAL, first at {self.difference}"
        if not self.ticks:
            return f"nothing from the recorded inputs: {self.problem}"
        equal = f"{self.ticks} states follow from the recorded inputs, bit for bit"
        return f"{equal}; {self.problem}" if self.problem else equal


def check_recording(recording: object) -> Recording:
    """Refuse what is no recording."""
    return instance("recording", recording, Recording, "a Recording")  # type: ignore[no-any-return]


def verify(recording: Recording) -> Verification:
    """Simulate the scene of a bag with its recorded inputs, and compare every number that follows from them."""
    ticks, difference = 0, None
    lost = _lost(check_recording(recording))
    problem = _gap(recording, lost)
    for rows in _episodes(recording):
        states, stop = _simulate(recording, rows)
        ticks += len(states)
        problem = problem or stop
        difference = _first_difference(recording, rows[: len(states)], states, lost)
        if difference is not None:
            break
    answers = answers_of(recording)
    return Verification(ticks, difference, problem, answers, _same_without_ros(recording, answers))


class Answers(NamedTuple):
    """How many commands of a controller are those of the law that the scene, or an announcement, names."""

    commands: int  # in the bag
    own: int | None  # those of the law; None: a free run, where they act when they come and are not compared
    lost: int  # announcements of its numbers that the bag lacks, as far as that may be why commands differ
    topic: str

    @property
    def differs(self) -> bool:
        """Whether some command is another one, or may be."""
        return self.own is not None and self.own < self.commands

    def __str__(self) -> str:
        if self.own is None:
            return "not compared: in a free run a command acts when it comes"
        if not self.commands:
            return f"not known: the bag has no message on {self.topic}"
        if not self.differs:
            return "the scene's law"
        if self.lost:
            return f"not known: the bag lacks {self.lost} announcements of its numbers"
        others = f"{self.commands - self.own} of {self.commands} commands on {self.topic}"
        return f"not the scene's law: {others} differ"


def answers_of(recording: Recording) -> dict[str, Answers]:
    """Whose law gave the commands, by side: compared with the law that the scene or an announcement names."""
    found = {}
    for name, topic in check_recording(recording).scene.controllers.items():
        side = name.removesuffix("_controller")
        if not recording.running.lockstep:
            found[side] = Answers(recording.counts[topic.name], None, 0, topic.name)
            continue
        body, equal = SIDES[side], 0
        forces = recording.command[:, body].tolist()
        before = [*forces[:1], *forces[:-1]]  # whether the first one is held is not known in the bag of a late monitor
        for scene, rows in recording.parts:
            law, states = scene.system.laws[body], recording.state[rows, COLUMN[body] :][:, :2]
            given = zip(recording.scene_tick[rows].tolist(), states.tolist(), before[rows], forces[rows], strict=True)
            equal += sum(bool((law.command(tick, x, v) if is_due(law.row, tick) else last) == force)
                         for tick, (x, v), last, force in given)
        there = int(np.count_nonzero(~np.isnan(recording.command[:, body])))
        found[side] = Answers(there, equal, recording.unheard.get(CHANGES[side].name, 0), topic.name)
    return found


def _same_without_ros(recording: Recording, answers: dict[str, Answers]) -> bool | None:
    """Whether the scene with its own laws has the recorded states and commands, without a graph."""
    others = any(found.differs or found.lost or found.commands < len(recording.tick) for found in answers.values())
    late = recording.resets or recording.tick[-1] > recording.scene.ticks
    if others or late or not recording.running.lockstep:
        return None
    run = simulate(recording.scene, sampled=True, grid=recording.t, setting=recording.running.accuracy,
                   changes=recording.changes)
    equal = run.state.tobytes() == recording.state.tobytes() and run.command.tobytes() == recording.command.tobytes()
    return equal or (False if recording.whole else None)


def laws_of(recording: Recording) -> dict[str, str]:
    """Whether the commands are those of the scene's law, in words, by side; see `answers_of`."""
    return {side: str(answers) for side, answers in answers_of(recording).items()}


def _gap(recording: Recording, lost: Mapping[str, np.ndarray]) -> str:
    """What cannot be verified because the bag does not hold it."""
    if not len(recording.starts) or recording.starts[0] != recording.tick[0]:
        return f"the bag begins at tick {recording.tick[0]}, not at the beginning of the scene"
    missing = np.flatnonzero(np.diff(recording.tick) != 1)
    if len(missing):
        return f"tick {recording.tick[missing[0]] + 1} is missing: what acted then is not known"
    words = [f"{name} of {np.count_nonzero(rows)} ticks, the first {recording.tick[np.argmax(rows)]}"
             for name, rows in lost.items() if rows.any()]
    words += [f"{topic.name} of {without} ticks" for topic in (CLOCK, JOINT_STATES)
              if (without := recording.missing[topic.name])]
    words += [f"{number} announcements on {name}" for name, number in recording.unheard.items()]
    if cut := recording.missing.get(WRITTEN):
        words.append(f"{cut} messages that its recorder has written")
    for side, forces in recording.held.items():
        if (unknown := ~np.isin(recording.effort[:, SIDES[side]], [0.0, *forces])).any():
            words.append(f"commands of {side} that acted, the first at tick {recording.tick[np.argmax(unknown)]}")
    return f"the bag lacks {' and '.join(words)}" if words else ""


def _lost(recording: Recording) -> dict[str, np.ndarray]:
    """Whether the message of a tick (n,) is lost, by topic: a bag holds no NaN, but for V of unknown laws."""
    columns = {**recording.outputs}
    if recording.running.lockstep:
        columns |= {topic.name: recording.command[:, SIDES[name.removesuffix("_controller")]]
                    for name, topic in recording.scene.controllers.items()}
    return {**{name: np.isnan(values) for name, values in columns.items()},
            LYAPUNOV.name: np.asarray(np.isnan(recording.lyapunov).all(axis=1))}


def _episodes(recording: Recording) -> Iterator[np.ndarray]:
    """Rows of the bag from each beginning of the scene to the next, or to a gap."""
    begins = np.searchsorted(recording.tick, recording.starts)
    for begin, end in pairwise([*begins, len(recording.tick)]):
        rows = np.arange(begin, end)
        gaps = np.flatnonzero(np.diff(recording.tick[rows]) != 1)
        yield rows[: gaps[0] + 1] if len(gaps) else rows


def _simulate(recording: Recording, rows: np.ndarray) -> tuple[Array, str]:
    """States (k, 6) that follow from the inputs, as far as the integrator comes, and why it stopped."""
    scene, system = recording.scene, copy(recording.scene.system)
    system.delay = 0  # what is recorded are the forces that acted
    integrator = Integrator(system, continuous=False, accuracy=recording.running.accuracy)
    plant = SampledPlant(system, scene.period_ns, integrator)
    acted = np.zeros((len(rows) - 1, 3))
    acted[:, [LEFT, RIGHT]] = recording.effort[rows[1:]]
    states = plant.follow(acted)
    if plant.status is not Status.DONE:
        return states, plant.stop
    return np.concatenate([states, plant.state[None]]), ""


def _first_difference(
    recording: Recording, rows: np.ndarray, states: Array, lost: Mapping[str, np.ndarray]
) -> Difference | None:
    """The first number of an episode that does not follow from its inputs; not of messages that are lost."""
    found = []
    for topic, name, *pair in _columns(recording, rows, states):
        recorded, computed = (np.ascontiguousarray(numbers, dtype=float) for numbers in pair)
        same = (recorded.view(np.int64) == computed.view(np.int64)) | (np.isnan(recorded) & np.isnan(computed))
        if topic in lost:  # which `_gap` names
            same |= lost[topic][rows]
        if not same.all():
            at = int(np.argmin(same))
            tick = int(recording.tick[rows[at]])
            found.append(Difference(tick, topic, name, float(recorded[at]), float(computed[at])))
    return min(found, key=lambda difference: difference.tick, default=None)


def _columns(recording: Recording, rows: np.ndarray, states: Array) -> Iterator[tuple[str, str, Array, Array]]:
    """Everything of an episode that follows from its inputs: topic, name, what was recorded, what it should be."""
    system = recording.scene.system
    for body in system.present:
        for column, name in enumerate(("position", "velocity"), COLUMN[body]):
            yield (JOINT_STATES.name, f"{NAMES[body]} {name}", recording.state[rows, column], states[:, column])
    if recording.running.lockstep:  # the force that acted until a tick is the command that had arrived: after the delay
        wait = system.delay + 1
        for body in system.laws:
            acted = np.concatenate([np.zeros(wait), recording.command[rows, body]])[: len(rows)]
            effort = recording.effort[rows, body]
            yield (JOINT_STATES.name, f"{NAMES[body]} effort", effort, np.where(np.isnan(acted), effort, acted))
    u_l, d_l, u_r, d_r = penetration(states)
    for side, u, d in (("left", u_l, d_l), ("right", u_r, d_r)):
        if (topic := CONTACTS[side].name) in recording.outputs:
            force = impact_force(Contact(*system.pairs[SIDES[side]]), u, d)
            yield (topic, "force", recording.outputs[topic][rows], force)
    external = system.external_over(np.arange(len(rows)))
    for name, body in BODIES.items():
        if (topic := EXTERNAL_FORCES[name].name) in recording.outputs:
            yield (topic, "force", recording.outputs[topic][rows], external[:, body])
    for column, values in enumerate(_lyapunov(recording, rows, states, external)):
        yield (LYAPUNOV.name, LYAPUNOV_NAMES[column], recording.lyapunov[rows, column], values)


def _lyapunov(recording: Recording, rows: np.ndarray, states: Array, external: Array) -> list[Array]:
    """What the monitor has computed, by LYAPUNOV_NAMES; `closed` is what it knew, so that only 0 and 1 are compared."""
    system = recording.scene.system
    closed = recording.law_known[rows]
    V, parts = np.full((3, len(rows)), np.nan), recording.parts
    if recording.unheard:  # of numbers that nobody knows: what the monitor says stands
        V, parts = recording.lyapunov[rows, :3].T, []
    for scene, part in parts:
        own = closed & (rows >= part.start) & (rows < part.stop)
        if own.any():
            V[:, own] = energy(scene.system, states[own], external[own])[:3]
    held = external[:-1].copy()
    held[:, [LEFT, RIGHT]] += recording.effort[rows[1:]]
    balance = energy_balance(system, states[:-1], states[1:], held)
    residual, alarm, work = (np.append(0.0, part) for part in (balance.residual, balance.alarm, balance.work))
    alone = energy(system, states, external, feedback=False)
    return [*V, alone.mode, residual, alarm, alone.V_c, work, closed]
