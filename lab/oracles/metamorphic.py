"""Metamorphic relations: two scenes whose results must be related, whatever they are."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Entry
from grasp_ros.physics.model import Arm, Array, Contact
from grasp_ros.scene import Scene
from lab.cases.case import Case, Product, Solver
from lab.cases.families import RELATION
from lab.cases.scenes import ELASTIC, distance, grasp, library, part

SWAPPED = [4, 5, 2, 3, 0, 1]
FLIP = np.array([1.0, -1.0] * 3)  # backwards in time
DIRECTED = ("position_m", "velocity_m_per_s", "set_point_m", "feed_forward_N", "force_N", "angle_rad")
PAIRED = {"left": "right", "right": "left"}
OTHER_SIDE = np.array([RIGHT, LEFT, OBJECT], dtype=float)


def mirrored(scene: Scene) -> Scene:
    """The scene seen from the other side."""
    values: dict[str, dict[str, Any]] = {}
    for section, numbers in scene.values.items():
        side, _, rest = section.partition("_")
        values[f"{PAIRED[side]}_{rest}" if side in PAIRED else section] = {
            key: _times(value, -1.0) if key in DIRECTED else value for key, value in numbers.items()
        }
    return scenes.compose(scene.name, values)


def _times(value: Any, factor: float) -> Any:
    """A number or a table of them, times a factor."""
    return [factor * number for number in value] if isinstance(value, tuple) else factor * value


def scaled(scene: Scene, length: float, time: float, mass: float) -> Scene:
    """The scene in other units, O7; exact for powers of 4, 2 and 2."""
    force = mass * length / time**2
    factors = {
        "kg": mass, "m": length, "s": time, "N": force, "Hz": 1.0 / time, "m/s": length / time,
        "m/s^2": length / time**2, "N/m": mass / time**2, "N s/m": mass / time, "s/m": time / length,
        "N/m^1.5": mass / (time**2 * math.sqrt(length)),
    }
    units = {parameter.key: parameter.unit for effect in scene.effects for parameter in effect.parameters}
    return scenes.compose(scene.name, {
        section: {key: _times(value, factors[units[key]]) if units[key] in factors else value
                  for key, value in numbers.items()}
        for section, numbers in scene.values.items()
    })


def started(scene: Scene, state: Array) -> Scene:
    """The scene from another state."""
    names = ("left_arm", "object", "right_arm")
    numbers = {f"{name}.{key}": float(state[2 * body + column]) for body, name in enumerate(names)
               for column, key in enumerate(("position_m", "velocity_m_per_s"))}
    return scene.changed(numbers)


def mirror(scene: Scene, solver: Solver) -> float:
    """Largest difference between a scene and its mirror image; inf if the recorded events are others."""
    times = part(scene, 201)
    here, own = _solved(scene, times, solver)
    there, image = _solved(mirrored(scene), times, solver)
    image[:, Entry.BODY] = OTHER_SIDE[image[:, Entry.BODY].astype(int)]
    return _apart(here, -there[:, SWAPPED], own, image)


def scaling(length: float, time: float, mass: float, scene: Scene, solver: Solver) -> float:
    """Largest difference between a scene and itself in other units; inf if the recorded events are others."""
    times = part(scene, 201)
    here, own = _solved(scene, times, solver)
    there, image = _solved(scaled(scene, length, time, mass), time * times, solver)
    moved = np.array([length, length / time])
    return _apart(here * np.tile(moved, 3), there, own * np.array([time, 1.0, 1.0, *moved]), image)


def _solved(scene: Scene, times: Array, solver: Solver) -> tuple[Array, Array]:
    """States, 0 of what is not there, and the events that the product recorded; none of another solver."""
    states = solver.states(scene, times).copy()
    states[:, scene.system.absent_columns] = 0.0
    return states, solver.runs[-1].event_table.copy() if isinstance(solver, Product) else np.zeros((0, len(Entry)))


def _apart(here: Array, there: Array, own: Array, image: Array) -> float:
    """Largest difference of states whose events are the same in any order: which side is looked at first is open."""
    same = sorted(own.tolist()) == sorted(image.tolist())
    return float(np.abs(here - there).max()) if same else np.inf


def reversal(scene: Scene, solver: Solver) -> float:
    """Distance from the start after the motion and its way back; for p = 0 and no damping."""
    forth = solver.states(scene, [scene.duration])[0]
    back = solver.states(started(scene, forth * FLIP), [scene.duration])[0]
    return float(np.abs(back * FLIP - scene.initial_state).max())


def splitting(scene: Scene, parts: int, solver: Solver) -> float:
    """Difference between one horizon and many, each started from the state before."""
    whole = solver.states(scene, [scene.duration])[0]
    short = scene.changed({"time.duration_s": round(scene.duration / parts, 9)})
    state = scene.initial_state
    for _ in range(parts):
        state = solver.states(started(short, state), [short.duration])[0]
    return distance(state[None], whole[None])


def _grid(scene: Scene, product: Product) -> float:
    """Output times must not change the motion."""
    few, many = (product.run(scene, part(scene, points)) for points in (2, 20001))
    return float(np.abs(few.state[-1] - many.state[-1]).max()) if few.events == many.events else np.inf


def _absent(product: Product) -> float:
    """An arm and a contact that meet nobody, and not being there at all."""
    full = grasp([-0.3, 0.0, 0.0, 0.0, 1e6, 0.0], 5.0, right=Arm(1.0, 0.0, 0.0, 0.0, 0.0))
    bare = scenes.compose("bare", {key: numbers for key, numbers in full.values.items() if not key.startswith("right")})
    times = part(full, 201)
    return float(np.abs(product.run(full, times).state[:, :4] - product.run(bare, times).state[:, :4]).max())


def _order(product: Product) -> float:
    """The order of the sections of a file."""
    scene = library("case_04", 5.0)
    other = scenes.compose("case_04", dict(reversed(list(scene.values.items()))))
    times = part(scene, 201)
    return float(np.abs(product.run(scene, times).state - product.run(other, times).state).max())


def cases() -> Iterator[Case]:
    """All relations."""
    clamped = grasp([-0.3, 0, 0, 0, 0.2, 0], 5.0, contact=Contact(1e3, 15.0), mass=1.0)
    uneven = grasp([-0.3, 0.1, 0.02, 0.3, 0.5, 0], 5.0, right=Arm(2.0, 3.0, 0.1, 20.0, 1.0), contact=Contact(1e6, 0.5))
    for text, scene in (("case 3", library("case_03", 5.0)), ("clamped", clamped), ("uneven", uneven)):
        yield Case(RELATION, f"mirror, {text}", partial(mirror, scene), 0.0, "O6")
    for units in ((4.0, 1.0, 1.0), (1.0, 2.0, 1.0), (1.0, 1.0, 8.0), (4.0**-3, 2.0**4, 0.25)):
        yield Case(RELATION, f"units times {', '.join(f'{unit:g}' for unit in units)}",
                   partial(scaling, *units, uneven), 0.0, "O7: tolerances scale too")
    backwards = grasp([-0.3, 0.0, 0.05, 0.3, 0.2, -0.1], 5.0, left=ELASTIC, contact=Contact(1e4, 0.0))
    yield Case(RELATION, "backwards in time", partial(reversal, backwards), 1e-10,
               "O8: back at the start, m and m/s; errors of both ways add up")
    for parts in (10, 1000):
        yield Case(RELATION, f"5 s in {parts} intervals", partial(splitting, uneven, parts), 1e-10,
                   "the same end, relative; an interval may begin in any mode")
    yield Case(RELATION, "2 or 20001 output times", partial(_grid, uneven), 0.0, product_only=True)
    yield Case(RELATION, "an arm absent or out of reach", _absent, 0.0, product_only=True)
    yield Case(RELATION, "order of the sections", _order, 0.0, product_only=True)
