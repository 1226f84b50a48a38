"""Equations (1) to (37): as we read them, with what the scan leaves open, and what is compared with what is allowed.

They are written as one types them: two primes are two dots, `u_l^(5/2)` is a power, text stands in quotes, and the rows
of a matrix end with semicolons. The page has them as MathML.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from markupsafe import Markup, escape

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


NONE = "d/dt V = -2 (c_l + Kv_l) x_l'^2 - 2 (c_r + Kv_r) x_r'^2"
LEVEL = "V = (k_l + Kp_l) x_l^2 + m_l x_l'^2 + m_o x_o'^2 + (k_r + Kp_r) x_r^2 + m_r x_r'^2"
TOKEN = re.compile(r"""\s*(?:"(?P<text>[^"]*)"|\^\((?P<power>[^)]*)\)|\^(?P<digit>\d)|(?P<number>\d+)
    |(?P<name>[A-Za-z]+)(?:_(?P<sub>\w))?(?P<dots>'{0,2})|(?P<sign>>=|<=|!=|.))""", re.VERBOSE)
SIGNS = {">=": "\u2265", "<=": "\u2264", "!=": "\u2260", "-": "\u2212"}
NAMES = {"Delta": "\u0394", "epsilon": "\u03b5"}


class Printed(NamedTuple):
    """One equation: its number, our reading, and what the source leaves open."""

    number: str
    text: str
    open: str = ""

    @property
    def mathml(self) -> Markup:
        """As the page shows it."""
        return Markup("<math display=\"block\">{}</math>").format(_row(self.text))


PRINTED = (
    Printed("(1)", "m_l x_l'' = -k_l x_l - c_l x_l' + f_l - fw_l"),
    Printed("(2)", "m_r x_r'' = -k_r x_r - c_r x_r' + f_r + fw_r"),
    Printed("(3)", "m_o x_o'' = fw_l - fw_r"),
    Printed("(4)", "f_l = -Kp_l x_l - Kv_l x_l'"),
    Printed("(5)", "f_r = -Kp_r x_r - Kv_r x_r'"),
    Printed("(6)", "fw_l = (1 + p_l u_l') H_l u_l^(3/2) \" if \" u_l >= 0 \" and \" u_l' >= -1/p_l, \" else \" 0",
            "The scan loses the power's 3."),
    Printed("(7)", "fw_r = (1 + p_r u_r') H_r u_r^(3/2) \" if \" u_r >= 0 \" and \" u_r' >= -1/p_r, \" else \" 0"),
    Printed("(8)", "u_l = x_l - x_o, u_r = x_o - x_r"),
    Printed("(9)", "p_l, p_r >= 0, H_l, H_r >= 0"),
    Printed("(10)", "\"contact: \" u_i >= 0 \" and \" u_i' >= -1/p_i \" (i = l, r); noncontact: others\"",
            "With p = 0 the second condition always holds."),
    Printed("(11)", "V = x^T P x", "P depends on x, so that V is no quadratic form."),
    Printed("(12)", "P = [k_l + Kp_l + Delta k_l, 0, -Delta k_l, 0, 0, 0; 0, m_l, 0, 0, 0, 0;"
            " -Delta k_l, 0, Delta k_l + Delta k_r, 0, -Delta k_r, 0; 0, 0, 0, m_o, 0, 0;"
            " 0, 0, -Delta k_r, 0, k_r + Kp_r + Delta k_r, 0; 0, 0, 0, 0, 0, m_r]",
            "The scan scatters the entries; the order follows from (13), and with it (16) from (11)."),
    Printed("(13)", "x = (x_l, x_l', x_o, x_o', x_r, x_r')^T"),
    Printed("(14)", "Delta k_l = a H_l u_l^(1/2) \" in contact, else \" 0"),
    Printed("(15)", "Delta k_r = b H_r u_r^(1/2) \" in contact, else \" 0"),
    Printed("(16)", LEVEL + " + a H_l u_l^(5/2) + b H_r u_r^(5/2)"),
    Printed("(17)", "x = 0 \": \" V = 0, x != 0 \": \" V > 0"),
    Printed("(18)", NONE + " - 2 p_l H_l u_l^(3/2) u_l'^2 - (2 - 5/2 a) H_l u_l^(3/2) u_l'"
            " - 2 p_r H_r u_r^(3/2) u_r'^2 - (2 - 5/2 b) H_r u_r^(3/2) u_r'",
            "The factor 5/2 of a and b is lost; differentiating (16) gives it."),
    Printed("(19)", "a = 4/5, b = 4/5"),
    Printed("(20)", "d/dt V <= 0"),
    Printed("(21)", LEVEL + " + a H_l u_l^(5/2)"),
    Printed("(22)", "x = 0 \": \" V = 0, x != 0 \": \" V > 0"),
    Printed("(23)", NONE + " - 2 p_l H_l u_l^(3/2) u_l'^2 - (2 - 5/2 a) H_l u_l^(3/2) u_l'"),
    Printed("(24)", "a = 4/5"),
    Printed("(25)", "d/dt V <= 0"),
    Printed("(26)", "k_r + Kp_r > 0, b > 0 \": \" x != 0, V > 0", "Printed with the conditions of (22) on the right."),
    Printed("(27)", "d/dt V <= 0"),
    Printed("(28)", LEVEL),
    Printed("(29)", "V_l = (k_l + Kp_l) x_l^2 + m_l x_l'^2, V_o = m_o x_o'^2, V_r = (k_r + Kp_r) x_r^2 + m_r x_r'^2"),
    Printed("(30)", "x_l = x_l' = 0 \": \" V_l = 0 \", others: \" V_l > 0"),
    Printed("(31)", "d/dt V_l = -2 (c_l + Kv_l) x_l'^2"),
    Printed("(32)", "d/dt V_r = -2 (c_r + Kv_r) x_r'^2", "Said to follow as on the left; not printed."),
    Printed("(33)", "x_o' = 0 \": \" V_o = 0, x_o' != 0 \": \" V_o > 0", "The scan loses the dots."),
    Printed("(34)", "d/dt V_o = 0"),
    Printed("(35)", "u_l < epsilon_l"),
    Printed("(36)", "u_r < epsilon_r"),
    Printed("(37)", "x_l - epsilon_l < x_o < x_r + epsilon_r"),
)


def _row(text: str) -> Markup:
    """A line, or a line that ends with a matrix."""
    before, bracket, rows = text.partition("[")
    found = Markup("").join(_symbols(before))
    if bracket:
        cells = [[_row(cell) for cell in row.split(",")] for row in rows.rstrip("]").split(";")]
        body = Markup("").join(
            Markup("<mtr>{}</mtr>").format(Markup("").join(Markup("<mtd>{}</mtd>").format(cell) for cell in row))
            for row in cells)
        found += Markup("<mo>(</mo><mtable>{}</mtable><mo>)</mo>").format(body)
    return Markup("<mrow>{}</mrow>").format(found)


def _symbols(text: str) -> list[Markup]:
    found: list[Markup] = []
    for token in TOKEN.finditer(text):
        power = token["power"] or token["digit"]
        if power:
            found.append(Markup("<msup>{}{}</msup>").format(found.pop(), Markup("").join(_symbols(power)) if len(
                power) == 1 else _row(power)))
        elif token["text"] is not None:
            found.append(Markup("<mtext>{}</mtext>").format(token["text"].replace(" ", "\u00a0")))
        elif token["name"]:
            found.append(_name(token["name"], token["sub"], len(token["dots"])))
        else:
            kind = "mn" if token["number"] else "mo"
            sign = token["number"] or token["sign"]
            found.append(Markup(f"<{kind}>{{}}</{kind}>").format(SIGNS.get(sign, escape(sign))))
    return found


def _name(name: str, sub: str | None, dots: int) -> Markup:
    """A letter with its dots and its index."""
    letter = Markup("<mi>{}</mi>").format(NAMES.get(name, name))
    if dots:
        letter = Markup("<mover>{}<mo>{}</mo></mover>").format(letter, "\u02d9" * dots)
    return Markup("<msub>{}<mi>{}</mi></msub>").format(letter, sub) if sub else letter
