"""All statements of the paper, by key, and how they are judged in several processes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from grasp_ros import scene as scenes
from grasp_ros.studies.paper.cases import Cases, Start
from grasp_ros.studies.paper.claims import Claim
from grasp_ros.studies.paper.conclusions import conclusions
from grasp_ros.studies.paper.measures import Measures, measure, remember
from grasp_ros.studies.paper.observations import observations
from grasp_ros.studies.paper.running_text import running_text
from grasp_ros.studies.paper.statement import Statement


def statements() -> dict[str, Statement]:
    """Observations O1 to O12, conclusions C1 to C3, running text T1 on."""
    return {each.key: each for each in (*observations(), *conclusions(), *running_text())}


Wanted = tuple[str, bool]  # a scene as text, and whether it is to be measured until it settles


class Task(NamedTuple):
    """What a process needs to judge one statement."""

    key: str
    cases: Cases
    starts: Sequence[Start]
    known: dict[Wanted, Measures]


def wanted_of(cases: Cases, starts: Sequence[Start], keys: Iterable[str]) -> list[Wanted]:
    """What the statements compare, each once."""
    known = statements()
    return list(dict.fromkeys(wanted for key in keys for wanted in _wanted(known[key], cases, starts)))


def _wanted(statement: Statement, cases: Cases, starts: Sequence[Start]) -> Iterator[Wanted]:
    return ((scene.to_yaml(), settle) for scene, settle in statement.scenes(cases, starts))


def measured(wanted: Wanted) -> tuple[Wanted, Measures]:
    """A scene and its measures; for a process."""
    text, settle = wanted
    return wanted, measure(scenes.parse(text, "a scene of the study", "a scene of the study"), settle)


def judged(task: Task) -> Claim:
    """The judgement of one statement; for a process."""
    remember(task.known)
    return statements()[task.key].judge(task.cases, task.starts)


def tasks(cases: Cases, starts: Sequence[Start], known: dict[Wanted, Measures]) -> list[Task]:
    """A task for each statement, with the measures that it asks for."""
    return [
        Task(key, cases, starts, {wanted: known[wanted] for wanted in _wanted(statement, cases, starts)})
        for key, statement in statements().items()
    ]


def judge(cases: Cases, starts: Sequence[Start], keys: Iterable[str]) -> dict[str, Claim]:
    """Judge some statements in this process; what the tests break on purpose goes this way."""
    known = statements()
    return {key: known[key].judge(cases, starts) for key in keys}
