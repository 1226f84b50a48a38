"""The controllers: linear state feedback of an arm, (4), (5), around a set-point, with a constant force."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from grasp_ros.physics.control import Column
from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES, Effect, Parameter, Sections, nothing, oddity
from grasp_ros.scene.topics import COMMANDS

PARAMETERS = (
    Parameter("position_gain_N_per_m", *RANGES["position gain"].bounds, "gain of the position feedback, Kp", live=True,
              target=("laws", Column.POSITION_GAIN)),
    Parameter("velocity_gain_Ns_per_m", *RANGES["velocity gain"].bounds, "gain of the velocity feedback, Kv",
              live=True, target=("laws", Column.VELOCITY_GAIN)),
    Parameter("set_point_m", *RANGES["position, set-point"].bounds,
              "position that the feedback aims at; without it 0, as in the paper", optional=True, live=True,
              smallest=0.0, target=("laws", Column.SET_POINT)),
    Parameter("feed_forward_N", *RANGES["force"].bounds, "constant force added to the feedback", optional=True,
              live=True, target=("laws", Column.FEED_FORWARD)),
)


def _odd(side: str, sections: Sections, _: System) -> Iterable[str]:
    section, meant = f"{side}_feedback", "a position_gain_N_per_m that is not 0"
    aim = sections[section].get("set_point_m", 0.0)
    if aim != 0.0 and sections[section]["position_gain_N_per_m"] == 0.0:
        yield oddity(f"{section}.set_point_m", aim, "has no effect without a position gain", meant)


EFFECTS = tuple(
    Effect(
        f"{side}_feedback", f"controller of the {side} arm: linear state feedback", PARAMETERS, nothing,
        "Kp x^2, with a set-point or a constant force (k + Kp) (x - x_e)^2; the feedback takes 2 Kv x'^2",
        needs=(f"{side}_arm",), row=SIDES[side], node=f"{side}_controller", commands=COMMANDS[side],
        example={"set_point_m": 0.05, "feed_forward_N": 0.5}, oddities=partial(_odd, side),
        acts_by=("position_gain_N_per_m", "velocity_gain_Ns_per_m", "feed_forward_N"),
    )
    for side in SIDES
)
