"""Running a scene without ROS, and what comes of it."""

from grasp_ros.simulation.sampled_plant import SampledPlant
from grasp_ros.simulation.simulate import GRID_POINTS, simulate
from grasp_ros.simulation.trajectory import Trajectory, load

__all__ = ["GRID_POINTS", "SampledPlant", "Trajectory", "load", "simulate"]
