"""All statements of the paper, by key, and how they are judged in several processes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from grasp_ros.scene import Scene
from lab.paper.cases import Cases, Start, text_of
from lab.paper.claims import Claim
from lab.paper.conclusions import conclusions
from lab.paper.measures import Measures, measure, remember
from lab.paper.observations import observations
from lab.paper.running_text import running_text
from lab.paper.statement import Statement


def statements() -> dict[str, Statement]:
    """Observations O1 to O12, conclusions C1 to C3, running text T1 on."""
    return {each.key: each for each in (*observations(), *conclusions(), *running_text())}


Wanted = tuple[str, bool]  # a scene by its numbers, and whether it is to be measured until it settles
Wish = tuple[Scene, bool]


class Task(NamedTuple):
    """What a process needs to judge one statement."""

    key: str
    cases: Cases
    starts: Sequence[Start]
    known: dict[Wanted, Measures]


def wanted_of(cases: Cases, starts: Sequence[Start], keys: Iterable[str]) -> dict[str, dict[Wanted, Wish]]:
    """What each statement compares; what settles is measured until then everywhere, and only once."""
    known = statements()
    found = {key: list(known[key].scenes(cases, starts)) for key in keys}
    settling = {text_of(scene) for wishes in found.values() for scene, settle in wishes if settle}
    return {
        key: {(text := text_of(scene), text in settling): (scene, text in settling) for scene, _ in wishes}
        for key, wishes in found.items()
    }


def measured(wish: Wish) -> tuple[Wanted, Measures]:
    """A scene and its measures; for a process."""
    scene, settle = wish
    return (text_of(scene), settle), measure(scene, settle)


def judged(task: Task) -> Claim:
    """The judgement of one statement; for a process."""
    remember(task.known)
    return statements()[task.key].judge(task.cases, task.starts)


def tasks(
    cases: Cases, starts: Sequence[Start], wanted: Mapping[str, Iterable[Wanted]], known: Mapping[Wanted, Measures]
) -> list[Task]:
    """A task for each statement, with the measures that it asks for."""
    return [Task(key, cases, starts, {each: known[each] for each in own}) for key, own in wanted.items()]


def judge(cases: Cases, starts: Sequence[Start], keys: Iterable[str]) -> dict[str, Claim]:
    """Judge some statements in this process; what the tests break on purpose goes this way."""
    known = statements()
    return {key: known[key].judge(cases, starts) for key in keys}
