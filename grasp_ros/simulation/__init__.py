"""Running a scene without ROS, and its results."""

from grasp_ros.simulation.chunk import Setup
from grasp_ros.simulation.ensemble import Table, ensemble
from grasp_ros.simulation.quantities import summary
from grasp_ros.simulation.sampled_plant import SampledPlant
from grasp_ros.simulation.simulate import GRID_POINTS, simulate
from grasp_ros.simulation.trajectory import Trajectory
from grasp_ros.simulation.trajectory_file import load

__all__ = ["GRID_POINTS", "SampledPlant", "Setup", "Table", "Trajectory", "ensemble", "load", "simulate", "summary"]
