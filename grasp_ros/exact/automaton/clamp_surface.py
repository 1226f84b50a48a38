"""A pair at u' = -1/p, where its force ends: to which side it goes, and whether anything moves it."""

from __future__ import annotations

from grasp_ros.exact.automaton.resting_pair import HIGHEST, NEVER, NEXT, first_difference, impact_beside, own_difference
from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.kinematics import other, surface_factor
from grasp_ros.exact.records import Plant, State
from grasp_ros.exact.tolerances import SURFACE
from grasp_ros.physics.layout import Body, Pair


@kernel
def surface_side(plant: Plant, state: State, side: Body) -> float:
    """1 + p u', which is positive in contact; within its rounding, where no force acts, what moves u' first; or 0."""
    factor = surface_factor(plant.pairs, state.y, side, SURFACE)
    if factor != 0.0:
        return float(factor)
    push, pace = impact_beside(plant, state, side)
    highest = HIGHEST if push == 0.0 and pace == 0.0 else NEXT  # of an impact no more is known
    return float(first_difference(plant, state.y, side, push, pace, highest).value)


@kernel
def stays(plant: Plant, state: State, side: Body) -> bool:
    """Whether the bodies of a pair never move apart or together by themselves, but for its u'."""
    return bool(own_difference(plant, state.y, side).order == NEVER)


@kernel
def glides(plant: Plant, state: State, side: Body) -> bool:
    """Whether nothing moves a pair off u' = -1/p: neither its own motion nor the other pair, which will not push.

    That one is without force, or glides as well: in a symmetric grasp both are treated alike at one instant.
    """
    beside = other(side)
    if not stays(plant, state, side):
        return False
    if state.mode[beside] == Pair.CONTACT and surface_factor(plant.pairs, state.y, beside, SURFACE) != 0.0:
        return False
    return state.mode[beside] not in (Pair.CONTACT, Pair.CLAMPED) or stays(plant, state, beside)


@kernel
def has_glided(plant: Plant, state: State, side: Body, roundings: float) -> bool:
    """Whether a pair is at u' = -1/p but for some roundings, and nothing moves it off."""
    return surface_factor(plant.pairs, state.y, side, roundings) == 0.0 and bool(glides(plant, state, side))
