"""The paper's eleven cases as scenes, the starts and the readings that the judgement varies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.scene import Scene

Cases = Mapping[int, Scene]  # by the paper's number


class Start(NamedTuple):
    """Where a motion begins, at rest, in m."""

    x_l: float
    x_r: float
    x_o: float = 0.0


POSITIONS = "left_arm.position_m", "right_arm.position_m", "object.position_m"  # keys of a start
STANDARD = 1
NUMBERS = tuple(range(1, 12))
PRINTED = Start(-0.3, 0.5)
SYMMETRIC = Start(-0.5, 0.5)
NEARLY = Start(-0.501, 0.5)  # what a symmetric start is in practice
MIRRORED = Start(-0.5, 0.3)  # the printed start seen from behind: no other motion, unless the arms differ
ALIKE = (PRINTED, SYMMETRIC, NEARLY)
LITERAL = Start(0.3, 0.5)  # Table 1 without the minus
READ_STARTS: Mapping[str, Start] = {  # beside the printed one
    "x_l(0) = -0.5, x_r(0) = 0.5 m": SYMMETRIC,
    "x_l(0) = -0.501, x_r(0) = 0.5 m": NEARLY,
    "x_l(0) = -0.3, x_r(0) = 0.3 m": Start(-0.3, 0.3),
    "x_l(0) = -0.5, x_r(0) = 0.3 m": MIRRORED,
    "x_l(0) = -0.3, x_o(0) = 0.1, x_r(0) = 0.5 m": Start(-0.3, 0.5, 0.1),
    "x_l(0) = +0.3 as printed, inside the object": LITERAL,
}
READ_P = (0.2, 0.5, 2.0, 5.0)  # s/m, of No. 4, for which the paper says "larger"
OFFSETS = tuple(sign * size for size in np.geomspace(1e-12, 1e-6, 32).tolist() for sign in (1.0, -1.0))  # m, added to
# x_l(0): far below what anybody could read from the paper
SEED = 1990
NEAREST, FARTHEST = 0.1, 0.5  # m, of random starts
SIDES = ("left", "right")
_KEYS = {
    "m": "arm.mass_kg", "k": "arm.stiffness_N_per_m", "c": "arm.damping_Ns_per_m",
    "Kp": "feedback.position_gain_N_per_m", "Kv": "feedback.velocity_gain_Ns_per_m",
    "p": "contact.dissipation_s_per_m", "H": "contact.hertz_N_per_m1_5",
}
KEYS: Mapping[str, tuple[str, ...]] = {  # letters of the paper to keys of a scene, both sides where there are two
    **{letter: (f"left_{key}", f"right_{key}") for letter, key in _KEYS.items()},
    **{f"{letter}_{side[0]}": (f"{side}_{key}",) for letter, key in _KEYS.items() for side in SIDES},
    "m_o": ("object.mass_kg",),
}
UNIT_OF: Mapping[str, str] = {
    "m": "kg", "k": "N/m", "c": "N s/m", "Kp": "N/m", "Kv": "N s/m", "p": "s/m", "H": "N/m^1.5",
}


TENFOLD, ABSENT, LARGER = "10 times", "no", "larger"


class Figure(NamedTuple):
    """One of the paper's figures."""

    number: int
    change: str  # in the paper's letters; empty: none
    caption: str  # words of the print
    letters: tuple[str, ...] = ()  # that they name
    how: str = ""  # these change
    used_by: tuple[str, ...] = ()  # statements that the paper draws from it beside Fig. 2, or says of it

    @property
    def case(self) -> int:
        """The number of its case."""
        return self.number - 1

    @property
    def title(self) -> str:
        """What it shows."""
        return f"Fig. {self.number}: No. {self.case}, {self.change or 'standard parameters'}"


FIGURES = (
    Figure(2, "", "Standard parameters"),
    Figure(3, "c = Kv = p = 0", "Marginally stable, perfect elastic collision", ("c", "Kv", "p"), ABSENT,
           ("P1", "T12")),
    Figure(4, "c = Kv = 0", "Marginally stable, collision with energy loss", ("c", "Kv"), ABSENT, ("P1",)),
    Figure(5, "p = 1 s/m", "Standard with larger energy loss in collision", ("p",), LARGER, ("P2",)),
    Figure(6, "m_l = m_r = 10 kg", "10 times the masses, both manip.", ("m_l", "m_r"), TENFOLD, ("P5",)),
    Figure(7, "m_l = 10 kg", "10 times the mass, left manip.", ("m_l",), TENFOLD, ("P8",)),
    Figure(8, "k_l = k_r = 100 N/m", "10 times the stiffness, both manip.", ("k",), TENFOLD, ("P6",)),
    Figure(9, "c_l = c_r = 2 N s/m", "10 times the damping coef., both manip.", ("c",), TENFOLD, ("P7",)),
    Figure(10, "Kp_l = Kp_r = 50 N/m", "10 times the position feedback gains", ("Kp",), TENFOLD, ("P10",)),
    Figure(11, "Kv_l = Kv_r = 5 N s/m", "10 times the velocity feedback gains", ("Kv",), TENFOLD, ("P11",)),
    Figure(12, "m_o = 50 kg", "10 times the mass, object", ("m_o",), TENFOLD, ("P12",)),
)


def load_cases() -> dict[int, Scene]:
    """The eleven scenes of the package."""
    return {number: scenes.load(f"case_{number:02d}") for number in NUMBERS}


def started(scene: Scene, start: Start) -> Scene:
    """A scene that begins at rest somewhere else."""
    return scene.changed(dict(zip(POSITIONS, start, strict=True)))


def with_values(scene: Scene, values: Mapping[str, float]) -> Scene:
    """A scene with other numbers, by the paper's letters."""
    return scene.changed({key: value for letter, value in values.items() for key in KEYS[letter]})


def value_of(scene: Scene, letter: str) -> float:
    """A number of a scene by the paper's letter; the left one where there are two."""
    section, key = KEYS[letter][0].split(".")
    return float(scene.values[section][key])


def random_starts(number: int) -> list[Start]:
    """Starts at rest, x_l in [-0.5, -0.1], x_o = 0, x_r in [0.1, 0.5] m."""
    draws = np.random.default_rng(SEED).uniform(NEAREST, FARTHEST, (number, 2)).tolist()
    return [Start(-x_l, x_r) for x_l, x_r in draws]


def start_of(scene: Scene) -> Start:
    """Where the arms of a scene begin."""
    state = scene.initial_state.tolist()
    return Start(state[0], state[4], state[2])


def moved(scene: Scene, offset: float) -> Scene:
    """A scene whose left arm begins a little farther to the right, by an offset in m."""
    return scene.changed({"left_arm.position_m": start_of(scene).x_l + offset}) if offset else scene


def text_of(scene: Scene, start: bool = True) -> str:
    """All numbers of a scene, to know it again by; or all but the positions that it begins from."""
    return repr(scene.values if start else {
        section: {key: number for key, number in numbers.items() if key != "position_m"}
        for section, numbers in scene.values.items()})


def even(scene: Scene) -> bool:
    """Whether both arms and both contacts are equal, so that the mirrored start is no other start."""
    system = scene.system
    rows = (system.closed_loop, system.bodies, system.pairs)
    return all(bool((row[LEFT] == row[RIGHT]).all()) for row in rows)


def read_starts(*several: Scene) -> dict[str, Start]:
    """Other starts that the source may mean, for scenes that are compared."""
    plain = all(even(scene) for scene in several)
    return {text: start for text, start in READ_STARTS.items() if not (plain and start == MIRRORED)}
