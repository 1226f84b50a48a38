"""What a method is given, delivers and declares, as records; the rules are numbered in `grasp_ros.methods`."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

from grasp_ros.exact.integrator import MAX_EVENTS, MAX_WORK, Integrator, Status
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import System

STEP, TOLERANCE, ACCURACY_KNOB = "step", "tolerance", "accuracy"
UNITS = {STEP: " s", TOLERANCE: "", ACCURACY_KNOB: ""}
Drive = Callable[[Integrator], Array]  # moves an integrator over the horizon; the states (n, 6) at the output times


class Problem(NamedTuple):
    """What a method is given."""

    system: System  # with its initial state; not to be changed
    duration: float  # s
    grid: Array  # (n,), s: ascending output times within [0, duration], which may repeat
    setting: float  # step in s, tolerance or accuracy, as `registry.check` gives it
    max_events: int = MAX_EVENTS
    max_work: int = MAX_WORK
    sampled: bool = False  # the controllers are in `drive`; otherwise their feedback acts continuously
    drive: Drive | None = None  # inputs that change on the way; None: continuous feedback alone
    progress: Callable[[float], object] | None = None  # gets the time reached in s, where the method knows it


class Solution(NamedTuple):
    """What a method delivers."""

    state: Array  # (n, 6), m and m/s; fewer rows than output times if it stopped early
    event_table: Array  # (m, 5): time, side, kind, u, u'; none if the method does not look for them
    work: Any  # int array (k,), one for each of `Method.counters`
    status: Status
    stop: str = ""  # why and where it stopped, if the method can say more than its status
    at_rest: float | None = None  # s, since when everything is at rest for good; None: it is not, or is not known


class Method(NamedTuple):
    """One way to integrate a system, and what it can do."""

    name: str
    order: str
    source: str
    at_touch: str  # what it does at a touch
    knob: str  # STEP, TOLERANCE or ACCURACY_KNOB
    default: float
    ladder: tuple[float, ...]  # settings worth a measurement, loose to tight
    low: float  # allowed settings, `low` to `high`; a step is limited by the horizon as well
    high: float
    solve: Callable[[Problem], Solution]
    counters: type[IntEnum]  # columns of `Solution.work`
    events: bool  # finds touches and releases, and keeps to `max_events`
    effects: bool = False  # knows all effects; otherwise the paper's grasp alone
    sampled: bool = False  # can be driven: commands that are held, external forces
    work_budget: bool = False  # keeps to `max_work`
    energy_check: bool = False  # stops where the energy rises by more than rounding explains
    package: str | None = None  # that must be installed
