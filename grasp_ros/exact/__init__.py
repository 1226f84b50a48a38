"""Exact hybrid integration: every compiled kernel of the method `exact`, and the integrator that drives them.

`integrator` is the entry. `driver.advance` joins the segments: `flight` between contacts, `contact` in them;
`automaton` has the modes of pairs and object and every transition. `records` are the values that all of these hand to
each other, `compensated` moves a state, `tolerances` has the bounds by which a rounding decides. `numerics` and
`compilation` know nothing of grasps.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from grasp_ros.exact.events import Event
    from grasp_ros.exact.integrator import Integrator, Status

__all__ = ["Event", "Integrator", "Status"]


def __getattr__(name: str) -> Any:
    """What is imported from here brings the compiler; who only asks whether kernels are on disk needs none."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{'events' if name == 'Event' else 'integrator'}"), name)
