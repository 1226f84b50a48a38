"""A bar that shows how far a computation is: in a terminal or a notebook, and none where nobody looks."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

from grasp_ros.physics.errors import Refused

Told = Callable[[Any], object]  # of a number
DELAY_S = 0.5  # a computation that is over by then needs no bar


def showing(progress: Told | bool | None, total: float | None, unit: str, name: str
            ) -> AbstractContextManager[Told | None]:
    """What is to be told how far a computation is: what a caller gave, a bar in place of True, or nothing.

    `total` is what the last call says, where it is known; the name stands in front of the bar.
    """
    if not isinstance(progress, bool):
        if not (progress is None or callable(progress)):
            raise Refused(f"progress: {progress!r} is not allowed; allowed: True, False, or what can be called")
        return nullcontext(progress)
    moves = os.environ.get("TERM", "") != "dumb" and "NO_COLOR" not in os.environ  # it may move the cursor
    looked_at = "ipykernel" in sys.modules or (sys.stderr.isatty() and moves)  # in a notebook, or on a terminal
    return _bar(total, unit, name) if progress and looked_at else nullcontext()


@contextmanager
def _bar(total: float | None, unit: str, name: str) -> Iterator[Told]:
    from tqdm.auto import tqdm

    with tqdm(total=total, unit=unit, desc=name, delay=DELAY_S, smoothing=0.05) as bar:
        yield lambda reached: bar.update(reached - bar.n)
