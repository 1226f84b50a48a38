"""Bounds that prove that a stuck object does not slip in a Taylor step, or that a sliding one does not stop."""

from __future__ import annotations

import numpy as np
import pytest

from grasp_ros.exact.automaton.friction import apply_friction, lift_friction, slide_in_contact, stays_stuck
from grasp_ros.exact.contact.step_unit import higher_order, new_settings
from grasp_ros.exact.contact.taylor_step import take_step
from grasp_ros.exact.driver.workspace import new_workspace
from grasp_ros.exact.numerics.polynomial import curvatures, values
from grasp_ros.exact.records import Array, Plant, State, Tables
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Of, Pair, Slide, V, Work, Z
from grasp_ros.physics.model import Contact, impact_force

TOLERANCE, ORDER, DRAWS, PLACES = 1e-16, 34, 400, 100


def held(random: np.random.Generator) -> tuple[Plant, State]:
    """An object that sticks between two arms, of which one or both press."""
    given = np.zeros((3, 4))
    given[:, Of.MASS], given[:, Of.STIFFNESS] = random.uniform(0.2, 5.0, 3), random.uniform(0.0, 50.0, 3)
    given[:, Of.DAMPING], given[:, Of.FORCE] = random.uniform(0.0, 2.0, 3), random.normal(0.0, 2.0, 3)
    given[OBJECT, Of.STIFFNESS] = 0.0
    pairs = np.column_stack([10.0 ** random.uniform(3.0, 6.0, 2), random.uniform(0.0, 2.0, 2)])
    u = 10.0 ** random.uniform(-6.0, -2.0, 2) * random.choice([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0]])
    rate = np.where(u > 0.0, random.uniform(-0.4, 0.4, 2), 0.0)
    y = np.array([u[LEFT], rate[LEFT], 0.0, 0.0, -u[RIGHT], -rate[RIGHT], *u])
    modes = np.array([*np.where(u > 0.0, Pair.CONTACT, Pair.OPEN), Slide.STUCK])
    plant = Plant(given, given.copy(), pairs, 0.0, given[:, Of.FORCE].copy())
    apply_friction(plant, modes)
    return plant, State(y, modes, np.zeros(6), np.zeros(3), np.zeros(3))


def largest_push(tables: Tables, plant: Plant, state: State, n: int, h: float) -> float:
    """The largest force on the object beside its friction at many places of a step, N, by the impact law."""
    found = 0.0
    for s in np.linspace(0.0, h, PLACES):
        values(tables.c, n, s, tables.at)
        push = plant.given[OBJECT, Of.FORCE]
        for side, v, sign in ((LEFT, V.L, 1.0), (RIGHT, V.R, -1.0)):
            if state.mode[side] == Pair.CONTACT:
                depth = np.square(max(tables.at[Z.L + side], 0.0))
                push += sign * impact_force(Contact(*plant.pairs[side]), depth, sign * tables.at[v])
        found = max(found, abs(push))
    return found


@pytest.mark.parametrize("part", [1.0, 1e-2])
def test_an_object_is_held_by_bounds_where_no_impact_overcomes_the_friction(part: float) -> None:
    random, proved, work = np.random.default_rng(5), 0, np.zeros(len(Work), dtype=np.int64)
    for _ in range(DRAWS):
        plant, state = held(random)
        settings = new_settings(TOLERANCE, higher_order(ORDER), plant.given)
        tables = new_workspace(ORDER).tables
        segment = take_step(tables, plant, state, settings, np.inf, work)
        n, h = segment.step.order.number, part * segment.s
        push = largest_push(tables, plant, state, n, h)

        def holds(coulomb: float, n: int = n, h: float = h, tables: Tables = tables, plant: Plant = plant,
                  mode: Array = state.mode) -> bool:
            values(tables.c, n, h, tables.at)
            curvatures(tables.c, n, h, tables.size)
            return stays_stuck(tables, plant._replace(coulomb=coulomb), mode, h)

        assert not holds(push * (1.0 - 1e-9))
        assert holds(100.0 * push + 1e3)
        proved += holds(1.3 * push)
    assert proved > DRAWS * (0.9 if part < 1.0 else 0.1)


@pytest.mark.parametrize("slide", [Slide.RIGHTWARD, Slide.LEFTWARD])
def test_an_object_that_moves_against_the_mode_of_its_friction_stops_at_once(slide: Slide) -> None:
    random, turned, work = np.random.default_rng(5), 0, np.zeros(len(Work), dtype=np.int64)
    sign = 1.0 if slide == Slide.RIGHTWARD else -1.0
    for _ in range(DRAWS):
        plant, state = held(random)
        state.mode[OBJECT], state.y[V.O] = slide, -1e-17 * sign  # a rounding: it has stopped a little too late
        lift_friction(plant)
        apply_friction(plant, state.mode)
        tables = new_workspace(ORDER).tables
        settings = new_settings(TOLERANCE, higher_order(ORDER), plant.given)
        segment = take_step(tables, plant, state, settings, np.inf, work)
        if sign * tables.c[LANES + V.O] < 0.0:
            stop = slide_in_contact(tables, plant, state, segment.step.order.number, segment.s, work)
            assert stop.when < 1e-15 * segment.s
            turned += 1
    assert turned > 0.2 * DRAWS
