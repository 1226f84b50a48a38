"""What a scene simulates, as arrays: bodies, pairs, friction, controllers and external forces.

The effects of a scene put it together, see `grasp_ros.scene.effects`. What no effect has named has no mass, no
stiffness of contact, no controller and no force here, and is not simulated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.control import Column, ControlLaw, feedback
from grasp_ros.physics.impact_law import damping_factor, elastic_force
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Law, Of
from grasp_ros.physics.model import Arm, Array

NO_LAW = ControlLaw()
A_SYSTEM = "a System, such as the system of a Scene"
BODIES = (LEFT, OBJECT, RIGHT)  # in the order of the state
NAMES: dict[int, str] = {LEFT: "left", OBJECT: "object", RIGHT: "right"}
Target = tuple[str, int, int]  # array of a system, row, column
COLUMN: dict[int, int] = {LEFT: 0, OBJECT: 2, RIGHT: 4}  # of the position in a state (6,); the velocity is the next
PAIR_COLUMNS: dict[int, tuple[int, int]] = {LEFT: (0, 2), RIGHT: (2, 4)}  # of the positions between which u is


class ExternalForce(NamedTuple):
    """A force on one body, constant over each control period."""

    section: str  # of the scene, to which it belongs
    body: int
    at: Callable[[NDArray[np.int64]], Array]  # ticks (n,) to N (n,), from each of them to the next
    changes: Callable[[int], Sequence[int]]  # ascending ticks of the run, in (0, n), at which it may change, from n


@dataclass
class System:
    """A scene as arrays."""

    # of every body by itself, see `layout`; mass 0: no such body
    bodies: Array = field(default_factory=lambda: np.zeros((3, 4)))
    pairs: Array = field(default_factory=lambda: np.zeros((2, 2)))  # H and p; H = 0: no such pair
    state: Array = field(default_factory=lambda: np.zeros(6))  # at t = 0, m and m/s; 0 for what is not there
    coulomb: float = 0.0  # dry friction of the object, N
    laws: dict[int, ControlLaw] = field(default_factory=dict)  # controllers by side
    external: list[ExternalForce] = field(default_factory=list)
    delay: int = 0  # control periods from a state to the command that answers it
    sampled: bool = False  # whether commands are held over control periods; otherwise the feedback acts continuously
    caveats: list[str] = field(default_factory=list)  # why V_c may rise

    def put(self, target: Target, number: float) -> None:
        """Write a number of a scene to its target; the first one of a controller makes its law."""
        array, row, column = target
        if array == "coulomb":
            self.coulomb = number
        elif array == "laws":
            self.laws.setdefault(row, ControlLaw()).row[column] = number
        else:
            rows = getattr(self, array)
            rows.reshape(len(rows), -1)[row, column] = number

    @property
    def present(self) -> list[int]:
        """Bodies that are there, in the order of the state."""
        masses = self.bodies[:, Of.MASS].tolist()  # a list is read faster, and a monitor asks often
        return [body for body in BODIES if masses[body] > 0.0]

    @property
    def absent(self) -> list[int]:
        """Bodies that are not there."""
        masses = self.bodies[:, Of.MASS].tolist()
        return [body for body in BODIES if masses[body] == 0.0] if 0.0 in masses else []

    @property
    def absent_columns(self) -> list[int]:
        """Columns of states (..., 6) of bodies that are not there."""
        return [COLUMN[body] + part for body in self.absent for part in (0, 1)]

    @property
    def contacts(self) -> list[int]:
        """Sides whose pair can push."""
        hertzian = self.pairs[:, Law.HERTZIAN].tolist()
        return [side for side in (LEFT, RIGHT) if hertzian[side] > 0.0]

    @property
    def closed_loop(self) -> Array:
        """`bodies` with the continuous feedback of the controllers, (4), (5), in them."""
        return np.array(self.rows(True))

    def rows(self, closed_loop: bool) -> list[list[float]]:
        """`closed_loop`, or `bodies`, as lists, which of three rows are faster than arrays."""
        bodies: list[list[float]] = self.bodies.tolist()
        for side, law in self.laws.items() if closed_loop else ():
            (mass, stiffness, damping, force), (kp, kv, set_point, feed_forward, *_) = bodies[side], law.row.tolist()
            bodies[side] = [mass, stiffness + kp, damping + kv, force + (kp * set_point + feed_forward)]
        return bodies

    @property
    def law_rows(self) -> Array:
        """Laws of the controllers (2, k), rows of `control` by side; without a controller a row that answers 0."""
        return np.array([self.laws.get(side, NO_LAW).row for side in (LEFT, RIGHT)])

    def arm(self, side: int) -> Arm:
        """An arm with the gains of its controller."""
        return Arm(*self.bodies[side, : Of.FORCE].tolist(), *self.laws[side].row[: Column.SET_POINT].tolist())

    def external_at(self, tick: int) -> Array:
        """External forces (3,) in N from a tick to the next, by body."""
        return np.asarray(self.external_over(np.array([tick]))[0])

    def external_over(self, ticks: NDArray[np.int64]) -> Array:
        """External forces (n, 3) in N, by body, from each of the ticks (n,) to the next."""
        forces = np.zeros((len(ticks), 3))
        for force in self.external:
            forces[:, force.body] += force.at(ticks)
        return forces

    def impact(self, side: int, state: Sequence[float]) -> float:
        """Impact force fw of a pair in N, in a state (6,); that of `model`, to the bit, in a twentieth of the time."""
        front, back = PAIR_COLUMNS[side]
        u, u_rate = (state[front + part] - state[back + part] for part in (0, 1))
        hertzian, dissipation = self.pairs[side].tolist()
        factor = damping_factor(dissipation, u_rate)
        return factor * float(elastic_force(hertzian, u)) if u >= 0.0 <= factor else 0.0

    def feedback(self, state: Array) -> Array:
        """Continuous feedback (n, 2) of the left and the right arm in N, (4), (5), for states (n, 6)."""
        forces = np.zeros((len(state), 2))
        for side, law in self.laws.items():
            forces[:, side] = feedback(law.row, state[:, COLUMN[side]], state[:, COLUMN[side] + 1])
        return forces
