"""All statements of the paper, by key."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lab.paper.cases import Cases, Start
from lab.paper.claims import Claim
from lab.paper.conclusions import conclusions
from lab.paper.observations import observations
from lab.paper.running_text import running_text
from lab.paper.statement import Statement


def statements() -> dict[str, Statement]:
    """Observations O1 to O12, conclusions C1 to C3, running text T1 on."""
    return {each.key: each for each in (*observations(), *conclusions(), *running_text())}


def judge(cases: Cases, starts: Sequence[Start], keys: Iterable[str]) -> dict[str, Claim]:
    """Judge some statements."""
    known = statements()
    return {key: known[key].judge(cases, starts) for key in keys}
