"""Scenes: strict YAML files that define a run completely, and the effects that they are composed of."""

from grasp_ros.scene.effects import PAPER
from grasp_ros.scene.scene import Scene, compose, load, names, parse
from grasp_ros.scene.validation import SceneError

__all__ = ["PAPER", "Scene", "SceneError", "compose", "load", "names", "parse"]
