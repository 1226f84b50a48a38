"""Runs all studies of accuracy and writes docs/accuracy.md with its figures and records."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros import simulation
from grasp_ros.accuracy.measure import OURS, Record, by_method, fastest
from grasp_ros.methods.contract import TOLERANCE
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.scene import Scene
from grasp_ros.scene.files import writing
from lab.reference.grasp import grasp_of
from lab.studies import accuracy, drift, figures, loop, pages, predictability, speed
from lab.studies.drift import Drift
from lab.studies.loop import Limit, Point
from lab.studies.records import Journal, by_scene, milliseconds, write_records

LOOP_SCENE = "case_01"
QUICK_S = 5.0
QUICK_DRIFT = {EXACT: 1e-16, "paper": 1e-3, "discrete_gradient": 1e-3}
SAME_TOLERANCE = 1e-8
LOOSE, ERROR = 1e-3, 1e-9
RIVALS = {
    "`solve_ivp` at its best": [name for name, method in METHODS.items() if method.package == "scipy"],
    "`odeint`": ["odeint"],
    "SUNDIALS at its best": [f"cvode_{kind}{events}" for kind in ("adams", "bdf") for events in ("", "_events")],
    "heyoka at its best": ["heyoka", "heyoka_fast_math"],
}


def run(docs: Path | None, directory: Path, quick: bool) -> None:
    """Run all studies, as far as the journal in the directory does not have them, and write the page.

    Figures and records go to `accuracy` beside it; without `docs` all goes to the directory of the journal. `quick`:
    few settings on two short scenes, without the outside peers and without ROS.
    """
    docs = docs or directory
    folder = docs / "accuracy"
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    subjects = accuracy.default_scenes()
    case = scenes.load(LOOP_SCENE)
    if quick:
        *subjects, case = (scene.changed({"time.duration_s": QUICK_S}) for scene in (*subjects[:2], case))
    records = accuracy.run(subjects, directory, accuracy.QUICK if quick else accuracy.FULL, [
        contender for contender in accuracy.all_contenders(case) if contender.family == OURS or not quick])
    drifts = drift.run(directory, *((QUICK_S, QUICK_DRIFT) if quick else (drift.SECONDS, None)))
    predictions = [predictability.predict(scene, QUICK_S if quick else predictability.SECONDS) for scene in subjects]
    arm = grasp_of(case).left
    limits = loop.limits(arm)
    points = loop.run(case, directory, () if quick else loop.GRAPH_PERIODS_MS)

    write_records(records, folder / "records.csv")
    figures.work_precision(records, accuracy.METRIC, folder / "error_against_time.png")
    figures.contacts_missed(records, folder / "contacts_missed.png")
    figures.energy_drift(drifts, folder / "energy_drift.png")
    figures.prediction(predictions, folder / "prediction.png")
    figures.control_period(points, case.name, folder / "control_period.png")
    figures.stability(arm, limits, folder / "stability.png")
    pages.write(
        docs, "accuracy", metric=accuracy.METRIC, points=simulation.GRID_POINTS, **_by_error(records),
        drift=_drift(drifts), prediction=_prediction(predictions), topics=_topics(case.title, points, limits),
        profiles=[_profile(scene, records) for scene in subjects],
        last=None if quick else _last_state(subjects, Journal(directory)),
    )


def _profile(scene: Scene, records: Sequence[Record]) -> list[str]:
    """Where the time of `exact` goes, at its fastest setting for the error; its finest where that is not reached."""
    own = [record for record in records if (record.scene, record.method) == (scene.name, EXACT)]
    first = fastest(own, ERROR)
    return speed.profile(scene, METHODS[EXACT].default if first is None else first.setting)


def _by_error(records: Sequence[Record]) -> dict[str, Any]:
    """What follows from the records of error against time."""
    scenes = by_scene(records)
    return {
        "targets": [f"error <= {target:.0e}" for target in accuracy.TARGETS], "choice": _choice(scenes),
        "paper": [_paper(name, here) for name, here in scenes.items()], "tolerance": _tolerance(records, list(scenes)),
        "missed": _missed(records), "ahead": {"error": ERROR, "rivals": list(RIVALS), "rows": _ahead(scenes)},
        "methods": [[f"`{m.name}`", m.order, m.at_touch, m.source] for m in METHODS.values()],
    }


def _choice(scenes: dict[str, list[Record]]) -> dict[str, Any]:
    rows, ahead, ratios, finest = [], 0, [], []
    for name, here in scenes.items():
        mine = [record for record in here if record.method == EXACT]
        others = [record for record in here if record.method != EXACT]
        pairs = [(fastest(mine, error), fastest(others, error)) for error in accuracy.TARGETS]
        rows.append([name, *(f"{_cell(own)}; {_cell(other)}" for own, other in pairs)])
        own, other = pairs[accuracy.TARGETS.index(ERROR)]
        if own is not None:
            ahead += other is None or own.time < other.time
            ratios += [] if other is None else [other.time / own.time]
        loose, tight = pairs[accuracy.TARGETS.index(LOOSE)][0], min(mine, key=lambda record: record.setting)
        finest += [] if loose is None else [tight.time / loose.time]
    return {"rows": rows, "ahead": ahead, "ratios": ratios, "finest": finest, "error": ERROR, "loose": LOOSE}


def _paper(name: str, here: Sequence[Record]) -> list[str]:
    runs = [record for record in here if record.method == "paper"]
    found, own = fastest(runs, LOOSE), _fastest(here, [EXACT], LOOSE)
    best = min((record for record in runs if record.good), key=lambda record: record.error or 0.0, default=None)
    return [
        name, "not reached" if found is None else f"step {found.setting:g} s, {milliseconds(found)}",
        "-" if found is None or own is None else f"{found.time / own.time:.3g}",
        "-" if best is None else f"{best.error:.1e} with steps of {best.setting:g} s in {milliseconds(best)}",
    ]


def _tolerance(records: Sequence[Record], names: list[str]) -> dict[str, Any]:
    chosen = [r for r in records if r.knob == TOLERANCE and abs(r.setting / SAME_TOLERANCE - 1.0) < 1e-6]
    factors = [record.error / SAME_TOLERANCE for record in chosen if record.error is not None]
    rows = []
    for method, group in by_method(chosen).items():
        there = {record.scene: record for record in group}
        rows.append([method, *(_error(there.get(name)) for name in names)])
    return {"setting": SAME_TOLERANCE, "scenes": names, "rows": rows if factors else [],
            "low": min(factors, default=0.0), "high": max(factors, default=0.0)}


def _missed(records: Sequence[Record]) -> dict[str, Any]:
    wrong = [record for record in records if record.missed]
    failed = [[r.scene, r.method, f"{r.knob} {r.setting:.0e}", r.status] for r in records if not r.good]
    return {"wrong": len(wrong), "runs": len(records), "silent": sum(record.status == "done" for record in wrong),
            "failed": failed}


def _ahead(scenes: dict[str, list[Record]]) -> list[list[str]]:
    """How far ahead of each kind of rival `exact` is."""
    rows = []
    for name, here in scenes.items():
        own = _fastest(here, [EXACT], ERROR)
        others = [_fastest(here, names, ERROR) for names in RIVALS.values()]
        rows.append([name, *(f"{o.time / own.time:.3g} ({o.method})" if o and own else "not reached" for o in others)])
    return rows


def _drift(drifts: Sequence[Drift]) -> dict[str, Any]:
    """Energy drift in the elastic case."""
    rows = [
        [row.method, row.setting, f"{row.worst:.1e}" if row.t else "-", f"{row.seconds:.2g} s", row.status]
        for row in sorted(drifts, key=lambda row: row.worst)
    ]
    return {"rows": rows, "seconds": max((row.t[-1] for row in drifts if row.t), default=0.0)}


def _prediction(predictions: Sequence[predictability.Prediction]) -> dict[str, Any]:
    """How far ahead a scene can be predicted."""
    rows = []
    for row in predictions:
        ends = [row.until(level) for level in predictability.LEVELS]
        times = [f"> {row.t[-1]:g} s" if end is None else f"{end:.1f} s" for end in ends]
        rows.append([row.scene, f"{row.growth:.0e}", *times])
    levels = [f"below {level:.0e} until" for level in predictability.LEVELS]
    return {"rows": rows, "levels": levels, "roundings": predictability.ROUNDINGS, "runs": predictability.RUNS}


def _topics(title: str, points: Sequence[Point], limits: Sequence[Limit]) -> dict[str, Any]:
    """What accuracy costs over topics, and where the sampled loop loses stability."""
    rows = []
    for point in points:
        walls = ["-" if w is None else f"{w:.3g}" for w in (point.one_process, point.four_processes, point.baseline)]
        rows.append([f"{point.period_ms:g} ms", f"{point.deviation:.1e} m", *walls])
    finest = points[-4:]
    order = np.polyfit(np.log([p.period_ms for p in finest]), np.log([p.deviation for p in finest]), 1)[0]
    edges = []
    for limit in limits:
        growth = ", ".join(f"{g:.5f} at {1e3 * h:.2f} ms" for h, g in limit.checks)
        edges.append([f"{limit.delay} periods", f"{1e3 * limit.period:.10g} ms", growth])
    return {"scene": title, "rows": rows, "order": order, "limits": edges}


def _last_state(subjects: Sequence[Scene], journal: Journal) -> dict[str, Any]:
    """The last state alone, where a rival has less to do."""
    rows, ratios = [], []
    for scene in subjects:
        own, other = speed.final_state(scene, accuracy.truth(scene, journal), ERROR)
        ratio = other.median / own.median if own and other else None
        ratios += [] if ratio is None else [ratio]
        cells = [f"{1e3 * t.median:.3g} ms, error {t.error:.0e}" if t else "not reached" for t in (own, other)]
        rows.append([scene.name, *cells, "-" if ratio is None else f"{ratio:.2f}"])
    return {"rows": rows, "ahead": sum(ratio > 1.0 for ratio in ratios)}


def _fastest(records: Sequence[Record], names: Sequence[str], error: float) -> Record | None:
    return fastest([record for record in records if record.method in names], error)


def _cell(record: Record | None) -> str:
    return "not reached" if record is None else f"{record.method} {milliseconds(record)}"


def _error(record: Record | None) -> str:
    if record is None or record.error is None:
        return "-" if record is None else record.status
    return f"{record.error:.0e}" + (f" ({record.missed} touches wrong)" if record.missed else "")
