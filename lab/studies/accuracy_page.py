"""Runs all studies of accuracy and writes docs/accuracy.md with its figures and records."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from grasp_ros import scene as scenes
from grasp_ros import simulation
from grasp_ros.accuracy.measure import OURS, Record, fastest
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.scene import Scene
from grasp_ros.scene.files import writing
from lab.reference.grasp import grasp_of
from lab.studies import (
    accuracy,
    accuracy_rows,
    drift,
    figures,
    loop,
    measure,
    pages,
    predictability,
    profile,
    speed,
    stability,
)
from lab.studies.contenders import all_contenders
from lab.studies.records import Journal, write_records

LOOP_SCENE = "case_01"
QUICK_S = 5.0
QUICK_DRIFT = {EXACT: 1e-16, "paper": 1e-3, "discrete_gradient": 1e-3}


def run(docs: Path | None, directory: Path, quick: bool) -> None:
    """Run all studies, as far as the journal does not have them, and write the page.

    Parameters
    ----------
    docs : Path, optional
        Directory of the page, default that of the journal; figures and records go to `accuracy` in it.
    directory : Path
        The journal.
    quick : bool
        Few settings on two short scenes, without the outside peers and without ROS.

    Raises
    ------
    Refused
        If a directory cannot be written.
    """
    docs = docs or directory
    folder = docs / "accuracy"
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    subjects = accuracy.default_scenes()
    case = scenes.load(LOOP_SCENE)
    if quick:
        *subjects, case = (scene.changed({"time.duration_s": QUICK_S}) for scene in (*subjects[:2], case))
    records = accuracy.run(subjects, directory, measure.QUICK if quick else measure.FULL, [
        contender for contender in all_contenders(case) if contender.family == OURS or not quick])
    drifts = drift.run(directory, *((QUICK_S, QUICK_DRIFT) if quick else (drift.SECONDS, None)))
    predictions = predictability.run(subjects, QUICK_S if quick else predictability.SECONDS)
    arm = grasp_of(case).left
    limits = stability.limits(arm)
    points = loop.run(case, directory, () if quick else loop.GRAPH_PERIODS_MS)

    write_records(records, folder / "records.csv")
    figures.work_precision(records, accuracy.METRIC, folder / "error_against_time.png")
    figures.contacts_missed(records, folder / "contacts_missed.png")
    figures.energy_drift(drifts, folder / "energy_drift.png")
    figures.prediction(predictions, folder / "prediction.png")
    figures.control_period(points, case.name, folder / "control_period.png")
    figures.stability(arm, limits, folder / "stability.png")
    pages.write(
        docs, "accuracy", metric=accuracy.METRIC, points=simulation.GRID_POINTS, **accuracy_rows.by_error(records),
        drift=accuracy_rows.drift(drifts), prediction=accuracy_rows.prediction(predictions),
        topics=accuracy_rows.topics(case.title, points, limits),
        profiles=_profiles(subjects, records),
        last=None if quick else accuracy_rows.last_state(_final_states(subjects, directory)),
    )


def _profiles(subjects: Sequence[Scene], records: Sequence[Record]) -> list[list[str]]:
    """Where the time of `exact` goes, at its fastest setting for the error; its finest where that is not reached."""
    found = []
    for scene in subjects:
        own = [record for record in records if (record.scene, record.method) == (scene.name, EXACT)]
        first = fastest(own, accuracy_rows.ERROR)
        found.append(profile.row(scene, METHODS[EXACT].default if first is None else first.setting))
    return found


def _final_states(subjects: Sequence[Scene], directory: Path) -> dict[str, list[speed.Timing | None]]:
    journal = Journal(directory)
    return {scene.name: speed.final_state(scene, measure.truth(scene, journal), accuracy_rows.ERROR)
            for scene in subjects}
