"""The code that states each equation of the paper, broken on purpose: its row no longer agrees."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import cache
from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.physics import lyapunov
from grasp_ros.physics.energy import Energy, energy, pairs_of
from grasp_ros.physics.layout import LEFT
from grasp_ros.physics.lyapunov import reach
from grasp_ros.physics.model import impact_force, in_contact, penetration
from grasp_ros.physics.system import System
from lab.paper import by_hand, equations, sample
from lab.paper.cases import load_cases
from lab.paper.equations import CROSSING, rows_of
from lab.paper.sample import Sample
from lab.reference.grasp import acceleration

OFF = 1.001


@cache
def _motions() -> list[Sample]:
    """Those that cross the clamp surface of (10) on one side and on both, and the standard case."""
    return [Sample(scene) for scene in (load_cases()[1], *map(scenes.load, CROSSING))]


def disagreeing() -> set[str]:
    """Numbers of the rows that do not agree; what a sample remembers is left behind."""
    return {row.number for row in rows_of([copy(each) for each in _motions()]) if not row.agrees}


def level(change: Callable[[Energy, Any, Any], Energy]) -> Callable[..., Energy]:
    return lambda system, state, *rest, **more: change(energy(system, state, *rest, **more), system, state)


def with_stored(found: Energy, system: Any, state: Any) -> Energy:
    """The elastic term with another a."""
    return found._replace(V=found.V + 0.01 * sum(lyapunov.parts(system, state)[3:]))


def without_tension_cut(contact: Any, u: Any, d: Any) -> Any:
    """(6), (7) in force whenever u >= 0."""
    u = np.maximum(u, 0.0)
    return contact.hertzian * u**1.5 * (1.0 + contact.dissipation * d)


def shifted(contact: Any, u: Any, d: Any) -> Any:
    """(10) with another surface: -50 m/s in place of -1/p."""
    return (np.asarray(u) >= 0.0) & (np.asarray(d) >= -50.0)


def accepts(scene: Any, values: Any) -> Any:
    return scene


def scaled(function: Callable[..., Any], factor: float = OFF) -> Callable[..., Any]:
    def other(*arguments: Any, **more: Any) -> Any:
        found = function(*arguments, **more)
        if isinstance(found, tuple):
            parts = tuple(factor * part for part in found)
            return type(found)(*parts) if hasattr(found, "_fields") else parts
        return factor * found
    return other


def stretched(parts: Any) -> Any:
    """V_l, V_o, V_r with a term that does not belong to them."""
    return lambda system, state: (found := parts(system, state))._replace(
        V_l=found.V_l + np.asarray(state)[..., 2], V_o=found.V_o + np.asarray(state)[..., 0],
        V_r=found.V_r + np.asarray(state)[..., 2])


BROKEN: list[tuple[set[str], Any, str, Any]] = [
    ({"(1)", "(2)", "(3)"}, equations, "acceleration", scaled(acceleration)),
    ({"(4)", "(5)", "(6)", "(7)"}, System, "feedback", scaled(System.feedback)),
    ({"(6)", "(7)"}, equations, "impact_force", scaled(impact_force)),
    ({"(6)", "(7)"}, equations, "impact_force", without_tension_cut),
    ({"(8)"}, equations, "penetration", scaled(penetration)),
    ({"(9)"}, equations, "with_values", accepts),
    ({"(10)"}, equations, "in_contact", lambda contact, u, d: np.asarray(u) >= 0.0),
    ({"(10)"}, equations, "in_contact", shifted),
    ({"(11)", "(12)", "(14)", "(15)"}, by_hand, "matrix", scaled(by_hand.matrix)),
    ({"(16)", "(21)"}, by_hand, "level", scaled(by_hand.level)),
    ({"(18)", "(23)"}, by_hand, "rate", scaled(by_hand.rate)),
    ({"(28)", "(29)"}, by_hand, "parts", scaled(by_hand.parts)),
    ({"(11)", "(16)", "(21)", "(28)"}, sample, "energy", level(lambda found, _, __: found._replace(V=OFF * found.V))),
    ({"(17)", "(22)", "(26)"}, equations, "energy", level(lambda found, _, __: found._replace(V=-found.V))),
    ({"(18)", "(23)"}, sample, "energy", level(lambda found, _, __: found._replace(V_rate=OFF * found.V_rate))),
    ({"(19)", "(24)"}, sample, "energy", level(with_stored)),
    ({"(20)", "(25)", "(27)"}, sample, "energy", level(lambda found, _, __: found._replace(V_rate=-found.V_rate))),
    ({"(12)", "(29)", "(30)", "(31)", "(32)", "(33)", "(34)"}, lyapunov, "parts", stretched(lyapunov.parts)),
    ({"(35)", "(36)", "(37)"}, equations, "reach", scaled(reach, 1e-3)),
]
BY_CONSTRUCTION = {"(13)"}  # the order of the state is that of the arrays that everything here reads


def test_every_row_agrees() -> None:
    assert disagreeing() == set()
    every = {row.number for row in rows_of([copy(each) for each in _motions()])}
    assert set().union(*(numbers for numbers, _, _, _ in BROKEN)) | BY_CONSTRUCTION == every


def test_they_cross_the_clamp_surface() -> None:
    assert [each.crosses for each in _motions()] == [False, True, True]


@pytest.mark.parametrize(
    ("numbers", "module", "name", "wrong"), BROKEN, ids=[f"{k}-{name}" for k, (_, _, name, _) in enumerate(BROKEN)]
)
def test_a_row_flips(
    numbers: set[str], module: Any, name: str, wrong: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    _motions()
    monkeypatch.setattr(module, name, wrong)
    assert disagreeing() >= numbers


def test_the_pieces_are_those_that_are_broken() -> None:
    """What the breaks stand in for, on one state."""
    found = next(each for each in _motions() if each.crosses)
    u, d = next((u, d) for side, _, u, d in pairs_of(found.system, found.state) if side == LEFT)
    contact = found.grasp.left_contact
    assert (np.asarray(in_contact(contact, u, d)) != shifted(contact, u, d)).any()
    assert (without_tension_cut(contact, u, d) < -1e-6).any()
