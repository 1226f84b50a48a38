"""A Taylor step as the state alone tells it: its unit, near the inverse of the fastest rate, and how many terms it has.

Source of the order: A. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order
Taylor methods, Experimental Mathematics 14 (2005), section 3.1.
"""

from __future__ import annotations

import math

from grasp_ros.exact.automaton.edge import other_push
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.impact import stored_energy
from grasp_ros.exact.kinematics import approach, other, reduced_mass, relative_motion
from grasp_ros.exact.numerics.powers_of_two import near_inverse, power_of_two_root
from grasp_ros.exact.records import Array, Integers, Order, Plant, Settings, State, Step
from grasp_ros.exact.tolerances import DECAYS
from grasp_ros.physics.impact_law import STORED, STORED_ROOT
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Law, Of, Pair, U

RADIUS = 0.5  # of convergence of the series of a step, in its units: the least that is usual
LEAST = 12  # order of a Taylor step


def series_order(tolerance: float) -> int:
    """Order that costs least for a tolerance, with one pair in contact; even, see `polynomial.values`.

    Jorba and Zou derive -ln(tolerance) / 2 + 1 from a work that grows with the square of the order. Here the work
    per order is nearly constant, because a product is one short loop over vectors: the measured optimum is higher.
    """
    return 2 * math.ceil(-0.4 * math.log(tolerance) + 2.0)


def higher_order(order: int) -> int:
    """Order of steps with both pairs in contact: one and a half times that with one pair; even.

    These steps cost more outside their series, and bodies that swing against each other take nothing else: with the
    lower order a quarter more of them, in the same time.
    """
    return 2 * ((3 * order + 2) // 4)


@inlined
def lower_order(order: int) -> int:
    """`higher_order` read backwards."""
    return 2 * (order // 3)


@kernel
def new_order(tolerance: float, number: int, early: int) -> Order:
    """The order of this number, see `records.Order`."""
    return Order(number, math.exp(math.log(tolerance) / (number + 1)), early)


@inlined
def order_for(tolerance: float, highest: Order, reach: float) -> Order:
    """Even order that suffices for a step to a reach in units, at most the highest."""
    part = reach / RADIUS
    if not part < highest.first:
        return highest
    number = max(2 * math.ceil(0.5 * (math.log(tolerance) / math.log(part) - 1.0)), LEAST)
    return new_order(tolerance, number, min(number, highest.early)) if number < highest.number else highest


@kernel
def new_settings(tolerance: float, highest: int, given: Array) -> Settings:
    """Settings of a run; the workspace holds series up to the order `highest`, that of steps with both pairs.

    Their terms must be small at 2/3 of the order with one pair already, see `taylor_step.step_size`.
    """
    one, rate = lower_order(highest), 0.0
    for i in range(3):
        body = given[i]
        rate = max(rate, abs(body[Of.DAMPING]) / body[Of.MASS], math.sqrt(body[Of.STIFFNESS] / body[Of.MASS]))
    both = new_order(tolerance, highest, max(lower_order(one), LEAST))
    return Settings(tolerance, new_order(tolerance, one, one), both, power_of_two_root(rate, 1))


@inlined
def impact_scales(hertzian: float, mu: float, u: float, d: float) -> tuple[float, float]:
    """Scales of sqrt(u) and u' of an impact: the largest of a free impact of this energy (docs/oracles.md, O1)."""
    energy = 0.5 * mu * d * d + stored_energy(hertzian, u)
    return power_of_two_root(STORED * energy / hertzian, STORED_ROOT), power_of_two_root(2.0 * energy / mu, 2)


@inlined
def turning_rate(plant: Plant, state: State, side: Body) -> tuple[float, float]:
    """Scale of w of a pair in contact, and the rate at which w turns in its own regularised time, dt = 2 w ds.

    In an impact the rate is v / w; under a constant acceleration a, the other pair's push included, sqrt(2 a); under
    dissipation 2 p H w^4 / mu.
    """
    hertzian, mu, u = plant.pairs[side, Law.HERTZIAN], reduced_mass(plant.bodies, side), state.y[U.L + side]
    d, a = relative_motion(plant, state.y, side)
    w, v = impact_scales(hertzian, mu, u, d)
    a = abs(a)
    opposite = other(side)
    if state.mode[opposite] == Pair.CONTACT:
        a += abs(other_push(plant, state, side)[0])
    rate = max(v * near_inverse(w) if w > 0.0 else 0.0, math.sqrt(2.0 * a))
    stiff = plant.pairs[side, Law.DISSIPATION] * hertzian / mu
    return w, max(rate, 2.0 * stiff * (u * u))


@inlined
def reach_of_span(state: State, left: bool, right: bool, unit: float, span: float) -> float:
    """Estimate of s / unit after a span, in seconds, of contact: dt = 2 G ds, with G and G' at the start."""
    y, g, bend = state.y, 1.0, 0.0
    if left:
        g, bend = math.sqrt(y[U.L]), approach(y, LEFT)
    if right:
        w = math.sqrt(y[U.R])
        bend = w * w * bend + g * g * approach(y, RIGHT) if left else approach(y, RIGHT)
        g *= w
    pace = unit * (g + math.sqrt(max(g * g + bend * span, 0.0)))
    return span / pace if pace > 0.0 else math.inf


@inlined
def outlasts(y: Array, w_l: float, w_r: float, unit: float, span: float, reach: float) -> bool:
    """Whether a span outlasts `reach` in s / unit for certain: as in `reach_of_span`, with scales that bound G, G'.

    It is more than a short cut: in the regression scene swing_far_below_the_fastest the estimate would be too short.
    """
    bend = w_r * w_r * abs(approach(y, LEFT)) + w_l * w_l * abs(approach(y, RIGHT))
    return span >= (2.0 * w_l * w_r + reach * unit * bend) * reach * unit


@inlined
def within_decay(plant: Plant, mode: Integers, span: float) -> float:
    """A span in seconds, or the part of it after which a damper would leave too few digits of a velocity's series.

    A free arm has a closed form.
    """
    for body in (LEFT, OBJECT, RIGHT):
        damping, mass = plant.bodies[body, Of.DAMPING], plant.bodies[body, Of.MASS]
        if damping * span > DECAYS * mass and (body == OBJECT or mode[body] == Pair.CONTACT):
            span = DECAYS * mass / damping
    return span


@inlined
def new_step(plant: Plant, state: State, settings: Settings, span: float) -> Step:
    """A step from here, in a unit of s in which its coefficients neither grow nor shrink by many decades.

    With both pairs in contact dt = 2 w_l w_r ds: each w turns at its rate times the other w. A step that is cut by the
    span needs a lower order.
    """
    left, right = state.mode[LEFT] == Pair.CONTACT, state.mode[RIGHT] == Pair.CONTACT
    w_l, rate_l, w_r, rate_r = 1.0, 0.0, 1.0, 0.0
    if left:
        w_l, rate_l = turning_rate(plant, state, LEFT)
    if right:
        w_r, rate_r = turning_rate(plant, state, RIGHT)
    highest = settings.both if left and right else settings.one
    fastest = max(rate_l * w_r, rate_r * w_l, 2.0 * w_l * w_r * settings.rate)
    unit = near_inverse(fastest) if fastest > 0.0 else 1.0
    if outlasts(state.y, w_l, w_r, unit, span, RADIUS * highest.first):
        return Step(highest, unit, left, right)
    order = order_for(settings.tolerance, highest, reach_of_span(state, left, right, unit, span))
    return Step(order, unit, left, right)
