"""`python -m grasp_ros.graph plant`: starts a node, as `ros2 run grasp_ros plant` does."""

import sys

from grasp_ros.graph.nodes.start import start

if __name__ == "__main__":
    sys.exit(start())
