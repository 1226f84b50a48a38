"""Exact hybrid integration: every compiled kernel of the method `exact`, and the integrator that drives them.

`integrator` is the door. `hybrid` joins the segments: `flight` between contacts, `contact` with `series` and
`polynomial` in them; `modes` is the automaton, `friction` that of the object, `energy_check` compares energies. `loop`
goes from interval to interval, with the controllers of `control` and `foreign`.
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
