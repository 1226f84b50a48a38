"""All statements of the paper, by key, and how they are judged in several processes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import islice

from lab.paper.cases import Cases, Start
from lab.paper.claims import Claim, Part
from lab.paper.conclusions import conclusions
from lab.paper.measures import Key, Wish, key_of
from lab.paper.observations import observations
from lab.paper.running_text import running_text
from lab.paper.statement import Judged, Statement

PIECE = 50  # starts that a process measures before it reports


def statements() -> dict[str, Statement]:
    """Observations O1 to O12, conclusions C1 to C3, running text T1 on."""
    return {each.key: each for each in (*observations(), *conclusions(), *running_text())}


def parts(known: Mapping[str, Statement]) -> list[Judged]:
    """The parts of all statements, each once; in every process in the same order."""
    found: list[Judged] = []
    for part in (part for statement in known.values() for part in statement.parts):
        if part not in found:
            found.append(part)
    return found


def wishes_of(cases: Cases, starts: Sequence[Start]) -> list[list[Wish]]:
    """What each part measures."""
    return [list(part.wishes(cases, starts)) for part in parts(statements())]


def pieces(wishes: Iterable[Wish]) -> list[list[Wish]]:
    """What is measured in all, each once, in pieces for several processes, see `found_of`."""
    first: dict[Key, Wish] = {}
    starts: dict[Key, dict[Start, None]] = {}
    for wish in wishes:
        key = key_of(wish.scene, wish.name)
        first.setdefault(key, wish)
        starts.setdefault(key, {}).update(dict.fromkeys(wish.starts))
    return [
        [wish._replace(starts=tuple(islice(starts[key], begin, begin + PIECE)))]
        for key, wish in first.items() for begin in range(0, len(starts[key]), PIECE)
    ]


def judged(place: int, cases: Cases, starts: Sequence[Start]) -> tuple[int, Part]:
    """The place of a part among `parts`, and how it is judged; for a process."""
    return place, parts(statements())[place].judge(cases, starts)


def claims_of(found: Mapping[int, Part]) -> list[Claim]:
    """The statements, put together of their parts."""
    known = statements()
    order = parts(known)
    return [each.claim([found[order.index(part)] for part in each.parts]) for each in known.values()]


def judge(cases: Cases, starts: Sequence[Start], keys: Iterable[str]) -> dict[str, Claim]:
    """Judge some statements in this process; what the tests break on purpose goes this way."""
    known = statements()
    return {key: known[key].judge(cases, starts) for key in keys}
