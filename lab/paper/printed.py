"""Equations (1) to (37) as we read them, with what the scan leaves open; as MathML for the page.

They are written as one types them: two primes are two dots, `u_l^(5/2)` is a power, text stands in quotes, and the rows
of a matrix end with semicolons.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from markupsafe import Markup, escape

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
