"""What accuracy costs in time: every method at every setting on every scene, against the reference.

The study resumes where it stopped: what is in the journal and was measured on this machine, with these versions and
these sources, is not measured again.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros import simulation
from grasp_ros.accuracy.measure import Contender, Record
from grasp_ros.scene import Scene
from lab.studies import measure
from lab.studies.measure import Effort
from lab.studies.records import Journal, origin, scene_key

STANDARD = ("case_01", "case_02", "case_03", "case_04")
STIFF = ("case_01", 1e8)  # ten thousand times the paper's Hertz coefficient
TARGETS = (1e-3, 1e-6, 1e-9, 1e-11)
METRIC = (  # the label of every axis and column that shows `Record.error`
    f"largest absolute error over six states (m, m/s) and {simulation.GRID_POINTS} output times,"
    f" against a reference of {measure.DIGITS} digits"
)


def default_scenes() -> list[Scene]:
    """Cases 1 to 4 of the paper, and case 1 with a contact that is stiffer by 1e4."""
    name, hertzian = STIFF
    stiff = scenes.load(name, [f"{side}_contact.hertz_N_per_m1_5={hertzian}" for side in ("left", "right")])
    return [*map(scenes.load, STANDARD), replace(stiff, name=f"{name}_H{hertzian:.0e}".replace("+0", ""))]


def run(subjects: Sequence[Scene], directory: Path, effort: Effort, contenders: Sequence[Contender]) -> list[Record]:
    """Measure what is not in the journal yet; returns all records of these scenes."""
    journal = Journal(directory)
    records: list[Record] = []
    ladders = [contender.ladder[:: effort.stride] for contender in contenders]
    with tqdm(total=len(subjects) * sum(map(len, ladders)), unit="setting", file=sys.stderr) as bar:
        for scene in subjects:
            for contender, ladder in zip(contenders, ladders, strict=True):
                bar.set_description(f"{scene.name} {contender.name}")
                records += climb(contender, ladder, scene, journal, effort)
                bar.update(len(ladder))
    return records


def climb(
    contender: Contender, ladder: Iterable[float], scene: Scene, journal: Journal, effort: Effort
) -> list[Record]:
    """One method from loose to tight, until a run takes too long."""
    records = []
    made_by = origin(contender.family)
    for setting in ladder:
        key = f"{scene_key(scene)} {made_by} {contender.name} {setting!r} {effort.budget}"
        record = journal.kept(key, Record, partial(_attempt, contender, scene, setting, journal, effort))
        records.append(record._replace(scene=scene.name))
        if measure.given_up(record, effort):
            break
    return records


def _attempt(contender: Contender, scene: Scene, setting: float, journal: Journal, effort: Effort) -> Record:
    return measure.attempt(contender, scene, setting, measure.truth(scene, journal), effort)


def frontier(records: Iterable[Record]) -> list[Record]:
    """The records that no other beats in both time and error, from fast to accurate."""
    best: list[Record] = []
    for record in sorted((r for r in records if r.good), key=lambda r: (r.time, r.error or 0.0)):
        if not best or (record.error or 0.0) < (best[-1].error or 0.0):
            best.append(record)
    return best
