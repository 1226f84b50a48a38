"""The page of scenes with corners: what an independent checker reported, our error before, and now.

`python -m grasp_ros.studies.found page DIRECTORY PAGE` measures and writes the page;
`python -m grasp_ros.studies.found before DIRECTORY` measures and keeps it as what was before.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from grasp_ros.studies.document import prose, table, write
from grasp_ros.verification.found import LIMIT, Answer, Verdict, answers, read, verdict

BEFORE, REPORTED = "before.json", "reported.json"
HEADS = ("scene", "what it is", "until", "events", "amplification", "reported", "before", "now")
INTRODUCTION = (
    "An independent checker drew scenes with corners and reported those whose balances, records or bits it doubted. "
    "Each is here with the right answer, which `grasp_ros.verification.reference` gives in 25 digits.",
    "The error is relative to what one rounding explains: one of the state, and one of each number of the scene, "
    "amplified by the motion. A column `amplification` says what the latter has become, in roundings of the state. "
    f"Up to {LIMIT:g} roundings are right; bold is what is not. `until` is where the comparison ends, in s, if that "
    "is before the end of the scene: where the reference needs too many steps.",
    "`reported` is the size of the violation that the checker saw, in units of what it took for explained; where our "
    "error was small before, its bound was too strict, or it looked at what an end state does not tell: recorded "
    "times and modes, bits under symmetry and scaling, splitting.",
)


def measure(directory: Path) -> dict[str, Verdict]:
    """Run all scenes of a directory."""
    right = answers(directory)
    return {name: verdict(scene, right[name]) for name, scene in read(directory).items()}


def _text(found: Verdict | None) -> str:
    if found is None:
        return "-"
    if found.error == math.inf:
        return f"**{found.status}**"
    return f"{found.error:.1f}" if found.error <= LIMIT else f"**{found.error:.1e}**"


def _load(path: Path) -> Mapping[str, object]:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def page(directory: Path) -> str:
    """The page, with everything measured anew."""
    now, right = measure(directory), answers(directory)
    before = {name: Verdict(*fields) for name, fields in _load(directory / BEFORE).items()}  # type: ignore[misc]
    reported = _load(directory / REPORTED)
    rows = [_row(name, scene.title, scene.duration, right[name], str(reported.get(name, "-")), before.get(name),
                 now[name]) for name, scene in read(directory).items()]
    counts = [sum(found.error <= LIMIT for found in verdicts.values())
              for verdicts in (before, now)]
    summary = f"Right: {counts[0]} of {len(now)} before, {counts[1]} now."
    command = "Written by `python -m grasp_ros.studies.found page DIRECTORY PAGE`."
    return "\n\n".join(("# Scenes with corners", command, *map(prose, INTRODUCTION), summary,
                        table(HEADS, rows))) + "\n"


def _row(name: str, title: str, duration: float, right: Answer, reported: str, before: Verdict | None,
         now: Verdict) -> list[str]:
    end = f"{right.t[-1]:.3g}" if right.t[-1] < duration else ""
    amplification = f"{max(right.amplification):.1g}"
    return [name, title, end, str(right.events), amplification, reported, _text(before), _text(now)]


def main(arguments: Sequence[str]) -> int:
    """Write the page, or keep what was measured."""
    what, directory = arguments[0], Path(arguments[1])
    if what == "page":
        write(Path(arguments[2]), page(directory))
    else:
        write(directory / BEFORE, json.dumps(measure(directory), indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
