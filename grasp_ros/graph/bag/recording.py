"""What is in a bag, as arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.graph.bag.recorder import NOT_RECORDED, WRITTEN
from grasp_ros.graph.parameters import Running
from grasp_ros.physics.energy import PLANT_ALONE, PLANT_AND_FEEDBACK, Energy, energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.frozen import Frozen
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene.effects.base import BODIES, SIDES
from grasp_ros.scene.topics import CLOCK, CONTACTS, DIAGNOSTICS, EXTERNAL_FORCES, LYAPUNOV_NAMES, TIMING
from grasp_ros.simulation import Trajectory, simulate
from grasp_ros.simulation.tables import Motion


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Motion, Frozen):
    """The contents of a bag.

    Attributes
    ----------
    path : Path
    scene : Scene
    versions : dict of str to str
        Software versions of the recording process.
    counts : dict of str to int
        Messages by topic.
    tick : int array (n,)
        Ticks whose state is in the bag.
    state : array (n, 6), m and m/s
        NaN for a body that is not there.
    effort, command : arrays (n, 2), N
        Forces of the controllers that acted until the tick, commands answered to it, which act later if there is a
        delay; 0 without a controller, NaN where missing. In a free run a command answers no tick: it is the force that
        acted from the tick on.
    outputs : dict of str to array (n,), N
        Impact and external forces by topic; NaN where missing.
    lyapunov : array (n, 9)
        What the monitor computed, see `topics.LYAPUNOV_NAMES`; NaN where missing.
    changes : dict of int to dict of str to float
        Numbers that were set while the graph ran, by the tick from which they act.
    running : Running
        How the plant ran: in lockstep or with the wall clock, and with which accuracy.
    starts : int array (k,)
        Ticks of the bag at which the plant began the scene, again after each reset; the first is 0 in a bag that has
        the beginning. `tick` and `t` go on where a reset puts simulated time back.
    timing : dict of str to array (m,)
        What a free run has published of its quality, about once a second, see `free_running.Timing`; empty in lockstep.
    held : dict of str to array (m,), N
        Commands of a free run by side, as they came; empty in lockstep.
    unheard : dict of str to int
        How many announcements of changed numbers the bag lacks, by topic, as far as their numbers show it.
    lost : dict of str to str
        How the recording ended and what is missing from it, as the bag itself says; if it was not closed, what the
        reader has found.
    """

    path: Path
    scene: scenes.Scene
    versions: dict[str, str]
    counts: dict[str, int]
    tick: np.ndarray
    state: Array
    effort: Array
    command: Array
    outputs: dict[str, Array]
    lyapunov: Array
    changes: dict[int, dict[str, float]]
    running: Running
    starts: np.ndarray
    lost: dict[str, str]
    timing: dict[str, Array]
    unheard: dict[str, int]
    held: dict[str, Array]

    @cached_property
    def t(self) -> Array:
        """Times in s."""
        return np.array([self.scene.time_of(tick) for tick in self.tick.tolist()])

    @cached_property
    def inputs(self) -> Array:
        """What acted on the bodies from each tick to the next: forces (n, 3) in N by body, LEFT, RIGHT, OBJECT.

        The commands that had arrived, which the next tick names as its effort, and the external forces. NaN where the
        bag does not hold the next tick: at its end, and before a gap. `simulation.Trajectory.inputs` is the same.
        """
        inputs = np.zeros((len(self.tick), 3))
        inputs[:, [LEFT, RIGHT]] = acted_from(self.tick, self.effort)
        external = {body: EXTERNAL_FORCES[name].name for name, body in BODIES.items()}
        if any(topic in self.outputs for topic in external.values()):
            nothing = np.zeros(len(self.tick))
            inputs += np.stack([self.outputs.get(external[body], nothing) for body in (LEFT, RIGHT, OBJECT)], axis=1)
        inputs[np.append(np.diff(self.tick) != 1, True)] = np.nan
        return inputs

    @cached_property
    def scene_tick(self) -> np.ndarray:
        """Ticks (n,) of the scene: those of the bag since the last reset."""
        begins = np.union1d(0, self.starts)  # a bag of a late monitor lacks the first one
        return np.asarray(self.tick - begins[np.searchsorted(begins, self.tick, side="right") - 1])

    @cached_property
    def parts(self) -> list[tuple[scenes.Scene, slice]]:
        """The scene with the numbers in force, and the rows of the ticks at which they were; in their order."""
        changes = sorted(self.changes)
        bounds = [0, *np.searchsorted(self.tick, changes).tolist(), len(self.tick)]
        known = accumulate(changes, lambda scene, tick: scene.changed(self.changes[tick]), initial=self.scene)
        return [(scene, slice(*rows)) for scene, rows in zip(known, pairwise(bounds), strict=True)]

    @cached_property
    def measured(self) -> Array:
        """What the sensors of the scene made of the states (n, 6), m and m/s; NaN for a body that none measures.

        This is what the laws were given. Noise is drawn from the seed of the scene and the tick, so it is the same here
        as in the controllers, which measure the exact states that they receive. A node that is not ours does not.
        """
        measured = np.full_like(self.state, np.nan)
        for scene, rows in self.parts:
            for side, law in scene.system.laws.items():
                own = slice(COLUMN[side], COLUMN[side] + 2)
                ticks, states = self.scene_tick[rows].tolist(), self.state[rows, own].tolist()
                seen = [law.measured(tick, *state) for tick, state in zip(ticks, states, strict=True)]
                measured[rows, own] = np.reshape(seen, (-1, 2))
        return measured

    @property
    def impacts(self) -> Array:
        """Impact forces (n, 2) in N; 0 where there is no contact, NaN where missing."""
        none = np.zeros(len(self.tick))
        return np.stack([self.outputs.get(CONTACTS[side].name, none) for side in SIDES], axis=1)

    @property
    def origin(self) -> dict[str, Any]:
        """Which bag it is, and how the plant ran."""
        return {"bag": str(self.path), "run": self.running.words, "end": self.lost["end"]}

    def simulated(self) -> Trajectory:
        """The motion simulated again without ROS under the recorded forces: with events, contacts, sections, any time.

        Its states are those of the bag, bit for bit, if `verify` holds. Its commands are those after the delay.

        Raises
        ------
        Refused
            If a tick or a force is missing, or the plant was reset.
        """
        acted = acted_from(self.tick, self.effort)
        if not self.whole or len(self.tick) < 2 or not np.isfinite(acted[:-1]).all():
            why = f"resets: {self.resets}" if self.resets else "a tick or a force is missing"
            raise Refused(f"{self.path}: {why}; allowed: a bag of one run from its begin, with two ticks or more")
        wait = self.scene.system.delay
        forces = np.vstack([acted[wait:-1], np.zeros((1 + wait, 2))]).T.tolist()  # from the last tick on nothing acts
        laws = {side: lambda tick, *_, own=forces[body]: own[tick] for side, body in SIDES.items()
                if body in self.scene.system.laws}
        numbers = {"time.duration_s": float(self.t[-1])}
        for name, force in ((name, force) for now in self.changes.values() for name, force in now.items()):
            section, key = name.split(".")
            if key == "limit_N":  # it was raised: forces may exceed the first one
                numbers[name] = max(force, numbers.get(name, self.scene.values[section][key]))
        run = simulate(self.scene.changed(numbers), sampled=True, controllers=laws, setting=self.running.accuracy)
        return replace(run, controllers=dict.fromkeys(run.controllers, "as recorded"))

    @property
    def resets(self) -> int:
        """How often the plant was put back while it was recorded."""
        return int(np.count_nonzero(self.starts > 0))

    @property
    def whole(self) -> bool:
        """Whether it has every tick from the begin of the scene on, without a reset."""
        return self.starts.tolist() == [0] and not (np.diff(self.tick) != 1).any()

    @property
    def size(self) -> int:
        """Bytes of the bag on the disk."""
        files = self.path.iterdir() if self.path.is_dir() else [self.path]
        return sum(file.stat().st_size for file in files if file.is_file())

    @property
    def rates(self) -> dict[str, float]:
        """Mean rates of the messages in the bag's time, in Hz, by topic.

        NaN for one message alone, and for what goes by wall time.
        """
        span, others = float(self.t[-1] - self.t[0]) or math.nan, (DIAGNOSTICS.name, TIMING.name)
        return {name: (count - 1) / span if count > 1 and name not in others else math.nan
                for name, count in self.counts.items()}

    @property
    def reached(self) -> float:
        """Simulated seconds per second that a free run has reached, without pauses; NaN if it has not said it."""
        return float(self.timing["reached"][-1]) if "reached" in self.timing else math.nan

    @property
    def overruns(self) -> int:
        """Periods of a free run that were computed later than a whole period."""
        return int(self.timing["overruns"][-1]) if "overruns" in self.timing else 0

    @property
    def ages(self) -> dict[str, tuple[float, float]]:
        """By how many periods the states that commands answer are older: 99th percentile and largest, by side."""
        return {side: (float(self.timing[f"{side}_age_p99_all"][-1]), float(self.timing[f"{side}_age_max_all"][-1]))
                for side in SIDES if f"{side}_age_p99_all" in self.timing}

    @property
    def law_known(self) -> np.ndarray:
        """Whether the laws of the controllers were known and ran, by tick (n,)."""
        return np.asarray(self.lyapunov[:, LYAPUNOV_NAMES.index("closed")] == 1.0)

    @property
    def closed(self) -> bool:
        """Whether V belongs to laws that were known and ran, at every tick.

        In a free run they may be announced some ticks after a start, as long as nothing acts.
        """
        known = self.law_known
        if self.running.lockstep or not known.any():
            return bool(known.all())
        latest = np.maximum.accumulate(np.where(known, np.arange(len(known)), -1))
        before = latest < np.searchsorted(self.tick, self.tick - self.scene_tick)
        pushed = np.nan_to_num(acted_from(self.tick, self.effort)).any(axis=1) | self.effort.any(axis=1)
        return bool((known | (before & ~pushed)).all())

    @property
    def energy_of(self) -> str:
        """What `energy` is the energy of."""
        return PLANT_AND_FEEDBACK if self.closed else PLANT_ALONE

    @cached_property
    def energy(self) -> Energy:
        """V, V_c, V' and the contact mode at the ticks, from the states and the numbers that were in force.

        Of the plant alone, without its controllers, unless `closed`.
        """
        ticks, index = np.unique(self.scene_tick, return_inverse=True)
        external = self.scene.system.external_over(ticks)[index]
        if not self.closed:
            return energy(self.scene.system, self.state, external, feedback=False)
        if self.unheard:  # of numbers that nobody knows: what the monitor says stands
            V, V_c, V_rate = self.lyapunov[:, :3].T
            return Energy(V, V_c, V_rate, energy(self.scene.system, self.state, external).mode)
        parts = [energy(scene.system, self.state[rows], external[rows]) for scene, rows in self.parts]
        return Energy(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    @property
    def alarms(self) -> int:
        """Ticks at which the monitor found energy that the held forces do not explain."""
        return int(np.count_nonzero(self.lyapunov[:, LYAPUNOV_NAMES.index("alarm")] > 0.0))

    @property
    def timed_out(self) -> dict[str, int]:
        """Periods of a free run in which a side's command was older than its timeout, by side."""
        return {side: int(self.timing[f"{side}_timed_out_all"][-1])
                for side in SIDES if f"{side}_timed_out_all" in self.timing}

    @property
    def missing(self) -> dict[str, int]:
        """Ticks up to the last one without a message, by topic; of commands in a free run, if there is none at all.

        And what is `unheard`, and what the monitor says that it did not record, or did and is not there.
        """
        held = () if self.running.lockstep else [
            topic for side, topic in zip(self.scene.system.laws, self.scene.controllers.values(), strict=True)
            if self.counts[topic.name] or not np.nan_to_num(self.effort[:, side]).any()]
        every_tick = [topic.name for topic in (CLOCK, *self.scene.topics) if topic not in held]
        ticks = max(int(self.tick.max(initial=-1)) + 1, *(self.counts[name] for name in every_tick))
        there = sum(self.counts.values())
        others = {NOT_RECORDED: int(self.lost.get(NOT_RECORDED, 0)),
                  WRITTEN: max(int(self.lost.get(WRITTEN, there)) - there, 0)}
        return {**{name: ticks - self.counts[name] for name in every_tick}, **self.unheard,
                **{name: number for name, number in others.items() if number}}


def acted_from(ticks: np.ndarray, effort: Array) -> Array:
    """Forces that acted from each tick (n,) on, which the next one names as its effort; NaN where that is not there.

    Effort and result are arrays (n, ...) in N.
    """
    acted = np.full_like(effort, np.nan)
    acted[:-1] = effort[1:]
    acted[:-1][np.diff(ticks) != 1] = np.nan
    return acted
