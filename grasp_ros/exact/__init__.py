"""Exact hybrid integration: every compiled kernel of the method `exact`, and the integrator that drives them.

`integrator` is the door. `hybrid` joins the segments: `flight` between contacts, `contact` with `series` and
`polynomial` in them; `modes` is the automaton, `friction` that of the object, `energy_check` compares energies. `loop`
goes from interval to interval, with the controllers of `control` and `foreign`.
"""

from grasp_ros.exact.events import Event
from grasp_ros.exact.integrator import Integrator, Status

__all__ = ["Event", "Integrator", "Status"]
