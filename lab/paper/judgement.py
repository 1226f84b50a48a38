"""All statements of the paper, by key, and how they are judged in several processes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from grasp_ros.scene import Scene
from lab.paper.cases import Cases, Start, text_of
from lab.paper.claims import Claim, Part
from lab.paper.conclusions import conclusions
from lab.paper.measures import Measures, measure, remember
from lab.paper.observations import observations
from lab.paper.running_text import running_text
from lab.paper.statement import Judged, Statement


def statements() -> dict[str, Statement]:
    """Observations O1 to O12, conclusions C1 to C3, running text T1 on."""
    return {each.key: each for each in (*observations(), *conclusions(), *running_text())}


Wanted = tuple[str, bool]  # a scene by its numbers, and whether it is to be measured until it settles
Wish = tuple[Scene, bool]


class Task(NamedTuple):
    """What a process needs to judge one part, which stands in one statement or in several."""

    place: int  # among `parts`
    cases: Cases
    starts: Sequence[Start]
    known: dict[Wanted, Measures]


def parts(known: Mapping[str, Statement]) -> list[Judged]:
    """The parts of all statements, each once; in every process in the same order."""
    found: list[Judged] = []
    for part in (part for statement in known.values() for part in statement.parts):
        if part not in found:
            found.append(part)
    return found


def wanted_of(cases: Cases, starts: Sequence[Start]) -> list[dict[Wanted, Wish]]:
    """What each part compares; what settles is measured until then everywhere, and only once."""
    found = [list(part.scenes(cases, starts)) for part in parts(statements())]
    settling = {text_of(scene) for wishes in found for scene, settle in wishes if settle}
    return [{(text := text_of(scene), text in settling): (scene, text in settling) for scene, _ in wishes}
            for wishes in found]


def measured(wish: Wish) -> tuple[Wanted, Measures]:
    """A scene and its measures; for a process."""
    scene, settle = wish
    return (text_of(scene), settle), measure(scene, settle)


def judged(task: Task) -> tuple[int, Part]:
    """The place of a part, and how it is judged; for a process."""
    remember(task.known)
    return task.place, parts(statements())[task.place].judge(task.cases, task.starts)


def tasks(
    cases: Cases, starts: Sequence[Start], wanted: Sequence[Iterable[Wanted]], known: Mapping[Wanted, Measures]
) -> list[Task]:
    """A task for each part, with the measures that it asks for."""
    return [Task(place, cases, starts, {each: known[each] for each in own}) for place, own in enumerate(wanted)]


def claims_of(found: Mapping[int, Part]) -> list[Claim]:
    """The statements, put together of their parts."""
    known = statements()
    order = parts(known)
    return [each.claim([found[order.index(part)] for part in each.parts]) for each in known.values()]


def judge(cases: Cases, starts: Sequence[Start], keys: Iterable[str]) -> dict[str, Claim]:
    """Judge some statements in this process; what the tests break on purpose goes this way."""
    known = statements()
    return {key: known[key].judge(cases, starts) for key in keys}
