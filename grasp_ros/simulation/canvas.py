"""Figures of this package: matplotlib with its defaults, whatever the settings of the user.

No window, no backend and no setting of the process is touched, so that a notebook keeps its own. A `matplotlibrc` that
cannot be read, and a backend that is not there, are left aside.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

SETTINGS = ("MATPLOTLIBRC", "MPLBACKEND")  # variables of the environment

try:
    import matplotlib
except (OSError, ValueError):  # a file of settings that is no text, or a backend that is not there
    _before = {name: os.environ.pop(name) for name in SETTINGS if name in os.environ}
    for _name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"]:
        del sys.modules[_name]
    os.environ["MATPLOTLIBRC"] = os.devnull
    try:
        import matplotlib
    finally:
        del os.environ["MATPLOTLIBRC"]
        os.environ.update(_before)

from matplotlib import colormaps  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: E402
from matplotlib.colors import LogNorm, Normalize  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

__all__ = ["Axes", "Figure", "LogNorm", "Normalize", "colormaps", "figure", "style", "subplots"]
OTHERS = ("backend", "backend_fallback", "interactive", "toolbar", "timezone")  # of windows and of dates: we draw none
DEFAULTS = {name: value for name, value in matplotlib.rcParamsDefault.items() if name not in OTHERS}
DEFAULTS["axes.formatter.useoffset"] = False  # 19.995, and not 0.005 with an offset +1.999e1


@contextmanager
def style(own: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Draw with the defaults of matplotlib, but for some settings: a whole figure is drawn within it."""
    with matplotlib.rc_context({**DEFAULTS, **(own or {})}):
        yield


def label(name: str, unit: str) -> str:
    """An outcome with its unit."""
    return f"{name.replace('_', ' ')}, {unit}".removesuffix(", 1")


def formats() -> list[str]:
    """Endings of the files that can be written."""
    return sorted(f".{name}" for name in FigureCanvasAgg.get_supported_filetypes())


def figure(**settings: Any) -> Figure:
    """A new figure, which no window and no `pyplot` knows."""
    new = Figure(**settings)
    FigureCanvasAgg(new)
    return new


def subplots(rows: int = 1, columns: int = 1, *, figsize: tuple[float, float], **settings: Any) -> tuple[Figure, Any]:
    """A new figure with its axes; see `matplotlib.figure.Figure.subplots`."""
    new = figure(figsize=figsize, layout="constrained")
    return new, new.subplots(rows, columns, **settings)
