"""The contact of one pair of arm and object: the Hunt-Crossley law (6), (7), with or without dissipation."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.impact_law import stored_energy
from grasp_ros.physics.layout import LEFT, OBJECT, Law, Of
from grasp_ros.physics.model import Array, penetration
from grasp_ros.physics.system import COLUMN, System
from grasp_ros.scene.effects.base import SIDES, Effect, Output, Parameter, Sections, nothing, oddity
from grasp_ros.scene.topics import CONTACTS

ROUNDING = 1e-9  # of the largest position, or of 1 m: what is less deep is meant to touch
PARAMETERS = (
    Parameter("hertz_N_per_m1_5", *RANGES["Hertzian stiffness H"].bounds, "Hertzian stiffness of the impact, H",
              target=("pairs", Law.HERTZIAN)),
    Parameter("dissipation_s_per_m", *RANGES["dissipation p"].bounds, "Hunt-Crossley dissipation of the impact, p",
              optional=True, target=("pairs", Law.DISSIPATION)),
)


def _force(side: int, system: System, _: int, state: Array) -> float:
    """Impact force fw at a tick."""
    return system.impact(side, state.tolist())


def _odd(side: str, sections: Sections, system: System) -> Iterable[str]:
    """Suspicious: an arm beyond the object, deeper in it than motion and forces press, or that passes through it.

    Every state of a run may be a start, so that an arm may be inside the object.
    """
    at, far = SIDES[side], "right" if side == "left" else "left"
    if f"{far}_arm" in sections and SIDES[far] not in system.contacts:
        why = f"touches nothing: without {far}_contact it passes through the object, which the {side} arm hits"
        yield oddity(f"{far}_arm", sections[f"{far}_arm"], why, f"{far}_contact too, or no {far}_arm")
    depths = penetration(system.state)[0::2]
    depth, gap = float(depths[at]), float(-depths[SIDES[far]])
    key, value = f"{side}_arm.position_m", sections[f"{side}_arm"]["position_m"]
    position = sections["object"]["position_m"]
    if depth <= ROUNDING * min(1.0, max(map(abs, system.state[0::2].tolist()))):
        return
    stored, pressing = stored_energy(system.pairs[at, Law.HERTZIAN], depth), _pressing(system, at, depth)
    if SIDES[far] in system.contacts and 0.0 < gap < depth:
        why = f"lies {far} of the {far} arm, which does not touch the object"
        yield oddity(key, value, why, f"each arm on its side of the object at {position!r}")
    elif stored > pressing:
        why = (f"lies {depth:.6g} m inside the object: the contact stores {stored:.3g} J, where motion and forces"
               f" press in {pressing:.3g} J")
        yield oddity(key, value, why, f"{side} of the object at {position!r}, or a little {far} of it")


def _pressing(system: System, side: int, depth: float) -> float:
    """Energy in J that can press an arm and the object into each other: of motion, and of the forces at t = 0."""
    loop, external, energy = system.closed_loop, system.external_at(0), 0.0
    inward = 1.0 if side == LEFT else -1.0  # for the arm
    for body, sign in ((side, inward), (OBJECT, -inward)):
        x, v = system.state[COLUMN[body] : COLUMN[body] + 2]
        force = sign * (loop[body, Of.FORCE] - loop[body, Of.STIFFNESS] * x) + abs(external[body])
        energy += 0.5 * loop[body, Of.MASS] * v**2 + max(force, 0.0) * depth
    return float(energy)


EFFECTS = tuple(
    Effect(
        f"{side}_contact", f"the {side} arm hits the object", PARAMETERS, nothing,
        "4/5 H u^(5/2) while u >= 0; an impact takes 2 p H u^(3/2) u'^2", needs=(f"{side}_arm", "object"),
        row=SIDES[side], oddities=partial(_odd, side), outputs=(Output(CONTACTS[side], partial(_force, SIDES[side])),),
    )
    for side in SIDES
)
