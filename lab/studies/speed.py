"""What it costs to simulate one scene to a given error: every solver at its first setting that reaches it, in turn.

The same measurements as `accuracy`, with two differences: the timings are interleaved, so that their ratios hold on
a machine that is shared, and they are taken with and without the output of all times.
"""

from __future__ import annotations

import json
import statistics
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.accuracy.contender import Contender, Solve
from grasp_ros.accuracy.measure import Record, seconds
from grasp_ros.accuracy.truth import Truth
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from lab.studies import accuracy, measure, pages, peer_heyoka, predictability
from lab.studies.contenders import all_contenders, own_contenders
from lab.studies.records import Journal, describe_machine

BUDGET_S, FEWEST, MOST = 1.5, 3, 200  # per solver: time for its repeats, and their number
PATIENCE_S = 2.0  # a solver that needs longer for one run climbs no further
WARM_S = 0.05  # a solver that takes longer is warm by itself
FINER = 2  # settings a decade of `exact`
HORIZONS = (0.25, 0.5, 1.0, 2.0)  # parts of the scene's duration
ENDURANCE_S = (1.0, 1e2, 1e4, 1e6)


class Timing(NamedTuple):
    """Repeats of a solver that reaches the error, without what it compiles."""

    record: Record
    least: float  # s
    median: float  # s
    repeats: int


def run(scene: Scene, error: float, out: Path | None, directory: Path) -> None:
    """Print time to an error of all solvers and their ratios; write the records as JSON.

    Raises
    ------
    Refused
        If the error is not positive, the file cannot be written, or the scene is one that the peers cannot treat, see
        `measure.check`.
    """
    if not error > 0.0:
        raise Refused(f"--error {error!r} is not allowed; allowed: a number > 0")
    measure.check(scene)
    target = measure.truth(scene, Journal(directory))
    heading = [
        f"{scene.name}: time to an error of at most {error:g}", f"error: {accuracy.METRIC}; end: the last time only",
        f"touches there are: {target.touches[LEFT]}/{target.touches[RIGHT]} left/right",
        ", ".join(f"{name} {version}" for name, version in describe_machine().items()),
    ]
    print("\n".join(heading))
    results: dict[str, list[Timing]] = {}
    for output, grid in (("grid", target.grid), ("end", target.grid[-1:])):
        finalists: list[tuple[Record, Solve | None]] = []
        failures: list[tuple[Record, Solve | None]] = []
        for contender in tqdm(contenders(), desc=f"error at the {output}", file=sys.stderr):
            last, solve = first_to_reach(contender, scene, grid, target, error)
            (finalists if solve is not None else failures).append((last, solve))
        results[output] = race(finalists, grid, output)
        print("\n".join(_table(results[output], output) + [_failure(record) for record, _ in failures]))
    grid_cost, end_cost = (next(t.median for t in results[o] if t.record.method == EXACT) for o in ("grid", "end"))
    print(f"{EXACT}: {len(target.grid)} output times / the last alone: {grid_cost / end_cost:.2f}")
    print("\n".join(_growth(scene)))
    if out is not None:
        record = {"scene": scene.to_yaml(), "metric": accuracy.METRIC, "error": error, "machine": describe_machine()}
        timings = {o: [{**t._asdict(), "record": t.record._asdict()} for t in rows] for o, rows in results.items()}
        pages.put(out, json.dumps({**record, "timings": timings}, indent=1) + "\n")


def final_state(scene: Scene, target: Truth, error: float) -> list[Timing]:
    """`exact` and its closest rival, heyoka, where only the last state is asked for."""
    grid = target.grid[-1:]
    rivals = [contenders()[0], peer_heyoka.contenders()[-1]]
    tries = [first_to_reach(rival, scene, grid, target, error) for rival in rivals]
    return race([(record, solve) for record, solve in tries if solve is not None], grid, "end")


def contenders() -> list[Contender]:
    """All, with every way of heyoka to generate code; ours with finer settings, as a user of one error has them."""
    exact = next(contender for contender in own_contenders() if contender.name == EXACT)
    finer = tuple(10.0 ** (-k / FINER) for k in range(3 * FINER, 16 * FINER + 1))
    others = [c for c in all_contenders() if c.name != EXACT and c.family != "heyoka"]
    return [exact._replace(ladder=finer), *peer_heyoka.contenders(peer_heyoka.VARIANTS), *others]


