from pathlib import Path

from grasp_ros.exact.integrator import Status as Status
from grasp_ros.graph.bag.reading import read as read_bag
from grasp_ros.identification.fit import fit as fit
from grasp_ros.optimization.search import design as design
from grasp_ros.physics.errors import Refused as Refused
from grasp_ros.physics.layout import LEFT as LEFT
from grasp_ros.physics.layout import OBJECT as OBJECT
from grasp_ros.physics.layout import RIGHT as RIGHT
from grasp_ros.physics.layout import Transition as Transition
from grasp_ros.scene.scene import Scene as Scene
from grasp_ros.scene.scene import compose as compose
from grasp_ros.scene.scene import load as load
from grasp_ros.scene.scene import names as names
from grasp_ros.scene.scene import parse as parse
from grasp_ros.sensitivity.spectrum import spectrum as spectrum
from grasp_ros.simulation.ensemble import ensemble as ensemble
from grasp_ros.simulation.plots import draw as draw
from grasp_ros.simulation.simulate import simulate as simulate
from grasp_ros.simulation.trajectory import Trajectory as Trajectory
from grasp_ros.simulation.trajectory_file import load as load_run

__all__ = [
    "LEFT", "OBJECT", "RIGHT", "Refused", "Scene", "Status", "Trajectory", "Transition", "compose", "design", "draw",
    "ensemble", "fit", "load", "load_run", "names", "parse", "read_bag", "simulate", "spectrum",
]

CONFIG: Path
__version__: str
