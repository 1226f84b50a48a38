"""Three questions that take many runs: where a grasp settles, what its sampling does, and how robust it is."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.maps import store
from grasp_ros.maps.plan import Axis, Plan, relative
from grasp_ros.maps.run import run
from grasp_ros.physics.model import Array
from grasp_ros.physics.sampled import spectral_radii
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.simulation.chunk import Setup
from grasp_ros.simulation.ensemble import ensemble

GAINS = "left_feedback.position_gain_N_per_m+right_feedback.position_gain_N_per_m"
LOSSES = "left_contact.dissipation_s_per_m+right_contact.dissipation_s_per_m"
PIXELS = 1000
SETTLED, MAP_ACCURACY, CHECKED = 0.05, 1e-10, 2000
TICKS, FIRST_S, LAST_S, GROWN = 300, 0.01, 0.4, 3.0
PERIODS, LEVELS = 40, 26
RUNAWAY = 20_000  # units of work; a run that grows without bound may take any number, and one that does not a tenth
NOISE = {"position_noise_m": 1e-3, "velocity_noise_m_per_s": 1e-2}
SAMPLE, OFF = 100_000, 0.3


class Settling(NamedTuple):
    """The map of case 3, and what lies at its edge."""

    plan: Plan
    data: Any
    zoom: Plan
    zoomed: Any
    dimension: float  # of the edge, by counting boxes
    changed: float  # part of the pixels of the zoom that an accuracy of 1e-16 puts on the other side
    seconds: float


class Loops(NamedTuple):
    """One of four loops, over period and gain."""

    name: str
    delay: int
    unstable: Array  # (gains, periods)
    shift: float  # median over the gains of its largest stable period, relative to that of a free arm


class Limits(NamedTuple):
    """Where the sampled loop loses stability."""

    periods: Array  # s
    gains: Array  # N/m
    radius: dict[int, Array]  # of a free arm, by delay
    loops: list[Loops]


def settling(directory: Path, pixels: int = PIXELS) -> Settling:
    """Where case 3 settles within 10 s, over both gains and both dissipations, and a zoom into its edge."""
    scene = scenes.load("case_03", ["time.duration_s=10.0"])
    setup = Setup(("settling_time",), MAP_ACCURACY, settled=SETTLED)
    axes = (Axis(LOSSES, 0.02, 20.0, pixels, True), Axis(GAINS, -9.0, 60.0, pixels))
    plan = Plan(scene, setup, axes)
    seconds = _computed(plan, directory / f"settling_{pixels}.zarr").seconds
    data = store.read(directory / f"settling_{pixels}.zarr")
    settles = np.isfinite(data["settling_time"].values)
    zoom = Plan(scene, setup, _window(plan, settles, max(pixels // 20, 4), max(pixels // 4, 2)))
    _computed(zoom, directory / f"zoom_{pixels}.zarr")
    zoomed = store.read(directory / f"zoom_{pixels}.zarr")
    return Settling(plan, data, zoom, zoomed, dimension(settles), _changed(zoom, zoomed), seconds)


def _computed(plan: Plan, path: Path) -> store.Store:
    with tqdm(total=plan.rows, unit="run", desc=path.stem, file=sys.stderr, smoothing=0.05) as bar:
        return run(plan, path, progress=lambda done, _: bar.update(done - bar.n))


def _window(plan: Plan, settles: Array, size: int, pixels: int) -> tuple[Axis, Axis]:
    """The window with the longest edge in it, as axes."""
    mixed = _mixed(settles, 1)
    counts = {
        (i, j): mixed[i : i + size, j : j + size].sum()
        for i in range(0, mixed.shape[0] - size + 1, size // 2) for j in range(0, mixed.shape[1] - size + 1, size // 2)
    }
    i, j = max(counts, key=lambda place: counts[place])
    y, x = plan.axes
    return (Axis(y.name, float(y.values[i]), float(y.values[i + size - 1]), pixels, True),
            Axis(x.name, float(x.values[j]), float(x.values[j + size - 1]), pixels))


def _mixed(inside: Array, size: int) -> Array:
    """Boxes of size + 1 pixels that overlap by one, and hold both kinds."""
    boxes = [inside[i::size, j::size] for i in range(size + 1) for j in range(size + 1)] if size == 1 else []
    if not boxes:
        height, width = ((length - 1) // size for length in inside.shape)
        boxes = [inside[i : i + size * height : size, j : j + size * width : size]
                 for i in range(size + 1) for j in range(size + 1)]
    height, width = (min(box.shape[axis] for box in boxes) for axis in (0, 1))
    total = np.sum([box[:height, :width] for box in boxes], axis=0)
    return np.asarray((total > 0) & (total < len(boxes)))


def dimension(inside: Array) -> float:
    """Box-counting dimension of the edge of a region, from boxes of 2 to 32 pixels."""
    sizes = [size for size in (2, 4, 8, 16, 32) if size < min(inside.shape) // 4]
    counts = [max(int(_mixed(inside, size).sum()), 1) for size in sizes]
    return float(-np.polyfit(np.log(sizes), np.log(counts), 1)[0]) if len(sizes) > 1 else math.nan


def _changed(plan: Plan, data: Any) -> float:
    """Part of some pixels, drawn at random, that the finest accuracy puts on the other side of the edge."""
    rows = np.random.default_rng(1).choice(plan.rows, min(CHECKED, plan.rows), replace=False)
    changes = {key: values[rows] for key, values in plan.variants(0, plan.rows).changes.items()}
    fine = ensemble(plan.scene, changes, plan.setup.outcomes, setup=plan.setup._replace(accuracy=1e-16))
    coarse = data["settling_time"].values.ravel()[rows]
    return float((np.isfinite(fine.columns["settling_time"]) != np.isfinite(coarse)).mean())


def limits(periods: int = PERIODS, levels: int = LEVELS) -> Limits:
    """Where case 1 with held commands loses stability, over period and gain: alone, with delay, noise, and both."""
    scene = scenes.load("case_01")
    steps = np.round(np.linspace(FIRST_S, LAST_S, periods) * NANOSECONDS) / NANOSECONDS
    gains = np.linspace(1.0, 60.0, levels)
    arm = scene.grasp.left
    radius = {delay: np.array([spectral_radii(arm._replace(position_gain=gain), steps, delay) for gain in gains])
              for delay in (0, 1)}
    loops = []
    for name, delay, noise in (("no delay", 0, {}), ("one sample of delay", 1, {}), ("noise", 0, NOISE),
                               ("delay and noise", 1, NOISE)):
        unstable = _unstable(_sampled(scene, delay, noise), steps, gains)
        loops.append(Loops(name, delay, unstable, _shift(unstable, radius[delay], steps)))
    return Limits(steps, gains, radius, loops)


def _sampled(scene: Scene, delay: int, noise: dict[str, float]) -> Scene:
    """Case 1 with a loop, and sensors where there is noise."""
    sections: dict[str, Any] = {**scene.values, "loop": {"delay_ticks": delay} if delay else {}}
    if noise:
        sections |= {f"{side}_sensor": {"noise_seed": 1, **noise} for side in ("left", "right")}
    return scenes.compose(scene.name, sections, title=scene.title)


def _unstable(scene: Scene, periods: Array, gains: Array) -> Array:
    """Whether a mass goes further than `GROWN` times the largest initial displacement within `TICKS` periods.

    A run that stops does: the state, or the work for it, grows without bound.
    """
    gain, period = (grid.ravel() for grid in np.meshgrid(gains, periods, indexing="ij"))
    lengths = np.round(period * NANOSECONDS) * TICKS / NANOSECONDS
    changes = dict.fromkeys(GAINS.split("+"), gain) | {"time.control_period_s": period, "time.duration_s": lengths}
    for side in ("left", "right"):
        if f"{side}_sensor" in scene.values:
            changes[f"{side}_sensor.noise_seed"] = np.arange(len(gain)) + 1.0
    with tqdm(total=len(gain), unit="run", desc=scene.certificate_in_words(True)[:40], file=sys.stderr) as bar:
        found = ensemble(scene, changes, ("extremes",), setup=Setup(max_work=RUNAWAY), progress=bar.update)
    largest = np.max([np.abs(values) for name, values in found.columns.items() if name.startswith("x_")], axis=0)
    start = np.abs(scene.initial_state[0::2]).max()
    return np.asarray(~(largest <= GROWN * start)).reshape(len(gains), len(periods))


def _shift(unstable: Array, radius: Array, periods: Array) -> float:
    """Median over the gains of the first unstable period relative to that of the free arm."""
    ratios = []
    for seen, free in zip(unstable, radius >= 1.0, strict=True):
        if seen.any() and free.any():
            ratios.append(periods[np.argmax(seen)] / periods[np.argmax(free)])
    return float(np.median(ratios)) if ratios else math.nan


def robustness(directory: Path, rows: int = SAMPLE) -> tuple[Plan, Any, float]:
    """Case 1 with every number off by up to 30 %; the plan, its outcomes, and the time in s."""
    scene = scenes.load("case_01")
    outcomes = ("settling_time", "touches", "peak_input", "peak_impact")
    plan = Plan(scene, Setup(outcomes, MAP_ACCURACY), relative(scene, OFF), rows, 1)
    seconds = _computed(plan, directory / f"robustness_{rows}.zarr").seconds
    return plan, store.read(directory / f"robustness_{rows}.zarr"), seconds
