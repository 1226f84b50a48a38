"""Derivatives through impacts beside the high-precision reference, random scenes and peers: docs/derivatives.md."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.sensitivity.directions import directions
from grasp_ros.sensitivity.run import Carrier
from grasp_ros.simulation import GRID_POINTS, simulate
from grasp_ros.simulation.differentiate import complete, differentiate
from lab.oracles.differences import DECIDED, WRONG, judge_draw
from lab.reference.solve import difference
from lab.studies import pages, peer_derivatives
from lab.studies.records import Journal, scene_key
from lab.studies.speed import in_turn

P, PLACE = "left_contact.dissipation_s_per_m", "object.position_m"
SUBJECTS = (
    *((f"case_{number:02}", key) for key in (P, PLACE) for number in range(1, 12)),
    *((name, P) for name in ("v_jump_symmetric", "v_jump_one_sided", "friction", "preload", "tilt_hold", "delay")),
    ("case_01", "left_arm.mass_kg"),
)
PARTS = (0.25, 0.5, 1.0)  # of the horizon
SECONDS = {"delay": 3.0}  # horizons of scenes with many ticks, which take the reference long
ROUNDINGS = 4  # runs whose initial positions are off by one
NUMBERS = [
    f"{side}_{number}" for side in ("left", "right") for number in (
        "arm.mass_kg", "arm.stiffness_N_per_m", "arm.damping_Ns_per_m", "contact.hertz_N_per_m1_5",
        "contact.dissipation_s_per_m", "feedback.position_gain_N_per_m",
    )
]
TIMED = ("case_01", "tilt_hold", "preload")  # many impacts, and grasps that come to rest early
ROUNDS = 80
PAGE = "derivatives.md"
REFERENCE, RANDOM, PEERS, COST = TABLES = "reference", "random", "peers", "cost"


class Known(NamedTuple):
    """What the reference says, in a journal."""

    state: list[list[float]]  # derivatives of the states at PARTS of the horizon


def reference(directory: Path) -> str:
    """All subjects beside differences of the reference, which a journal keeps: a table of Markdown."""
    journal, rows = Journal(directory), []
    for name, key in SUBJECTS:
        scene = scenes.load(name)
        scene = scene.changed({"time.duration_s": SECONDS.get(name, scene.duration)})
        times = [part * scene.duration for part in PARTS]
        entry = f"extrapolated derivative {scene_key(scene)} {key} {times!r}"
        known = journal.kept(entry, Known, partial(_known, scene, key, times))
        rows += _rows(scene, key, np.array(times), np.array(known.state))
    heads = ("scene", "number", "t, s", "largest derivative", "relative error", "one rounding changes it by")
    return pages.table(heads, rows)


def _known(scene: Scene, key: str, times: list[float]) -> Known:
    return Known(difference(scene, key, times).state.tolist())


def _rows(scene: Scene, key: str, times: Array, expected: Array) -> list[list[str]]:
    """One scene and one number at some times: sizes are the largest of six derivatives, errors relative to them."""
    found, size = _derivative(scene, key, times), np.abs(expected).max(axis=1)
    signs = np.random.default_rng(1990).choice([-1.0, 1.0], size=(ROUNDINGS, 3))
    spread = np.max([np.abs(_derivative(_off(scene, row), key, times) - found).max(axis=1) for row in signs], axis=0)
    error = np.abs(found - expected).max(axis=1)
    return [[scene.name, f"`{key}`", f"{t:g}", f"{largest:.3g}", f"{off:.1e}", f"{moved:.1e}"]
            for t, largest, off, moved in zip(times, size, error / size, spread / size, strict=True)]


def _derivative(scene: Scene, key: str, times: Array) -> Array:
    """Derivatives (m, 6) of the states by one number."""
    return np.asarray(differentiate(simulate(scene, grid=times), [key]).state_rates[..., 0])


def _off(scene: Scene, signs: Array) -> Scene:
    """The scene with initial positions that are one rounding of the largest of them off."""
    off = signs * np.spacing(np.abs(scene.initial_state).max())
    positions = zip(("left_arm", "object", "right_arm"), off.tolist(), strict=True)
    return scene.changed({f"{body}.position_m": scene.values[body]["position_m"] + way for body, way in positions})


def random_scenes(decided: int) -> str:
    """Draw scenes until so many are decided: what became of all, as a table of Markdown; wrong ones are printed."""
    counts: Counter[str] = Counter()
    number = 0
    while sum(counts[word] for word in DECIDED) < decided:
        drawn, verdict = judge_draw(number)
        number += 1
        counts[f"{verdict.word}: {verdict.reason}" if verdict.reason else verdict.word] += 1
        if verdict.word == WRONG:
            print(f"{verdict.text}\n{drawn}")
    heads = [*DECIDED, *sorted(counts.keys() - {*DECIDED}, key=lambda head: (-counts[head], head)), "drawn"]
    counts["drawn"] = number
    return pages.table(("result", "scenes"), [[head, str(counts[head])] for head in heads])


def cost() -> str:
    """Runs with derivatives, as multiples of the same run without: the least times of the processor, in turn."""
    rows = [_cost_row(scenes.load(name), count) for name in TIMED for count in (1, GRID_POINTS)]
    heads = ("scene", "output times", "`simulate`, ms", "states by 1 number", "by 12", "`sensitivity` by 1", "by 12")
    return pages.table(heads, rows)


def _cost_row(scene: Scene, count: int) -> list[str]:
    """Times of a scene with so many output times, the last one at its end."""
    times = np.linspace(0.0, scene.duration, count + 1)[1:]
    without, *others = map(min, in_turn([
        partial(simulate, scene, grid=times),
        *(partial(states_alone, scene, NUMBERS[:chosen], times) for chosen in (1, len(NUMBERS))),
        *(partial(simulate, scene, grid=times, sensitivity=NUMBERS[:chosen]) for chosen in (1, len(NUMBERS))),
    ], ROUNDS, time.thread_time))
    return [scene.name, f"{count}", f"{1e3 * without:.2f}", *(f"{seconds / without:.1f}" for seconds in others)]


def states_alone(scene: Scene, keys: Sequence[str], times: Array) -> Array:
    """Derivatives (m, 6, n) of the states alone: one run."""
    integrator = Integrator(scene.system, continuous=True)
    carrier = Carrier(scene, integrator, directions(scene, keys, False), times, False)
    complete(scene, integrator, False, times)
    carrier.finish()
    return carrier.out


def run(docs: Path | None, directory: Path, names: list[str] | None, decided: int) -> None:
    """Measure and print the named tables, or all but the one of peers; with a directory of pages, write them there."""
    measures = {
        REFERENCE: lambda: reference(directory), RANDOM: lambda: random_scenes(decided),
        PEERS: lambda: peer_derivatives.report(peer_derivatives.run()), COST: cost,
    }
    found = {name: measures[name]() for name in names or [name for name in TABLES if name != PEERS]}
    print("\n\n".join(found.values()))
    if docs is not None:
        write(docs, found)


def write(docs: Path, found: dict[str, str]) -> Path:
    """Write docs/derivatives.md: the page that is there, with these tables between their marks; returns it."""
    text, page = (pages.HOME / "docs" / PAGE).read_text(encoding="utf-8"), docs / PAGE
    for name, table in found.items():
        mark = f"<!-- {name} -->"
        before, _, after = text.split(mark)
        text = f"{before}{mark}\n\n{table}\n\n{pages.stamp()}\n\n{mark}{after}"
    pages.put(page, text)
    return page
