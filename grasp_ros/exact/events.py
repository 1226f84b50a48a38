"""Events of a run as records, beside the rows that the kernels write."""

from __future__ import annotations

from typing import NamedTuple

from grasp_ros.physics.layout import Body, Transition
from grasp_ros.physics.model import Array

_KINDS, _BODIES = tuple(Transition), tuple(Body)


class Event(NamedTuple):
    """One event of one pair, or of the object."""

    time: float  # s
    side: Body  # LEFT or RIGHT; OBJECT for what friction does
    kind: Transition
    u: float  # penetration, m; 0 for the object
    u_rate: float  # m/s; 0 for the object
    state: tuple[float, ...] = ()  # of all bodies at that time, m and m/s; empty if nobody asked for it


def to_events(table: Array, states: Array | None = None) -> list[Event]:
    """Records of rows (m, 5), with states (m, 6) at their times."""
    time, side, kind, u, u_rate = table.T.tolist()
    bodies = map(_BODIES.__getitem__, map(int, side))
    kinds = map(_KINDS.__getitem__, map(int, kind))
    rows = map(Event, time, bodies, kinds, u, u_rate)
    return list(rows) if states is None else [
        event._replace(state=tuple(state)) for event, state in zip(rows, states.tolist(), strict=True)]
