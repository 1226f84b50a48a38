"""External forces on a body: a pulse, a sine or a table, each constant over a control period.

Because a force changes at ticks only, the motion between them stays exact, and its work is known from the states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import ExternalForce, System
from grasp_ros.scene.effects.base import (
    BODIES,
    NANOSECONDS,
    Effect,
    Output,
    Parameter,
    Relation,
    Sections,
    oddity,
    problem,
)
from grasp_ros.scene.effects.time import is_tick, nanoseconds, period_ns
from grasp_ros.scene.topics import EXTERNAL_FORCES

PULSE = (
    Parameter("force_N", *RANGES["force"].bounds, "force, positive to the right"),
    Parameter("start_s", *RANGES["duration"].bounds, "begin of the pulse"),
    Parameter("length_s", *RANGES["duration"].bounds, "length of the pulse", open_low=True),
)
SINE = (
    Parameter("amplitude_N", 0.0, RANGES["force"].high, "amplitude"),
    Parameter("frequency_Hz", 0.0, 1e6, "frequency", open_low=True),
    Parameter("phase_rad", -1e3, 1e3, "phase at t = 0", optional=True),
)
TABLE = (
    Parameter("time_s", *RANGES["duration"].bounds, "times from which the forces act, ascending", several=True),
    Parameter("force_N", *RANGES["force"].bounds, "forces, each until the next time, the last one for good",
              several=True),
)

NEVER = "is not before the run's end: no force acts"


def _add(force: ExternalForce, system: System) -> None:
    system.external.append(force)
    system.caveats.append(f"{force.section} does work")


def _build_steps(section: str, body: int, sections: Sections, system: System) -> None:
    """A force from each tick to the next: those of a table, or of a pulse, which is one of two entries."""
    numbers, period = sections[section], period_ns(sections)
    if "time_s" in numbers:
        starts, forces = [nanoseconds(time) // period for time in numbers["time_s"]], (0.0, *numbers["force_N"])
    else:
        begin = nanoseconds(numbers["start_s"]) // period
        starts, forces = [begin, begin + nanoseconds(numbers["length_s"]) // period], (0.0, numbers["force_N"], 0.0)
    begins, values = np.array(starts), np.array(forces, dtype=float)
    _add(ExternalForce(section, body, lambda ticks: values[np.searchsorted(begins, ticks, side="right")],
                       lambda end: [tick for tick in starts if 0 < tick < end]), system)


def _build_sine(section: str, body: int, sections: Sections, system: System) -> None:
    """A staircase: each step has the value at the middle of its control period."""
    numbers = sections[section]
    turn = 2.0 * math.pi * numbers["frequency_Hz"] * period_ns(sections) / NANOSECONDS
    phase = numbers.get("phase_rad", 0.0)

    def at(ticks: NDArray[np.int64]) -> Array:
        return np.array([numbers["amplitude_N"] * math.sin(turn * (tick + 0.5) + phase) for tick in ticks.tolist()])

    _add(ExternalForce(section, body, at, lambda end: range(1, end)), system)


def _off_tick(keys: tuple[str, ...], section: str, sections: Sections) -> Iterable[str]:
    for key in keys:
        value = sections[section][key]
        times = value if isinstance(value, tuple) else (value,)
        off = next((time for time in times if not is_tick(time, sections)), None)
        if off is not None:
            period = sections["time"]["control_period_s"]
            yield problem(f"{section}.{key}", off, f"whole control periods of {period!r} s")


def _unsorted(section: str, sections: Sections) -> Iterable[str]:
    times = sections[section]["time_s"]
    if any(later <= earlier for earlier, later in pairwise(times)):
        yield problem(f"{section}.time_s", times, "ascending times")


def _unpaired(section: str, sections: Sections) -> Iterable[str]:
    times, forces = sections[section]["time_s"], sections[section]["force_N"]
    if len(times) != len(forces):
        yield problem(f"{section}.force_N", forces, f"as many forces as times, {len(times)}")


def _too_fast(section: str, sections: Sections) -> Iterable[str]:
    frequency, highest = sections[section]["frequency_Hz"], 0.5 * NANOSECONDS / period_ns(sections)
    if frequency > highest:
        allowed = f"at most {highest!r} Hz, half a turn per control period of time.control_period_s"
        yield problem(f"{section}.frequency_Hz", frequency, allowed)


def _odd_pulse(section: str, sections: Sections, _: System) -> Iterable[str]:
    start, length, end = sections[section]["start_s"], sections[section]["length_s"], sections["time"]["duration_s"]
    over = nanoseconds(start) + nanoseconds(length) - nanoseconds(end)
    if start >= end:
        yield oddity(f"{section}.start_s", start, NEVER, f"before time.duration_s, {end!r}")
    elif over > 0:
        why = f"reaches {over / NANOSECONDS!r} s beyond the end of the run"
        yield oddity(f"{section}.length_s", length, why, f"an end by time.duration_s, {end!r}")


def _odd_table(section: str, sections: Sections, _: System) -> Iterable[str]:
    times, forces, end = sections[section]["time_s"], sections[section]["force_N"], sections["time"]["duration_s"]
    late = [(time, force) for time, force in zip(times, forces, strict=True) if time >= end]
    idle = [time for time, force in late if force != 0.0 or time > end]  # 0 at the end closes it
    key, meant = f"{section}.time_s", f"before time.duration_s, {end!r}"
    if not any(forces[: len(forces) - len(late)]):
        yield oddity(key, next(time for time, force in late if force != 0.0), NEVER, f"a begin {meant}")
    elif idle:
        yield oddity(key, idle[0], "is not before the run's end: its force never acts", f"a last time {meant}")


TICKS = "an external force changes at ticks only"
# By kind of force: what, why, and what is wrong in a section.
RELATIONS: dict[str, tuple[tuple[str, str, Callable[[str, Sections], Iterable[str]]], ...]] = {
    "pulse": (
        ("`start_s` and `length_s` are whole control periods", TICKS, partial(_off_tick, ("start_s", "length_s"))),
    ),
    "sine": (
        ("`frequency_Hz` is at most half a turn per control period",
         "with one value per control period, a faster sine is the same as a slower one", _too_fast),
    ),
    "table": (
        ("all of `time_s` are whole control periods", TICKS, partial(_off_tick, ("time_s",))),
        ("`time_s` is ascending", "each force acts until the next time", _unsorted),
        ("`force_N` has as many entries as `time_s`", "each time has its force", _unpaired),
    ),
}


def _effects(name: str, body: int) -> Iterable[Effect]:
    outputs = (Output(EXTERNAL_FORCES[name], lambda system, tick, _: float(system.external_at(tick)[body])),)
    work = "the force does work: V_c rises by at most twice its work"
    for kind, parameters, size, build, odd, example in (
        ("pulse", PULSE, "force_N", _build_steps, _odd_pulse, {"force_N": 2.0, "start_s": 0.5, "length_s": 0.1}),
        ("sine", SINE, "amplitude_N", _build_sine, lambda *_: (), {"amplitude_N": 1.0, "frequency_Hz": 2.0}),
        ("table", TABLE, "force_N", _build_steps, _odd_table,
         {"time_s": [0.25, 0.5, 0.75], "force_N": [1.0, -1.0, 0.0]}),
    ):
        section = f"{name}_{kind}"
        yield Effect(
            section, f"external force on the {name.replace('_', ' ')}: a {kind}", parameters,
            partial(build, section, body), work, needs=(name,), outputs=outputs, relations=tuple(
                Relation(text, why, partial(problems, section)) for text, why, problems in RELATIONS[kind]),
            oddities=partial(odd, section), acts_by=(size,), example=example,
        )


EFFECTS = tuple(effect for name, body in BODIES.items() for effect in _effects(name, body))
