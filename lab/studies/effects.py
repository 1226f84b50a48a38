"""What each effect costs: the paper's standard case alone, with each effect alone, and with all together.

The runs of all variants are interleaved, so that their ratios hold on a machine that is shared.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator
from grasp_ros.exact.records import Loop, new_place
from grasp_ros.graph.processes import Graph
from grasp_ros.physics.layout import Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects import EFFECTS
from grasp_ros.scene.versions import versions
from grasp_ros.simulation import simulate
from grasp_ros.simulation.ticks import tick_times
from lab.studies import page_figures
from lab.studies.document import put, read, write

BARE = "bare"
REPEATS, SAMPLED_REPEATS = 31, 21
RECORDED_S = 1.0
LESSER = ("hammer", "no_contact")  # scenes that name less than the paper's grasp
REGISTRY, COSTS = "the registry", "what `python -m lab effects` measured"  # marked parts of the documentation


class Cost(NamedTuple):
    """Cost of one variant of the scene."""

    name: str
    continuous: float | None  # s per simulated second; None: the scene is sampled
    contact: float | None  # s per touch, of the same run
    tick: float  # s per control period without ROS
    physics: float  # s per control period of the same motion in a loop of the kernel, under forces that are given
    bag: float  # bytes per simulated second


def run(scene: Scene, document: Path | None) -> None:
    """Print the costs; with a document, put table and figure into it.

    Parameters
    ----------
    scene : Scene
        What the effects are added to.
    document : Path, optional
        Text file with marked parts; the figure is written beside it.

    Raises
    ------
    Refused
        If the document cannot be read or written, or has no marks.
    """
    text = None if document is None else read(document)
    if text is not None and document is not None:
        text = put(document, text, REGISTRY, registry_table())
        put(document, text, COSTS, "")  # refuses a text without marks before the work begins
    costs = measure(variants(scene), REPEATS, SAMPLED_REPEATS)
    table = _cost_table(scene, costs)
    print(table)
    if text is not None and document is not None:
        figure = document.with_suffix(".png")
        page_figures.effect_costs([(cost.name, cost.tick * 1e6, cost.bag / 1e3) for cost in costs], figure)
        block = f"{table}\n\n![costs of the effects]({figure.name})"
        write(document, put(document, text, COSTS, block))


def registry_table() -> str:
    """Markdown table of the effects; those of the right side and of other bodies stand for their twins."""
    rows = ["| section | what it simulates | what it does to V_c |", "|---|---|---|"]
    for effect in EFFECTS:
        if not effect.section.startswith(("right_", "object_pulse", "object_sine", "object_table")):
            rows.append(f"| `{effect.section}` | {effect.text} | {effect.certificate} |")
    return "\n".join(rows)


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


def measure(found: Mapping[str, Scene], repeats: int, sampled_repeats: int) -> list[Cost]:
    """Time all variants in turn, and record a second of each over topics."""
    smooth = {name: partial(_final_state, scene) for name, scene in found.items() if not scene.sampled}
    continuous = _interleaved(smooth, repeats, "continuous")
    sampled = _interleaved(
        {name: partial(simulate, scene, sampled=True) for name, scene in found.items()}, sampled_repeats, "sampled"
    )
    physics = _interleaved({name: physics_of(scene) for name, scene in found.items()}, sampled_repeats, "physics")
    costs = []
    for name, scene in tqdm(found.items(), desc="recorded", file=sys.stderr):
        seconds = continuous.get(name)
        touches = sum(event.kind == Transition.TOUCH for event in simulate(scene).events)
        costs.append(Cost(
            name, None if seconds is None else seconds / scene.duration,
            None if seconds is None or not touches else seconds / touches,
            sampled[name] / scene.ticks, physics[name] / scene.ticks, _bag_size(scene),
        ))
    return costs


def physics_of(scene: Scene) -> Callable[[], Array]:
    """A sampled run again, under the forces that acted in it: one call of the kernel, without outputs."""
    inputs, times = simulate(scene, sampled=True).inputs[:-1], tick_times(scene)
    lengths, bounds = np.full(scene.ticks, scene.time_of(1)), np.zeros(scene.ticks + 1, dtype=np.int64)

    def again() -> Array:
        integrator = Integrator(scene.system, continuous=False)
        integrator.run(Loop(lengths, times, bounds, new_place(), np.empty_like(inputs), inputs), np.zeros(0))
        return integrator.state

    return again


def _final_state(scene: Scene) -> None:
    simulate(scene, grid=np.array([scene.duration]))


def _with(scene: Scene, sections: Mapping[str, Mapping[str, Any]]) -> Scene:
    return scenes.compose(scene.name, sections, title=scene.title, readings=scene.readings)


def _interleaved(runs: Mapping[str, Callable[[], object]], repeats: int, what: str) -> dict[str, float]:
    """Median time of each run in s; the first round does not count."""
    times: dict[str, list[float]] = {name: [] for name in runs}
    for turn in tqdm(range(repeats + 1), desc=what, file=sys.stderr):
        for name, call in runs.items():
            begin = time.perf_counter()
            call()
            if turn:
                times[name].append(time.perf_counter() - begin)
    return {name: statistics.median(values) for name, values in times.items()}


def _bag_size(scene: Scene) -> float:
    short = scene.changed({"time.duration_s": RECORDED_S})
    with tempfile.TemporaryDirectory() as directory:
        graph = Graph(short, Path(directory) / "run", 1e-12, errors=subprocess.DEVNULL)
        graph.start()
        try:
            graph.wait([])
        finally:
            graph.stop()
        return sum(file.stat().st_size for file in graph.bag.iterdir()) / RECORDED_S


def _cost_table(scene: Scene, costs: list[Cost]) -> str:
    bare = costs[0]
    lines = [
        f"{scene.title}, {scene.duration:g} s, control period {scene.period_ns / 1e6:g} ms."
        f" {', '.join(f'{name} {version}' for name, version in versions().items())}.", "",
        "| scene | continuous, us per s | ratio | us per contact | sampled, us per tick | ratio | ratio to the physics"
        " | bag, kB per s |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for cost in costs:
        smooth = ["-", "-"] if cost.continuous is None or bare.continuous is None else [
            f"{cost.continuous * 1e6:.1f}", f"{cost.continuous / bare.continuous:.2f}"
        ]
        contact = "-" if cost.contact is None else f"{cost.contact * 1e6:.1f}"
        cells = [cost.name, *smooth, contact, f"{cost.tick * 1e6:.2f}", f"{cost.tick / bare.tick:.2f}",
                 f"{cost.tick / cost.physics:.2f}", f"{cost.bag / 1e3:.0f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
