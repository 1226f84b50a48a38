"""Degenerate scenes, as users and unit tests have them: zeros, equal numbers, states on a switch, limits.

The title of a scene names the degeneracies that it was drawn with.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics.model import Arm, Contact
from grasp_ros.scene import Scene
from lab.cases.degenerate_starts import SIDES, STARTS, Sections, Sketch, ulps
from lab.cases.draw import Draw, draw_ordinary
from lab.cases.scenes import side_sections

ORDINARY = 0.15  # part of all draws


def _same_speed(sketch: Sketch) -> None:
    neighbour = 2 * int(sketch.draw.between(0.0, 2.0))
    sketch.v[neighbour] = ulps(sketch.draw, sketch.v[1])


def _wall(sketch: Sketch) -> None:
    side = int(sketch.draw.between(0.0, 2.0))
    sketch.mass[2 * side], sketch.springs[side][0], sketch.v[2 * side] = 1e9, 1e12, 0.0


def _without(name: str) -> Callable[[Sketch], None]:
    """Nothing of a kind on either side."""
    return lambda sketch: setattr(sketch, name, np.zeros_like(getattr(sketch, name)).tolist())


def _set_point(sketch: Sketch) -> None:
    draw = sketch.draw
    for side in (0, 1):
        if draw.chance(0.6):
            own = draw.chance(0.4)
            position = ulps(draw, sketch.x[2 * side]) if own else sketch.size * draw.between(-1.0, 1.0)
            sketch.targets[side]["set_point_m"] = position


def _feed_forward(sketch: Sketch) -> None:
    draw = sketch.draw
    usual = sketch.mass[1] * sketch.speed**2 / sketch.size
    force = usual * draw.decades(-4.0, 2.0) * (1.0 if draw.chance(0.5) else -1.0)
    for side in (0, 1):
        if draw.chance(0.6):
            sketch.targets[side]["feed_forward_N"] = force if draw.chance(0.5) else -force


def _friction(sketch: Sketch) -> None:
    draw = sketch.draw
    usual = sketch.mass[1] * sketch.speed**2 / sketch.size
    pull = 0.0
    if (tilt := sketch.extra.get("tilt")) is not None:
        pull = sketch.mass[1] * abs(tilt["gravity_m_per_s2"] * math.sin(tilt["angle_rad"]))
    exact = pull > 0.0 and draw.chance(0.5)
    friction = {"coulomb_N": ulps(draw, pull) if exact else usual * draw.decades(-5.0, 2.0)}
    if draw.chance(0.4):
        friction["viscous_Ns_per_m"] = sketch.mass[1] * sketch.speed / sketch.size * draw.decades(-4.0, 2.0)
    sketch.extra["object_friction"] = {key: min(value, 1e12) for key, value in friction.items()}


def _tilt(sketch: Sketch) -> None:
    draw = sketch.draw
    gravity = min(sketch.speed**2 / sketch.size * draw.decades(-4.0, 1.0), 1e3)
    sketch.extra["tilt"] = {"angle_rad": draw.between(-1.5, 1.5), "gravity_m_per_s2": gravity}


DEGENERACIES: tuple[tuple[str, float, Callable[[Sketch], None]], ...] = (
    ("same speed", 0.1, _same_speed), ("one wall", 0.06, _wall), ("no springs", 0.15, _without("springs")),
    ("no damping", 0.15, _without("dampers")), ("elastic", 0.1, _without("loss")), ("set-point", 0.25, _set_point),
    ("feed-forward", 0.2, _feed_forward), ("tilt", 0.2, _tilt), ("friction", 0.25, _friction),
)


def draw_scene(draw: Draw, ordinary: float = ORDINARY) -> Scene:
    """A scene, with this probability an ordinary one, else a degenerate one."""
    return draw_ordinary(draw) if draw.chance(ordinary) else draw_degenerate(draw)


def draw_degenerate(draw: Draw) -> Scene:
    """A scene with one way to start and any number of degeneracies."""
    sketch = Sketch(draw)
    name, start = STARTS[int(draw.between(0.0, len(STARTS)))]
    start(sketch)
    sketch.degeneracies.append(name)
    for degeneracy, part, add in DEGENERACIES:
        if draw.chance(part):
            add(sketch)
            sketch.degeneracies.append(degeneracy)
    sections = _sections(sketch)
    period, ticks = _time(sketch)
    sections["time"] = {"duration_s": period * ticks / 1e9, "control_period_s": period / 1e9}
    _add_loop(sketch, sections)
    _add_forces(sketch, sections, period, ticks)
    _leave_out(sketch, sections)
    return scenes.compose("drawn", sections, title=", ".join(sketch.degeneracies))


def _sections(sketch: Sketch) -> Sections:
    sections: Sections = {"object": {"mass_kg": sketch.mass[1], "position_m": sketch.x[1],
                                     "velocity_m_per_s": sketch.v[1]}, **sketch.extra}
    for k, side in enumerate(SIDES):
        (spring, gain), (damper, rate) = ([min(number, 1e12) for number in numbers[k]]
                                          for numbers in (sketch.springs, sketch.dampers))
        arm, contact = Arm(sketch.mass[2 * k], spring, damper, gain, rate), Contact(sketch.hertz[k], sketch.loss[k])
        sections |= side_sections(side, arm, contact, sketch.x[2 * k], sketch.v[2 * k])
        for key, value in sketch.targets[k].items():
            sections[f"{side}_feedback"][key] = min(max(value, -1e12), 1e12)
    return sections


def _contact_rate(sketch: Sketch, k: int) -> float:
    """How fast a pair swings or creeps in contact, in 1/s, about."""
    arm, body, hertz = sketch.mass[2 * k], sketch.mass[1], sketch.hertz[k]
    reduced = arm * body / (arm + body)
    u = max((sketch.x[2 * k] - sketch.x[1]) * (1 - 2 * k), 0.0)
    pushed = sum(sketch.springs[k]) * (abs(sketch.x[2 * k]) + abs(sketch.targets[k].get("set_point_m", 0.0)))
    pushed += abs(sketch.targets[k].get("feed_forward_N", 0.0))
    pushed += max(arm, body) * sketch.extra.get("tilt", {}).get("gravity_m_per_s2", 0.0)
    u = max(u, (pushed / hertz) ** (2.0 / 3.0), (reduced * max(map(abs, sketch.v)) ** 2 / hertz) ** 0.4)
    return float(max(math.sqrt(1.5 * hertz * math.sqrt(u) / reduced), sketch.loss[k] * hertz * u**1.5 / reduced))


def _time(sketch: Sketch) -> tuple[int, int]:
    """Control period in ns, and how many: some swings, some impacts, or anything."""
    draw = sketch.draw
    swing = max(math.sqrt(sum(sketch.springs[k]) / sketch.mass[2 * k]) for k in (0, 1))
    impact = max(_contact_rate(sketch, k) for k in (0, 1)) or sketch.speed / sketch.size
    if draw.chance(0.06):
        sketch.degeneracies.append("any horizon")
        seconds = draw.decades(-9.0, 4.0)
    else:
        rates = (impact, swing or impact, sketch.speed / sketch.size, impact)
        seconds = draw.decades(-1.0, 1.0) / rates[int(draw.between(0.0, 4.0))]
        seconds = min(seconds, draw.decades(1.0, 2.5) / impact)
    ticks = 1 + int(draw.between(0.0, 20.0))
    period = min(max(round(seconds * 1e9 / ticks), 1), 10**12)
    return period, ticks


def _add_loop(sketch: Sketch, sections: Sections) -> None:
    draw = sketch.draw
    if not draw.chance(0.2):
        return
    sketch.degeneracies.append("loop")
    sections["loop"] = {"delay_ticks": int(draw.between(0.0, 4.0))} if draw.chance(0.3) else {}


def _add_forces(sketch: Sketch, sections: Sections, period: int, ticks: int) -> None:
    """External forces from tick to tick."""
    draw = sketch.draw
    usual = sketch.mass[1] * sketch.speed**2 / sketch.size
    body = ("left_arm", "object", "right_arm")[int(draw.between(0.0, 3.0))]
    force = min(usual * draw.decades(-3.0, 2.0), 1e12) * (1.0 if draw.chance(0.5) else -1.0)
    start, length = int(draw.between(0.0, ticks)), 1 + int(draw.between(0.0, ticks))
    if draw.chance(0.12):
        sketch.degeneracies.append("pulse")
        sections[f"{body}_pulse"] = {"force_N": force, "start_s": start * period / 1e9,
                                     "length_s": length * period / 1e9}
    if draw.chance(0.06):
        sketch.degeneracies.append("table")
        times = [tick for tick in (start, start + length, start + 2 * length) if tick <= ticks]
        sections[f"{body}_table"] = {"time_s": [tick * period / 1e9 for tick in times],
                                     "force_N": [force * draw.between(-1.0, 1.0) for _ in times]}
    if draw.chance(0.03):
        sketch.degeneracies.append("sine")
        sections[f"{body}_sine"] = {"amplitude_N": abs(force), "frequency_Hz": min(0.1e9 / period, 1e6)}


def _leave_out(sketch: Sketch, sections: Sections) -> None:
    draw = sketch.draw
    if draw.chance(0.06):
        sketch.degeneracies.append("absent")
        side = SIDES[int(draw.between(0.0, 2.0))]
        for section in [section for section in sections if section.startswith(f"{side}_")]:
            del sections[section]
    elif draw.chance(0.03):
        sketch.degeneracies.append("no contact")
        del sections[f"{SIDES[int(draw.between(0.0, 2.0))]}_contact"]
