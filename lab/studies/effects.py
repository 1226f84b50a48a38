"""What each effect costs: the paper's standard case alone, with each effect alone, and with all together.

An effect changes the motion, and with it how many flights and Taylor steps there are. So the page has both: how many,
which is the same on every machine, and what one of them costs. Runs take turns, and the least time counts: of each
segment by itself under continuous feedback, of the whole run with held commands.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator
from grasp_ros.exact.records import Integers, Loop, new_cursor
from grasp_ros.physics.layout import Kind, Work
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects import BY_SECTION, EFFECTS
from grasp_ros.simulation import simulate
from grasp_ros.simulation.closed_loop import drive
from grasp_ros.simulation.sampled_plant import tick_times
from lab.drills import recorder
from lab.studies import page_figures, pages
from lab.studies.segment_clock import SegmentClock
from lab.studies.turns import in_turn

PAGE, SCENE, BARE = "costs", "case_01", "bare"
REPEATS, SAMPLED_REPEATS = 31, 21
MOST_SEGMENTS = 10**5
RECORDED_S = 1.0
LESSER = ("hammer", "no_contact")  # scenes that name less than the paper's grasp


class Cost(NamedTuple):
    """What they take, s."""

    flight: float  # one of continuous feedback; NaN if there is none beside the first segment
    step: float
    tick: float  # a control period without ROS
    physics: float  # a control period of the same motion in a loop of the kernel, under forces that are given
    bag: float  # bytes per simulated second


def run(docs: Path | None) -> None:
    """Print the page on costs, or write it with its figure into a directory of pages.

    Raises
    ------
    Refused
        If the page cannot be written.
    """
    scene = scenes.load(SCENE)
    found = variants(scene)
    costs = measure(found)
    keys = {name: added(scene, one) if name in BY_SECTION else [] for name, one in found.items()}
    rows = [row(name, keys[name], counts(one), costs[name]) for name, one in found.items()]
    if docs is not None:
        shown = [(name, cost.tick * 1e6, cost.bag / 1e3) for name, cost in costs.items()]
        page_figures.effect_costs(shown, docs / f"{PAGE}.png")
    pages.write(docs, PAGE, scene=scene, rows=rows)


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