def first_to_reach(
    contender: Contender, scene: Scene, grid: Array, target: Truth, error: float
) -> tuple[Record, Solve | None]:
    """The first setting, from loose to tight, that reaches an error; without a solver if none does."""
    effort = measure.FULL._replace(patience=PATIENCE_S, deadline=3.0 * PATIENCE_S, most=1)
    best: Record | None = None
    for setting in contender.ladder:
        record, solve = measure.attempt(contender, scene, setting, target, effort, grid)
        if record.good and record.error is not None and record.error <= error:
            return record, solve
        if best is None or (record.error is not None and (best.error is None or record.error < best.error)):
            best = record
        if measure.given_up(record, effort):
            break
    assert best is not None
    return best, None


def race(finalists: list[tuple[Record, Solve | None]], grid: Array, output: str) -> list[Timing]:
    """Time the finalists in turn, warm; slow ones drop out once their time is used up.

    A fast one runs once before it is timed: what its predecessor has left in the caches is not its own cost.
    """
    samples: list[list[float]] = [[] for _ in finalists]
    for _ in tqdm(range(MOST), desc=f"timing at the {output}", file=sys.stderr, leave=False):
        for (record, solve), times in zip(finalists, samples, strict=True):
            if solve is not None and (len(times) < FEWEST or sum(times) < BUDGET_S):
                if record.least is not None and record.least < WARM_S:
                    solve(grid)
                times.append(seconds(solve, grid))
    return [
        Timing(record, min(times), statistics.median(times), len(times))
        for (record, _), times in zip(finalists, samples, strict=True)
    ]


def _table(timings: list[Timing], output: str) -> list[str]:
    ours = next((timing.median for timing in timings if timing.record.method == EXACT), float("nan"))
    lines = [
        f"\n{'output: ' + output:32}{'setting':17}{'error':>8}{'touches':>9}{'first ms':>10}{'min ms':>9}"
        f"{'median ms':>11}{'runs':>5}{'ratio':>8}"
    ]
    for timing in sorted(timings, key=lambda timing: timing.median):
        record = timing.record
        touches = "-" if record.found is None else f"{record.found[LEFT]}/{record.found[RIGHT]}"
        lines.append(
            f"  {record.method:30}{record.knob + f' {record.setting:.0e}':17}{record.error:8.1e}{touches:>9}"
            f"{1e3 * record.first:10.1f}{1e3 * timing.least:9.3f}{1e3 * timing.median:11.3f}{timing.repeats:5}"
            f"{timing.median / ours:8.2f}"
        )
    for family in dict.fromkeys(timing.record.family for timing in timings):
        best = min((t for t in timings if t.record.family == family and t.record.method != EXACT),
                   key=lambda timing: timing.median, default=None)
        if best is not None:
            lines.append(f"  ratio of medians, {family} at its best ({best.record.method}) / {EXACT}:"
                         f" {best.median / ours:.2f}")
    return lines


def _failure(record: Record) -> str:
    best = "no result" if record.error is None else f"does not reach it: best {record.error:.1e}"
    return f"  {record.method:30}{best}, {record.knob} {record.setting:.0e}: {record.status}"


def _growth(scene: Scene) -> list[str]:
    """Cost of the scene over other horizons, and of one without contacts: contacts count, the duration does not."""
    lines = [f"\ncost of the last state {'horizon s':>12}{'touches':>9}{'median ms':>11}{'us a touch':>12}"]
    exact = next(contender for contender in own_contenders() if contender.name == EXACT)
    quiet = scenes.load("no_contact")
    longers = [predictability.horizon(scene, factor * scene.duration) for factor in HORIZONS]
    for longer in [*longers, *(predictability.horizon(quiet, duration) for duration in ENDURANCE_S)]:
        solve = exact.build(longer, exact.ladder[-1])
        grid = np.array([longer.duration])
        touches = sum(solve(grid).touches or (0, 0))
        median = statistics.median(seconds(solve, grid) for _ in range(MOST))
        each = f"{1e6 * median / touches:12.1f}" if touches else f"{'-':>12}"
        lines.append(f"  {longer.name:20}{longer.duration:12g}{touches:9}{1e3 * median:11.4f}{each}")
    return lines
