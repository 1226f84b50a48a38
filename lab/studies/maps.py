"""Three questions that take many runs: where a grasp settles, what its sampling does, and how robust it is."""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.maps import store
from grasp_ros.maps.plan import Axis, Plan
from grasp_ros.maps.run import run
from grasp_ros.physics.model import Array
from grasp_ros.physics.sampled import spectral_radius
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.simulation.chunk import Setup
from grasp_ros.simulation.ensemble import ensemble
from lab.cases.draw import relative
from lab.reference.grasp import grasp_of

GAINS = "left_feedback.position_gain_N_per_m+right_feedback.position_gain_N_per_m"
LOSSES = "left_contact.dissipation_s_per_m+right_contact.dissipation_s_per_m"
PIXELS = 200  # of a side; a run goes on for some ten horizons
SETTLED, MAP_ACCURACY, CHECKED, HORIZONS = 0.05, 1e-10, 2000, 10
ROUGHER = 1e-14  # than the finest accuracy, which case 3 needs: without dampers it forgets where it came from
JUMP = 0.1  # of a settling time
TICKS, FIRST_S, LAST_S, GROWN = 300, 0.01, 0.4, 3.0
PERIODS, LEVELS = 40, 26
RUNAWAY = 20_000  # units of work; a run that grows without bound may take any number, and one that does not a tenth
NOISE = {"position_noise_m": 1e-3, "velocity_noise_m_per_s": 1e-2}
SAMPLE, OFF = 100_000, 0.3


class Settling(NamedTuple):
    """The map of case 3, and a window of it."""

    plan: Plan
    data: Any
    zoom: Plan
    zoomed: Any
    jumps: tuple[float, float]  # share of neighbours whose settling times differ by more than JUMP: map and window
    changed: float  # share of the pixels of the map that ROUGHER moves by more than JUMP
    seconds: float

    @property
    def within(self) -> float:
        """Time in s that a run has to settle."""
        return self.plan.setup.horizons * self.plan.scene.duration


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
    """When case 3 settles for good, over both gains and both dissipations, and a window where that is least smooth."""
    scene = scenes.load("case_03", ["time.duration_s=10.0"])
    setup = Setup(("settling_time",), settled=SETTLED, horizons=HORIZONS)
    axes = (Axis(LOSSES, 0.02, 20.0, pixels, True), Axis(GAINS, -9.0, 60.0, pixels))
    plan = Plan(scene, setup, axes)
    data, seconds = _computed(plan, directory / f"settling_{pixels}.zarr")
    jumps = _jumps(data["settling_time"].values)
    zoom = Plan(scene, setup, _window(plan, jumps, max(pixels // 20, 4), max(pixels // 4, 2)))
    zoomed, _ = _computed(zoom, directory / f"zoom_{pixels}.zarr")
    shares = float(jumps.mean()), float(_jumps(zoomed["settling_time"].values).mean())
    return Settling(plan, data, zoom, zoomed, shares, _changed(plan, data), seconds)


def _computed(plan: Plan, path: Path) -> tuple[Any, float]:
    """The outcomes of a plan, and the time that they took in s."""
    begin = time.monotonic()
    try:
        with tqdm(total=plan.rows, unit="run", desc=path.stem, file=sys.stderr, smoothing=0.05) as bar:
            run(plan, path, progress=lambda done: bar.update(done - bar.n))
    finally:  # a study that was interrupted goes on with its map
        about = store.open_group(path, "r+").attrs
        about["seconds"] = about.get("seconds", 0.0) + time.monotonic() - begin
    return store.read(path), about["seconds"]


def _window(plan: Plan, jumps: Array, size: int, pixels: int) -> tuple[Axis, Axis]:
    """The window with the most jumps in it, as axes."""
    counts = {
        (i, j): jumps[i : i + size, j : j + size].sum()
        for i in range(0, jumps.shape[0] - size + 1, size // 2) for j in range(0, jumps.shape[1] - size + 1, size // 2)
    }
    i, j = max(counts, key=lambda cell: counts[cell])
    y, x = plan.axes
    return (Axis(y.name, float(y.values[i]), float(y.values[i + size - 1]), pixels, True),
            Axis(x.name, float(x.values[j]), float(x.values[j + size - 1]), pixels))


def _differ(one: Array, other: Array) -> Array:
    """Where two times differ by more than a part JUMP of the larger, or only one is finite."""
    with np.errstate(invalid="ignore"):
        far = np.abs(one - other) > JUMP * np.maximum(one, other)
    return np.asarray(np.where(np.isfinite(one) & np.isfinite(other), far, np.isfinite(one) != np.isfinite(other)))


def _jumps(times: Array) -> Array:
    """Pixels, but those of the last row and column, whose neighbour above or to the right settles much else."""
    here = times[:-1, :-1]
    return np.asarray(np.logical_or(_differ(here, times[1:, :-1]), _differ(here, times[:-1, 1:])))


def _changed(plan: Plan, data: Any) -> float:
    """Share of some pixels, drawn at random, whose time an accuracy of ROUGHER moves by more than a part JUMP."""
    rows = np.random.default_rng(1).choice(plan.rows, min(CHECKED, plan.rows), replace=False)
    changes = {key: values[rows] for key, values in plan.variants(0, plan.rows).changes.items()}
    rough = ensemble(plan.scene, changes, plan.setup.outcomes, setup=plan.setup._replace(accuracy=ROUGHER))
    return float(_differ(rough.columns["settling_time"], data["settling_time"].values.ravel()[rows]).mean())


def limits(periods: int = PERIODS, levels: int = LEVELS) -> Limits:
    """Where case 1 with held commands loses stability, over period and gain: alone, with delay, noise, and both."""
    scene = scenes.load("case_01")
    steps = np.round(np.linspace(FIRST_S, LAST_S, periods) * NANOSECONDS) / NANOSECONDS
    gains = np.linspace(1.0, 60.0, levels)
    arm = grasp_of(scene).left
    radius = {delay: np.array([spectral_radius(arm._replace(position_gain=gain), steps, delay) for gain in gains])
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
        found = ensemble(scene, changes, ("extremes",), setup=Setup(max_work=RUNAWAY),
                         progress=lambda done: bar.update(done - bar.n))
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
    return plan, *_computed(plan, directory / f"robustness_{rows}.zarr")
