"""Free-running: the plant follows the wall clock, and the last command of each controller is held.

A period is computed when its wall time has passed, with the commands that are there then. So a controller that answers
within a period acts as in lockstep; a later one acts later, and its age says by how much. A plant that is late itself
makes up for it as fast as the controllers answer that keep up, so that their commands do not age with it.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from grasp_ros.graph.health.peers import Need
from grasp_ros.graph.lockstep.loop import Commands, Loop
from grasp_ros.graph.parameters import Running
from grasp_ros.graph.serialization import list_message, raw_command
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.topics import LYAPUNOV, TIMING, timing_names

if TYPE_CHECKING:  # it imports this one
    from grasp_ros.graph.nodes.plant import Plant

SHORTEST_SECONDS = 5e-4  # between looks at the clock
LOOKS = 2  # at the clock in a period
GRACE = 0.75  # of a period: how long a late plant waits for an answer; the rest makes up for what it is late
KEEPS_UP = 3  # periods that the last answer of a controller may be old for the next one to be waited for
BURST_SECONDS = 0.003  # of catching up at a time, so that commands and services get their turn
TURN_SECONDS = 0.001  # that they get after a period that takes far longer by itself
PATIENCE_SECONDS = 0.5  # further behind than this the plant gives up wall time, never a state
PERCENTILE = 99.0
OLDEST = 10_000  # periods that are told apart in the ages of commands


class FreeRunning(Loop):
    """Advances the plant with the wall clock; if it `waits`, from when each side has sent a command."""

    def __init__(self, plant: Plant, paused: bool, running: Running, waits: bool) -> None:
        super().__init__(plant, paused)
        self._running, self._awaits = running, waits and bool(plant.scene.controllers)
        self._period = plant.scene.period_ns / NANOSECONDS / running.real_time_factor  # s of wall time
        plant.counters.update({"stale commands": 0, "refused commands": 0, "commands beyond a limit": 0,
                               "timeouts": 0})
        self._timing = Timing([own.side for own in self._commands], self._period, running.real_time_factor)
        self._quality = plant.publisher(TIMING)
        self._anchor = math.nan  # wall time of tick 0
        self._turn = 0.0  # wall time up to which others have their turn

    def missing(self) -> list[str]:
        """Commands that nobody sends yet, where it waits for them; else it begins without controllers."""
        awaited = self._commands if self._awaits else ()
        return [own.topic.name for own in awaited if not self._plant.writers(own.topic)]

    def needs(self) -> Iterator[Need]:
        """The monitor, and first commands where it waits for them; later ones have timeouts of their own."""
        if self._awaits:
            for own in self._commands:
                due = math.inf if own.received else self._plant.published_at
                yield Need(own.topic, "first command", due, first=True, replaceable=True)
        if self._plant.monitored:
            due = self._plant.published_at if self._awaits and self.answered else math.inf
            yield Need(LYAPUNOV, "sign of having had a command of each side", due, first=True)

    def ask_again(self, now: float) -> None:
        """Publish a state again while it waits for an answer to it: the first one, and one that is to be reset."""
        if self._awaits or self.reset_due:
            self._plant.repeat()

    def start(self) -> None:
        """Look at the clock from now on; it runs once nobody is waited for."""
        self._plant.wall_timer(max(self._period / LOOKS, SHORTEST_SECONDS), self.advance)

    def _on_command(self, own: Commands, cdr: bytes) -> None:
        plant, command = self._plant, raw_command(cdr)
        stamp, force = command or (0, math.nan)
        tick = stamp // plant.scene.period_ns if stamp else plant.tick
        if command is None or (tick > plant.tick and not plant.resets):  # else it may come from before a reset
            plant.refuse("refused commands", own.topic)
        elif not own.answers <= tick <= plant.tick:
            plant.count("stale commands")
        elif own.admit(force):
            own.force, own.answers, own.received = force, tick, True
            self.answered = self.answered or all(own.received for own in self._commands)
            if self._awaits and self.answered:  # DDS may connect a controller with the monitor seconds after the plant
                heard = {name for beat in plant.heartbeats.alive for name in beat.hears}
                self._awaits = plant.monitored and not heard >= {each.topic.name for each in self._commands}
            self.advance()

    def advance(self) -> None:
        """Compute the periods that are over."""
        plant = self._plant
        if plant.finished or not plant.begun or self._awaits:
            return
        if resetting := self.reset_due:
            if plant.outrun(0):  # it would take what comes after a reset for what came before: the stamps are the same
                return
            self.reset_done()
        if resetting or self.halted or math.isnan(self._anchor):
            self._timing.pause()
            self._anchor = time.monotonic() - plant.tick * self._period
        if not self.halted:
            self._catch_up()

    def _catch_up(self) -> None:
        plant, begin = self._plant, time.monotonic()
        if begin < self._turn:
            return
        late = begin - self._anchor - (plant.tick + 1) * self._period
        if late > PATIENCE_SECONDS:
            self._timing.lost += late
            self._anchor += late
        while not plant.finished and (now := time.monotonic()) < begin + BURST_SECONDS:
            due = self._anchor + (plant.tick + 1) * self._period
            if now < due or plant.outrun() or (now - due > self._period and self._waits(now)):
                return
            if not self.go_on():
                return
            if plant.at_end:
                plant.finish()
                return
            self._timing.period(now, now - due)
            self._compute()
        if time.monotonic() > begin + 2.0 * BURST_SECONDS:  # the timer is due again, before all else
            self._turn = time.monotonic() + TURN_SECONDS

    def _waits(self, now: float) -> bool:
        """Whether a controller that keeps up is about to answer the current state."""
        tick = self._plant.tick
        return now - self._plant.published_at < GRACE * self._period and any(
            0 < tick - own.answers <= KEEPS_UP and not own.late for own in self._commands
        )

    def _compute(self) -> None:
        plant, forces = self._plant, np.zeros(3)
        for own in self._commands:
            seconds, reaction = self._running.timeouts[own.side], self._running.reactions[own.side]
            before, age = own.late, plant.tick - own.answers
            own.late = age >= max(1, math.ceil(seconds * NANOSECONDS / plant.scene.period_ns))
            if own.late and not before:
                plant.count("timeouts")
                words = f"{own.side}: no command newer than {seconds:g} s at tick {plant.tick}; reaction: {reaction}"
                (plant.fail if reaction == "stop" else plant.get_logger().warning)(words)
            forces[own.body] = 0.0 if own.late and reaction == "zero" else own.force
            self._timing.age(own.side, age, own.late)
        if plant.finished:
            return
        if plant.tick + 1 == plant.scene.ticks:
            self.report()
            plant.flush(self._quality)  # before the last state, with which a monitor closes its bag
        plant.step(forces)

    def report(self) -> None:
        """Publish the quality of the last second; say whose commands are missing."""
        late = [f"no recent command of {own.side}" for own in self._commands if own.late]
        self._plant.concern = "; ".join(late)
        if values := self._timing.take():
            time_ns = self._plant.tick * self._plant.scene.period_ns
            self._quality.publish(list_message(time_ns, [*values], [*values.values()]))


class Timing:
    """How well the plant keeps its time; `period` in s of wall time, `factor` as it is asked for."""

    def __init__(self, sides: Sequence[str], period: float, factor: float) -> None:
        self._period, self._factor = period, factor
        self.lost = 0.0  # wall time given up, s; all from here on are since the start
        self._overruns, self._spent, self._counted = 0, 0.0, 0  # the last two: time and number of all intervals
        self._all: dict[str, Counter[int]] = {side: Counter() for side in sides}  # how often commands had an age
        self._timed_out: Counter[str] = Counter()
        self._ages: dict[str, Counter[int]] = {side: Counter() for side in sides}  # from here on since the last `take`
        self._intervals: list[float] = []
        self._lateness: list[float] = []
        self._before = math.nan

    def period(self, now: float, late: float) -> None:
        """One control period, computed at a wall time in s, late by so much."""
        if not math.isnan(self._before):
            self._intervals.append(now - self._before)
            self._spent, self._counted = self._spent + now - self._before, self._counted + 1
        self._before = now
        self._lateness.append(late)
        self._overruns += late > self._period

    def pause(self) -> None:
        """The plant is paused, or was put back: the interval until it goes on is not one of its periods."""
        self._before = math.nan

    def age(self, side: str, periods: int, timed_out: bool) -> None:
        """Age of the last command in control periods: how much older the state is that it answers."""
        self._ages[side][min(periods, OLDEST)] += 1
        self._timed_out[side] += timed_out

    def take(self) -> dict[str, float]:
        """What was collected since the last call, by name; nothing where there was no period.

        `reached` are the simulated seconds per second since the start, without pauses; `period_s` is the mean
        interval, `jitter_s` its standard deviation, `late_p99_s` how late the periods were computed, `overruns` how
        many were later than a whole period since the start, and `left_age_p99` and so on the age of the commands in
        periods; `left_age_p99_all` and `left_age_max_all` are those since the start, and `left_timed_out_all` in how
        many periods it was older than the timeout.
        """
        if not self._lateness or not self._intervals:
            return {}
        values = [
            float(np.mean(self._intervals)), float(np.std(self._intervals)),
            float(np.percentile(self._lateness, PERCENTILE)), float(self._overruns), self.lost,
            self._factor * self._period * self._counted / self._spent,
        ]
        for side, ages in self._ages.items():
            self._all[side].update(ages)
            for found in (ages, self._all[side]):
                known, often = [*found], [*found.values()]
                values.append(float(  # the smallest that PERCENTILE of them do not exceed
                    np.percentile(known, PERCENTILE, weights=often, method="inverted_cdf")
                ))
                values.append(float(max(known)))
            values.append(float(self._timed_out[side]))
            ages.clear()
        self._intervals.clear()
        self._lateness.clear()
        return dict(zip(timing_names(self._ages), values, strict=True))
