"""What a pair of arm and object does: its mode from its state, the scales of its impact, and its switches."""

import math
from typing import Any

from grasp_ros.exact.flight import EPS, PROBE, parting
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    FORCE,
    HERTZIAN,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    U_L,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Pair,
    Transition,
)

OPEN, CONTACT, CLAMPED, LEAVING, HELD, ABSENT = (int(p) for p in Pair)
TOUCH, RELEASE, CLAMP, REENTRY, STICK, SLIP = (int(e) for e in Transition)
GRID, EVENTS = 0, 1  # entries of `filled`, the rows in use of the outputs and of the events
SPARE = 8  # events that one segment can have: three per pair, and two of the object
UNKNOWN = -1  # mode of a pair before the first call
TOGETHER = 1.0 + 4.0 * EPS  # events closer than this fire together


@inlined
def relative_motion(bodies: Any, y: Any, side: int) -> Any:
    """u' and the u'' that both bodies would have without impact forces."""
    x, v = (y[X_L], y[V_L]) if side == LEFT else (y[X_R], y[V_R])
    sign = 1.0 if side == LEFT else -1.0
    arm, body = bodies[side], bodies[OBJECT]
    a = (arm[FORCE] - arm[STIFFNESS] * x - arm[DAMPING] * v) / arm[MASS]
    a_o = (body[FORCE] - body[STIFFNESS] * y[X_O] - body[DAMPING] * y[V_O]) / body[MASS]
    return sign * (v - y[V_O]), sign * (a - a_o)


@kernel
def judge(bodies: Any, pairs: Any, y: Any, side: int, pace: float, other_in_contact: bool) -> int:
    """Mode of a pair from its state alone: condition (10), and at u = 0 the direction of the motion.

    At rest there the first derivative that differs decides. Gravity, for one, pulls both bodies alike.
    """
    if pairs[side, HERTZIAN] == 0.0:
        return ABSENT
    u = y[U_L + side]
    d, _ = relative_motion(bodies, y, side)
    if u < 0.0:
        return OPEN
    if u > 0.0:
        return CONTACT if 1.0 + pairs[side, DISSIPATION] * d >= 0.0 else CLAMPED
    if d == 0.0:
        lean = leaning(bodies, y, side, pace)
        return HELD if lean > 0.0 or (lean == 0.0 and other_in_contact) else OPEN
    return CONTACT if d > 0.0 else OPEN


@kernel
def leaning(bodies: Any, y: Any, side: int, pace: float) -> float:
    """u of a pair at rest at u = 0 a little later, in any unit: its sign tells whether it is pressed together."""
    x, v, sign = (y[X_L], y[V_L], 1.0) if side == LEFT else (y[X_R], y[V_R], -1.0)
    return sign * parting(bodies[side], x, v, bodies[OBJECT], y[X_O], y[V_O], PROBE / pace if pace > 0.0 else 1.0)


@kernel
def classify(bodies: Any, pairs: Any, y: Any, mode: Any, pace: float) -> None:
    """Modes of both pairs for a run that starts at y."""
    mode[LEFT] = judge(bodies, pairs, y, LEFT, pace, False)
    mode[RIGHT] = judge(bodies, pairs, y, RIGHT, pace, mode[LEFT] == CONTACT)
    if mode[LEFT] == OPEN and mode[RIGHT] == CONTACT:
        mode[LEFT] = judge(bodies, pairs, y, LEFT, pace, True)


@kernel
def press(bodies: Any, pairs: Any, y: Any, mode: Any, side: int, pace: float, now: float, events: Any,
          filled: Any) -> None:
    """A pair that rests at u = 0 touches if what acts now presses it together."""
    if mode[side] == OPEN and y[U_L + side] == 0.0 and relative_motion(bodies, y, side)[0] == 0.0:
        mode[side] = judge(bodies, pairs, y, side, pace, mode[1 - side] == CONTACT)
        if mode[side] != OPEN:
            record(now, side, TOUCH, 0.0, 0.0, events, filled)


