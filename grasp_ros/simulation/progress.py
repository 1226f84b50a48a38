"""A progress bar: in a terminal or a notebook, none elsewhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

from grasp_ros.physics.errors import Refused

Callback = Callable[[Any], object]  # gets a number
DELAY_S = 0.5  # shorter computations show no bar


def showing(progress: Callback | bool | None, total: float | None, unit: str, name: str
            ) -> AbstractContextManager[Callback | None]:
    """The callback that gets the progress of a computation: the caller's, that of a bar if True, or None.

    `total` is the number of the last call, where it is known; the name is the label of the bar.
    """
    if not isinstance(progress, bool):
        if not (progress is None or callable(progress)):
            raise Refused(f"progress: {progress!r} is not allowed; allowed: True, False, or what can be called")
        return nullcontext(progress)
    may_move_cursor = os.environ.get("TERM", "") != "dumb" and "NO_COLOR" not in os.environ
    visible = "ipykernel" in sys.modules or (sys.stderr.isatty() and may_move_cursor)  # in a notebook, on a terminal
    return _bar(total, unit, name) if progress and visible else nullcontext()


@contextmanager
def _bar(total: float | None, unit: str, name: str) -> Iterator[Callback]:
    from tqdm.auto import tqdm

    with tqdm(total=total, unit=unit, desc=name, delay=DELAY_S, smoothing=0.05) as bar:
        yield lambda reached: bar.update(reached - bar.n)
