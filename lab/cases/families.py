"""The families of the hard cases: why their cases are hard, and what decides whether a result is right.

The order is that of the page. docs/oracles.md defines O1 to O15.
"""

from __future__ import annotations

from typing import NamedTuple

REFERENCE = "reference with 25 digits, all states, each relative to its largest value"
MOMENTUM, ENERGY = 1e-13, 2e-12  # what the balances may be off, relative


class Family(NamedTuple):
    """Cases that are hard for the same reason and decided in the same way; a case notes where it differs."""

    name: str
    why: str
    oracle: str


IMPACT = Family(
    "impact", "u^(3/2) is only once differentiable; an impact lasts from 1e-5 s to 1e2 s; one body may be a million"
    " times as heavy as the other.", "O1, O2: exit speed and duration of a free impact, relative",
)
CHAIN = Family(
    "chain", "Three bodies in a row: impacts one after the other, or both pairs at u = 0 with the second one at rest.",
    "O10 with gaps, O11 without: the speeds after the last impact, m/s",
)
CREEP = Family(
    "creep", "The pair opens so close to the clamp surface u' = -1/p that rounding cannot distinguish the two.",
    "O2: duration and exit speed, relative; promised are 4 roundings of the speeds, whose difference is 1/p",
)
TOUCH = Family(
    "touch", "Both sides touch at once, or nearly so, or one side touches while the other is in contact: a solver"
    " without a rule for it loses a touch or counts it twice.", REFERENCE,
)
GRAZE = Family(
    "graze", "The gap passes 0 between two steps and comes back: its sign at the ends of a step tells nothing.",
    "reference with 25 digits: speed of the object, relative; promised is the overshoot to 5e-15 m",
)
CLAMP = Family(
    "clamp", "The clamp surface u' = -1/p is crossed in both directions while u > 0, where nothing else"
    " changes sign.", REFERENCE,
)
START = Family(
    "start", "The mode at t = 0 must follow from the state alone, also exactly where modes change.", REFERENCE
)
EXTREME = Family(
    "extreme", "Time scales that differ by many decades; some of these scenes amplify errors.", REFERENCE
)
REST = Family(
    "rest", "Bodies touch at rest, u = u' = 0: only the forces, or a higher derivative, tell whether they press.",
    "momentum f t and energy f x of the push, relative",
)
FLIGHT = Family(
    "flight", "Limits in which a closed form divides by the difference of its roots, is 0/0, or loses its digits.",
    "matrix exponential with 70 digits: position and velocity, relative to the swing at that time",
)
WAIT = Family(
    "wait", "A touch that comes after 1e6 s, or never, while the gap tends to 0.",
    "O4: nothing touches, so nothing moves, m and m/s",
)
HORIZON = Family(
    "horizon", "Up to 50 000 impacts: the motion is unpredictable after 50 s, its energy and its period are not, and"
    " errors must not add up.", "O3: V_c, which is constant, relative",
)
TAIL = Family(
    "tail", "Bounces get smaller for ever: no stall, no end, amplitudes below 1e-30 m.",
    "O9: V_c against its law, relative",
)
BALANCE = Family(
    "balance", "An error that no single state shows.",
    f"O3: momentum in units of {MOMENTUM:g}, energy in units of {ENERGY:g}, both relative",
)
LOOP = Family(
    "loop", "Held commands do work, near the stability limit of the loop and beyond it; the energy balance must close"
    " in every period.", "(B) of [the certificate](certificate.md): largest residual of the energy balance, in units"
    " of what rounding may add",
)
GROWTH = Family(
    "growth", "A loop must decay or grow at its true rate, also where it is unstable.",
    "spectral radius of the sampled loop: growth per period, relative",
)
LIMIT = Family("limit", "A run must neither go on for ever nor return infinities.", "the status of the run")
RELATION = Family(
    "relation", "Two scenes whose results must be related, whatever they are.", "equality, bit for bit"
)
ORDER = (
    IMPACT, CHAIN, CREEP, TOUCH, GRAZE, CLAMP, START, EXTREME, REST, FLIGHT, WAIT, HORIZON, TAIL, BALANCE,
    LOOP, GROWTH, LIMIT, RELATION,
)