@kernel
def root_of_two(x: float, degree: int) -> float:
    """The power of two above the root of x >= 0; comparing exponents is cheaper than taking the root."""
    return math.ldexp(1.0, (math.frexp(x)[1] - 1) // degree + 1) if x > 0.0 else 0.0


@inlined
def impact_scales(hertzian: float, mu: float, u: float, d: float, a: float) -> Any:
    """Scales of sqrt(u) and u' of an impact: those at which a free impact has the same energy (O1 read backwards).

    The energy is that of the present motion and penetration, and of the motion that an acceleration a > 0 from
    outside will bring: it presses the pair to the depth (mu a / H)^(2/3).
    """
    energy = 0.5 * mu * d * d + 0.4 * hertzian * u * u * math.sqrt(u)
    if a > 0.0:
        energy += mu * a * (mu * a / hertzian) ** (2.0 / 3.0)
    return root_of_two(2.5 * energy / hertzian, 5), root_of_two(2.0 * energy / mu, 2)


@inlined
def scales(bodies: Any, pairs: Any, y: Any, mode: Any, side: int, pace: float) -> Any:
    """Scales of w and u' of one pair's impact; the other pair's impact may push it.

    An impact that would last longer than the bodies take to turn by themselves gets no deeper than they let it.
    """
    d, a = relative_motion(bodies, y, side)
    other = 1 - side
    if mode[other] in (CONTACT, HELD):
        w, v = impact_scales(pairs[other, HERTZIAN], reduced_mass(bodies, other), y[U_L + other],
                             relative_motion(bodies, y, other)[0], 0.0)
        if w > 0.0:
            a = max(a, 0.0) + v * v / (w * w) * (reduced_mass(bodies, other) / bodies[OBJECT, MASS])
    w, v = impact_scales(pairs[side, HERTZIAN], reduced_mass(bodies, side), y[U_L + side], d, a)
    if pace > 0.0:
        reach = root_of_two(4.0 * (y[U_L + side] + (abs(d) + max(a, 0.0) / pace) / pace), 2)
        w = min(w, reach) if w > 0.0 else reach  # 0 where the energy of a motion that died out underflows
    return w, max(v, root_of_two(abs(d), 1))


@kernel
def reduced_mass(bodies: Any, side: int) -> float:
    """mu of one pair."""
    m, m_o = bodies[side, MASS], bodies[OBJECT, MASS]
    return m / (1.0 + m / m_o)  # m_o is infinite if the object sticks


@kernel
def fastest_rate(bodies: Any) -> float:
    """Power of two above the rates, in 1/s, at which the bodies move by themselves."""
    rate = 0.0
    for i in range(3):
        body = bodies[i]
        rate = max(rate, body[DAMPING] / body[MASS], math.sqrt(body[STIFFNESS] / body[MASS]))
    return root_of_two(rate, 1)


@kernel
def sliver(tolerance: float) -> float:
    """Part of an impact's depth whose impulse, of relative size sliver^2.5, is below the tolerance."""
    return 0.3 * tolerance**0.4


@kernel
def hold_time(bodies: Any, pairs: Any, y: Any, mode: Any, side: int, pace: float, tolerance: float) -> float:
    """How long a pair that starts at u = 0 may stay without force: a sliver of its impact.

    At most half a time constant of the bodies, for `flight.displacement`; then it is held again.

    The impulse lost relative to the impact's is of order (time)^2.5 if the pair approaches, and (time)^4 if it
    starts at rest and is pushed together.
    """
    d, _ = relative_motion(bodies, y, side)
    w, v = scales(bodies, pairs, y, mode, side, pace)
    if w == 0.0 or v == 0.0:  # only a higher derivative presses it together
        return PROBE / pace if pace > 0.0 else 0.0
    return min((sliver(tolerance) if d > 0.0 else 0.3 * tolerance**0.25) * w * w / v, 0.5 / pace)


@kernel
def resume(bodies: Any, pairs: Any, y: Any, mode: Any, side: int, pace: float, tolerance: float, now: float,
           events: Any, filled: Any) -> None:
    """End the hold of a pair, unless it is still so shallow that its force is below rounding."""
    w, _ = scales(bodies, pairs, y, mode, side, pace)
    d, _ = relative_motion(bodies, y, side)
    u = y[U_L + side]
    if d <= 0.0 or u < 0.0 or u > 1e-3 * sliver(tolerance) * w * w:
        mode[side] = judge(bodies, pairs, y, side, pace, mode[1 - side] == CONTACT)
        if mode[side] == OPEN:
            record(now, side, RELEASE, y[U_L + side], d, events, filled)


@inlined
def settle(bodies: Any, pairs: Any, y: Any, mode: Any, pace: float, tolerance: float, now: float, events: Any,
           filled: Any) -> None:
    """Take both pairs off the corner w_l = w_r = 0, where the product w_l w_r stops the regularised time.

    At a simultaneous touch both are held for a sliver; at a simultaneous release both leave a sliver early. A pair
    that rests at u = 0 is held when the other one begins to push.
    """
    for side in (LEFT, RIGHT):
        if mode[1 - side] == CONTACT:
            press(bodies, pairs, y, mode, side, pace, now, events, filled)
    if mode[LEFT] != CONTACT or mode[RIGHT] != CONTACT:
        return
    shallow = sliver(tolerance)
    approaching = 0
    leaving = 0
    for side in (LEFT, RIGHT):
        d, a = relative_motion(bodies, y, side)
        w, _ = scales(bodies, pairs, y, mode, side, pace)
        u = y[U_L + side]
        if d >= 0.0 and u < 0.3 * shallow * w * w:
            approaching += 1
        elif d < 0.0 and u < shallow * w * w and 20.0 * u * abs(a) < d * d:
            leaving += 1
    if approaching == 2:
        mode[LEFT] = mode[RIGHT] = HELD
    elif leaving == 2:
        mode[LEFT] = mode[RIGHT] = LEAVING


@kernel
def fire(y: Any, mode: Any, side: int, kind: int, now: float, events: Any, filled: Any) -> None:
    """Switch one pair and record the event.

    A touch that rounding invents at the turning point of a grazing approach has u' <= 0 and is no event.
    """
    d = y[V_L] - y[V_O] if side == LEFT else y[V_O] - y[V_R]
    if kind in (TOUCH, RELEASE):
        y[U_L + side] = 0.0
    if kind == TOUCH and d <= 0.0:
        mode[side] = OPEN
        return
    mode[side] = OPEN if kind == RELEASE else (CLAMPED if kind == CLAMP else CONTACT)
    record(now, side, kind, y[U_L + side], d, events, filled)


@kernel
def record(now: float, side: int, kind: int, u: float, d: float, events: Any, filled: Any) -> None:
    """Append a row to the events."""
    n = filled[EVENTS]
    filled[EVENTS] = n + 1
    events[n, 0], events[n, 1], events[n, 2], events[n, 3], events[n, 4] = now, side, kind, u, d


@kernel
def tick(clock: Any, step: float) -> None:
    """Add to the compensated clock (two-sum), so that long runs do not drift."""
    total = clock[0] + step
    back = total - clock[0]
    clock[1] += (clock[0] - (total - back)) + (step - back)
    clock[0] = total
