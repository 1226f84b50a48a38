"""Equations (1) to (37): what each says, the function that states it, and what is compared with what is allowed."""

from __future__ import annotations

import math
from typing import NamedTuple

ALGEBRA = "algebra"  # two ways to write the same function of a state: wrong code breaks the row, and no motion does
MOTION = "motion"
DRAWS = 4000  # random states at which positivity is looked at


class Equation(NamedTuple):
    """One row: equation, what it says, the function that states it, what was compared, and the number found."""

    number: str
    says: str
    function: str
    compared: str
    allowed: float  # the number must not exceed it; or, for a margin, not fall below 0
    by: str = MOTION  # what could break it: a motion, or ALGEBRA alone
    margin: bool = False
    found: float = math.nan

    @property
    def agrees(self) -> bool:
        """Whether the number is as it must be."""
        return self.found > 0.0 if self.margin else self.found <= self.allowed


_DIFFERENTIATED = "differentiated velocity against the printed right-hand side, relative"
_COMMAND = "command against -Kp x - Kv x', N"
_LAW = "impact force from the motion of the arm against the law, relative to the largest"
_SOFTER = "Delta k u^2 against the elastic part of V, relative"
_V, _PARTS, _RATE = "physics.energy.energy, V", "physics.lyapunov.parts", "physics.energy.energy, V_rate"
_BY_HAND = "V and the sum of its parts against the printed sum by hand, relative"
_POSITIVE = f"smallest V / x'x of {DRAWS} random states in m and m/s"
_LOSSES = "V differentiated, and V_rate, against the printed rate by hand, in the largest rate"
_PART = "differentiated against -2 C x'^2, in the largest V'"
_BOUND = "physics.lyapunov.largest_deformation, physics.lyapunov.reach"
_LARGEST = "smallest of (5 V_c(0) / 4H)^(2/5) over the largest deformation, less 1"
_FIT = _V, "a fitted to the motion, its distance from 4/5"
AT_EVENTS = "(10) at events"  # the second row of (10)
EQUATIONS = {row.number: row for row in (
    Equation("(1)", "motion of the left arm", "lab.reference.grasp.acceleration", _DIFFERENTIATED, 1e-8),
    Equation("(2)", "motion of the right arm", "lab.reference.grasp.acceleration", _DIFFERENTIATED, 1e-8),
    Equation("(3)", "motion of the object", "lab.reference.grasp.acceleration", _DIFFERENTIATED, 1e-8),
    Equation("(4)", "input of the left arm", "physics.system.System.feedback", _COMMAND, 1e-14, ALGEBRA),
    Equation("(5)", "input of the right arm", "physics.system.System.feedback", _COMMAND, 1e-14, ALGEBRA),
    Equation("(6)", "left impact force", "physics.model.impact_force", _LAW, 1e-7),
    Equation("(7)", "right impact force", "physics.model.impact_force", _LAW, 1e-7),
    Equation("(8)", "deformations and their rates", "physics.model.penetration", "u differentiated against u', m/s",
             1e-9),
    Equation("(9)", "p and H are not negative", "scene.effects.contact.PARAMETERS",
             "negative H, p that a scene accepts, of 2", 0.0, ALGEBRA),
    Equation("(10)", "contact and noncontact", "physics.model.in_contact",
             "places where the condition and the located events disagree", 0.0),
    Equation(AT_EVENTS, "touch and release at u = 0", "exact.automaton.modes.make_transition",
             "largest |u| at an event, m", 1e-15),
    Equation("(11)", "V = x' P(x) x", _V, "V against x' P x, with P by hand, relative", 1e-13, ALGEBRA),
    Equation("(12)", "P(x)", _PARTS, "the sum of V's parts against x' P x, with P by hand, relative", 1e-13, ALGEBRA),
    Equation("(13)", "order of the state", "physics.layout.X, V",
             "x_l, x_o, x_r differentiated against the columns behind them, relative", 1e-9),
    Equation("(14)", "Delta k of the left contact", _PARTS, _SOFTER, 1e-12, ALGEBRA),
    Equation("(15)", "Delta k of the right contact", _PARTS, _SOFTER, 1e-12, ALGEBRA),
    Equation("(16)", "V, both in contact", f"{_PARTS}; {_V}", _BY_HAND, 1e-14, ALGEBRA),
    Equation("(17)", "V > 0 for x != 0, both in contact", _V, _POSITIVE, 0.0, ALGEBRA, margin=True),
    Equation("(18)", "V', both in contact", _RATE, _LOSSES, 1e-7),
    Equation("(19)", "a = b = 4/5", *_FIT, 1e-8),
    Equation("(20)", "V' <= 0, both in contact", _RATE, "largest rate, W", 0.0),
    Equation("(21)", "V, left in contact", f"{_PARTS}; {_V}", _BY_HAND, 1e-14, ALGEBRA),
    Equation("(22)", "V > 0 for x != 0, left in contact", _V, _POSITIVE, 0.0, ALGEBRA, margin=True),
    Equation("(23)", "V', left in contact", _RATE, _LOSSES, 1e-7),
    Equation("(24)", "a = b = 4/5", *_FIT, 1e-8),
    Equation("(25)", "V' <= 0, left in contact", _RATE, "largest rate, W", 0.0),
    Equation("(26)", "V > 0 for x != 0, right in contact", _V, _POSITIVE, 0.0, ALGEBRA, margin=True),
    Equation("(27)", "V' <= 0, right in contact", _RATE, "largest rate, W", 0.0),
    Equation("(28)", "V, none in contact", _V, "V against V_l + V_o + V_r by hand, relative", 1e-14, ALGEBRA),
    Equation("(29)", "V_l, V_o, V_r", _PARTS, "each against its printed terms by hand, in V", 1e-15, ALGEBRA),
    Equation("(30)", "V_l > 0 but at rest in 0", _PARTS,
             f"smallest V_l / (x_l^2 + x_l'^2) of {DRAWS} states in m and m/s", 0.0, ALGEBRA, margin=True),
    Equation("(31)", "V_l'", _PARTS, _PART, 1e-8),
    Equation("(32)", "V_r', as on the left", _PARTS, _PART, 1e-8),
    Equation("(33)", "V_o > 0 but at rest anywhere", _PARTS, f"smallest V_o / x_o'^2 of {DRAWS} states in m/s", 0.0,
             ALGEBRA, margin=True),
    Equation("(34)", "V_o' = 0", _PARTS, "V_o differentiated, in the largest V'", 1e-8),
    Equation("(35)", "the left deformation is limited by eps_l", _BOUND, _LARGEST, 0.0, margin=True),
    Equation("(36)", "the right deformation is limited by eps_r", _BOUND, _LARGEST, 0.0, margin=True),
    Equation("(37)", "x_l - eps_l < x_o < x_r + eps_r", _BOUND, "smallest clearance, eps from V_c(0), m", 0.0,
             margin=True),
)}
