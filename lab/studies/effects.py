"""What each effect costs: the paper's standard case alone, with each effect alone, and with all together.

An effect changes the motion, and with it how many flights and Taylor steps there are. So the page has both: how many,
which is the same on every machine, and what one of them costs. Runs take turns, and the least time counts: of each
segment by itself under continuous feedback, of the whole run with held commands.
"""

from __future__ import annotations

import ctypes
import math
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import cfunc, typeof
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.exact.driver.callback import SIGNATURE, Observer, block_of, reader
from grasp_ros.exact.integrator import Integrator
from grasp_ros.exact.records import Integers, Loop, Tables, new_cursor
from grasp_ros.physics.layout import Kind, Work
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects import BY_SECTION, EFFECTS
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.simulation import canvas, simulate
from grasp_ros.simulation.closed_loop import drive
from grasp_ros.simulation.plots import LEFT_COLOR, OBJECT_COLOR, save
from grasp_ros.simulation.sampled_plant import tick_times
from lab.drills import recorder
from lab.studies import pages
from lab.studies.speed import in_turn

PAGE, SCENE, BARE = "costs", "case_01", "bare"
REPEATS, SAMPLED_REPEATS = 31, 21
MOST_SEGMENTS = 10**5
RECORDED_S = 1.0
LESSER = ("hammer", "no_contact")  # scenes that name less than the paper's grasp
COUNT, FIRST = 2, 3  # indices, behind the seconds and nanoseconds of the clock; from the last on kind and time in turn
MONOTONIC = time.CLOCK_MONOTONIC
clock_gettime = ctypes.CDLL(None).clock_gettime
clock_gettime.argtypes = ctypes.c_int, ctypes.c_size_t


class Cost(NamedTuple):
    """What they take, s."""

    flight: float  # one of continuous feedback; NaN if there is none beside the first segment
    step: float
    tick: float  # a control period without ROS
    physics: float  # a control period of the same motion in a loop of the kernel, under forces that are given
    bag: float  # bytes per simulated second


def run(docs: Path | None) -> None:
    """Print the page on costs, or write it with its figure into a directory of pages."""
    scene = scenes.load(SCENE)
    found = variants(scene)
    costs = measure(found)
    keys = {name: added(scene, one) if name in BY_SECTION else [] for name, one in found.items()}
    rows = [row(name, keys[name], counts(one), costs[name]) for name, one in found.items()]
    if docs is not None:
        shown = [(name, cost.tick * 1e6, cost.bag / 1e3) for name, cost in costs.items()]
        _draw(shown, docs / f"{PAGE}.png")
    pages.write(docs, PAGE, scene=scene, rows=rows)


@canvas.style()
def _draw(rows: Sequence[tuple[str, float, float]], path: Path) -> None:
    """Draw what variants of a scene cost: name, us per control period, kB per simulated second."""
    names = [name for name, _, _ in rows]
    figure, panels = canvas.subplots(1, 2, sharey=True, figsize=(9.0, 0.3 * len(rows) + 1.2))
    for axes, column, label in zip(panels, (1, 2), ("us per control period, no ROS", "bag, kB per s"), strict=True):
        values = [float(row[column]) for row in rows]
        bars = axes.barh(names, values, color=[OBJECT_COLOR if name == names[0] else LEFT_COLOR for name in names])
        axes.bar_label(bars, [f"{value / values[0]:.2f}" for value in values], padding=3, fontsize="small")
        axes.axvline(values[0], color=OBJECT_COLOR, linewidth=0.8, linestyle="--")
        axes.set(xlim=(0.0, 1.15 * max(values)), xlabel=label)
    panels[0].invert_yaxis()
    figure.suptitle("cost of each effect; beside the bars: ratio to the bare scene", fontsize="medium")
    save(figure, path)


def variants(scene: Scene) -> dict[str, Scene]:
    """The scene alone, with each effect's example, with all of them, and scenes that name less, by name."""
    own = {key: dict(numbers) for key, numbers in scene.values.items()}
    found = {BARE: scene}
    everything: dict[str, Mapping[str, Any]] = dict(own)
    for effect in EFFECTS:
        if effect.example and own.keys() | {"loop"} >= set(effect.needs):
            needed: dict[str, Mapping[str, Any]] = {key: {} for key in effect.needs if key not in own}
            added: dict[str, Mapping[str, Any]] = {effect.section: {**own.get(effect.section, {}), **effect.example}}
            found[effect.section] = _with(scene, {**own, **needed, **added})
            everything = {**needed, **everything, **added}
    lesser = {f"{name}.yaml": scenes.load(name) for name in LESSER}
    return {**found, "all together": _with(scene, everything), **lesser}


def _with(scene: Scene, sections: Mapping[str, Mapping[str, Any]]) -> Scene:
    return scenes.compose(scene.name, sections, title=scene.title, readings=scene.readings)


def added(scene: Scene, variant: Scene) -> list[str]:
    """The keys that a variant has and the scene has not; a section without keys by its own name."""
    keys = []
    for section, numbers in variant.values.items():
        new = [key for key in numbers if key not in scene.values.get(section, {})]
        keys += [f"{section}.{key}" for key in new] or ([section] if section not in scene.values else [])
    return keys


