"""Scenes that random search found, with what it found wrong at the time; all properties hold now."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import MAX_WORK
from grasp_ros.verification.cases.case import Case, Product
from grasp_ros.verification.cases.families import FOUND
from grasp_ros.verification.properties import examine

SCENES: tuple[tuple[str, str, Mapping[str, Mapping[str, Any]]], ...] = (
    ("a heavy arm under 3e7 N beside a light contact", "thousands of roundings of a position times a large force", {
        "left_arm": {"mass_kg": 0.0021571932550279015, "stiffness_N_per_m": 0.0,
            "damping_Ns_per_m": 1.2043519435434921e-07, "position_m": -4.441126009596297,
            "velocity_m_per_s": -0.5438557405151875},
        "left_feedback": {"position_gain_N_per_m": 7.284921635801107, "velocity_gain_Ns_per_m": 0.0},
        "left_contact": {"hertz_N_per_m1_5": 101536.63038060127, "dissipation_s_per_m": 69774.8009791528},
        "right_arm": {"mass_kg": 14.801969166192963, "stiffness_N_per_m": 18953.05492963989, "damping_Ns_per_m": 0.0,
            "position_m": 0.5098928939500355, "velocity_m_per_s": -1.6330075336392886},
        "right_feedback": {"position_gain_N_per_m": 32589087.569179926, "velocity_gain_Ns_per_m": 227.64237965769635},
        "right_contact": {"hertz_N_per_m1_5": 4127872956.967923, "dissipation_s_per_m": 0.0},
        "object": {"mass_kg": 3.1083239826157394e-05, "position_m": 0.0, "velocity_m_per_s": 4.418208667661261},
        "time": {"duration_s": 0.0094635, "control_period_s": 3.1545e-05},
        "loop": {"delay_ticks": 2},
    }),
    ("hundreds of small impacts within a period", "thousands of roundings of a position times a large force", {
        "left_arm": {"mass_kg": 0.020518314920592688, "stiffness_N_per_m": 0.10754137342018878,
            "damping_Ns_per_m": 0.0, "position_m": -2.0802827761282594, "velocity_m_per_s": 0.0009381414374740998},
        "left_feedback": {"position_gain_N_per_m": 0.01430501946198579,
            "velocity_gain_Ns_per_m": 0.011546939884962016},
        "left_contact": {"hertz_N_per_m1_5": 73165.09729494691, "dissipation_s_per_m": 1.432029915350485},
        "right_arm": {"mass_kg": 19084.466612073298, "stiffness_N_per_m": 0.0, "damping_Ns_per_m": 0.0,
            "position_m": 2.0378504095742533, "velocity_m_per_s": 0.001276480285681462},
        "right_feedback": {"position_gain_N_per_m": 1190.4392810647878, "velocity_gain_Ns_per_m": 300.19494657030646},
        "right_contact": {"hertz_N_per_m1_5": 158993288.8071132, "dissipation_s_per_m": 8874.47064394497},
        "object": {"mass_kg": 2.042789374847137e-05, "position_m": 0.0, "velocity_m_per_s": -0.0010356621984599038},
        "time": {"duration_s": 7.83416718, "control_period_s": 0.058030868},
        "loop": {"delay_ticks": 2},
        "left_sensor": {"noise_seed": 1, "position_noise_m": 4.06580650516557e-06,
            "velocity_step_m_per_s": 2.6661391823269937e-05},
        "right_actuator": {"limit_N": 120.2787678784004},
    }),
    ("slips between a thousand impacts", "a slip at the moment at which the kernel hands over its events", {
        "left_arm": {"mass_kg": 0.009783919725319116, "stiffness_N_per_m": 0.0012346471686849913,
            "damping_Ns_per_m": 0.0, "position_m": -0.002132570456213565, "velocity_m_per_s": 3.6845199287429273},
        "left_feedback": {"position_gain_N_per_m": 0.030911843707886633, "velocity_gain_Ns_per_m": 0.0,
            "set_point_m": 0.0014269595602576194, "feed_forward_N": 0.15844820686433764},
        "left_contact": {"hertz_N_per_m1_5": 8457357.477983719, "dissipation_s_per_m": 0.0},
        "right_arm": {"mass_kg": 4598.245553816247, "stiffness_N_per_m": 0.0, "damping_Ns_per_m": 0.0,
            "position_m": 0.0018992850094906226, "velocity_m_per_s": -1.5937528037126971},
        "right_feedback": {"position_gain_N_per_m": 13817.088393842412, "velocity_gain_Ns_per_m": 0.0},
        "right_contact": {"hertz_N_per_m1_5": 1145963.3690498618, "dissipation_s_per_m": 0.0},
        "object": {"mass_kg": 1.9517063488114115e-05, "position_m": 0.0, "velocity_m_per_s": 2.141361814037872},
        "time": {"duration_s": 0.636054754, "control_period_s": 0.636054754},
        "object_friction": {"viscous_Ns_per_m": 0.0, "coulomb_N": 0.028364977201572453},
    }),
)


def _violated(sections: Mapping[str, Mapping[str, Any]], _: Product) -> float:
    """Number of properties that do not hold."""
    return float(len(examine(scenes.compose("found", sections), max_work=MAX_WORK).broken))


def cases() -> Iterator[Case]:
    """One for each."""
    for name, note, sections in SCENES:
        yield Case(FOUND, name, partial(_violated, sections), 0.0, note, product_only=True)