def counts(scene: Scene) -> list[str]:
    """Flights and Taylor steps under continuous feedback, "-" for a scene that is sampled, and with held commands."""
    free = None if scene.sampled else simulate(scene, grid=np.array([scene.duration]))
    return ["-" if run is None else str(run.work[entry]) for run in (free, simulate(scene, sampled=True))
            for entry in (Work.FLIGHTS, Work.CONTACT_STEPS)]


def row(name: str, keys: Sequence[str], counted: Sequence[str], cost: Cost) -> list[str]:
    """The cells of a variant: its keys, work and times of continuous feedback and with held commands, and the bag."""
    flights, steps, *held = counted
    times = [f"{number:.0f}" if math.isfinite(number) else "-" for number in (1e9 * cost.flight, 1e9 * cost.step)]
    words = ", ".join(f"`{key.removeprefix(f'{name}.')}`" for key in keys)
    return [name, words, flights, times[0], steps, times[1], *held, f"{1e6 * cost.tick:.2f}",
            f"{1e6 * cost.physics:.2f}", f"{1e-3 * cost.bag:.0f}"]


def measure(found: Mapping[str, Scene]) -> dict[str, Cost]:
    """Time all variants in turn, and record a second of each."""
    least = {name: _segments(scene) for name, scene in found.items()}
    for _ in tqdm(range(REPEATS), desc="continuous", file=sys.stderr):
        for name, scene in found.items():
            np.minimum(least[name][1], _segments(scene)[1], out=least[name][1])
    several = list(found.values())
    sampled, physics = (  # of the processor, which counts no neighbours
        dict(zip(found, map(min, in_turn(calls, SAMPLED_REPEATS, time.thread_time, what)), strict=True))
        for what, calls in (("sampled", [partial(simulate, scene, sampled=True) for scene in several]),
                            ("physics", [physics_of(scene) for scene in several])))
    return {
        name: Cost(_average(*least[name], Kind.FLIGHT), _average(*least[name], Kind.CONTACT),
                   sampled[name] / scene.ticks, physics[name] / scene.ticks, _bag_size(scene))
        for name, scene in tqdm(found.items(), desc="recorded", file=sys.stderr)
    }


def _segments(scene: Scene) -> tuple[Integers, Array]:
    """Kind and seconds of every segment of a run under continuous feedback; of none where the scene is sampled."""
    if scene.sampled:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    integrator = Integrator(scene.system, continuous=True)
    integrator.observer = clock = SegmentClock(MOST_SEGMENTS)
    drive(scene, integrator, False, np.zeros(0))
    return clock.segments


def _average(kinds: Integers, seconds: Array, kind: Kind) -> float:
    chosen = seconds[kinds == kind]
    return float(chosen.mean()) if len(chosen) else math.nan


def physics_of(scene: Scene) -> Callable[[], Array]:
    """A sampled run again, under the forces that acted in it: one call of the kernel, without outputs."""
    inputs, times = simulate(scene, sampled=True).inputs[:-1], tick_times(scene)
    lengths, bounds = np.full(scene.ticks, scene.time_of(1)), np.zeros(scene.ticks + 1, dtype=np.int64)

    def again() -> Array:
        integrator = Integrator(scene.system, continuous=False)
        integrator.run(Loop(lengths, times, bounds, new_cursor(), np.empty_like(inputs), inputs), np.zeros(0))
        return integrator.state

    return again


def _bag_size(scene: Scene) -> float:
    short = scene.changed({"time.duration_s": RECORDED_S})
    with tempfile.TemporaryDirectory() as directory:
        bag = Path(directory) / "bag"
        recorder.write(bag, simulate(short, sampled=True))
        return sum(file.stat().st_size for file in bag.iterdir()) / RECORDED_S


class Clock(NamedTuple):
    """What it is called with."""

    numbers: Integers  # (FIRST + 2 n,)


clock_at = reader(typeof(Clock(np.zeros(0, dtype=np.int64))))


@cfunc(SIGNATURE)  # type: ignore[untyped-decorator]
def read_clock(context: int, kind: int, t: float, s: float, unit: float, degree: int) -> int:
    """Note the kind of a segment, and when it was over."""
    numbers = clock_at(context).numbers
    clock_gettime(MONOTONIC, numbers.ctypes.data)
    row = FIRST + 2 * numbers[COUNT]
    numbers[row], numbers[row + 1] = kind, numbers[0] * NANOSECONDS + numbers[1]
    numbers[COUNT] += 1
    return 0


class SegmentClock(Observer):
    """An observer that reads the clock after each segment of one run, of which it has at most `most`."""

    def __init__(self, most: int) -> None:
        self._places: Integers = np.zeros(FIRST + 2 * most, dtype=np.int64)
        self._block = block_of(Clock(self._places))

    def attach(self, tables: Tables) -> Integers:
        """What a run calls after each segment."""
        return np.array([read_clock.address, self._block.ctypes.data])

    @property
    def segments(self) -> tuple[Integers, Array]:
        """Kind, and length in s of wall time, of every segment but the first, whose begin is not known."""
        noted = self._places[FIRST : FIRST + 2 * self._places[COUNT]].reshape(-1, 2)
        return noted[1:, 0], np.diff(noted[:, 1]) / NANOSECONDS
