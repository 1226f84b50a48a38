"""ament_python package; colcon and pip install the same files."""

from glob import glob

from setuptools import find_packages, setup

NAME = "grasp_ros"
EXECUTABLES = {
    "plant": "grasp_ros.nodes.plant:main",
    "left_controller": "grasp_ros.nodes.controller:left_main",
    "right_controller": "grasp_ros.nodes.controller:right_main",
    "monitor": "grasp_ros.nodes.monitor:main",
    "grasp": "grasp_ros.cli:main",
}

setup(
    name=NAME,
    version="0.1.0",
    description="A grasp held together by impacts: exact simulation, control and measurement over ROS 2",
    packages=[*find_packages(include=[NAME, f"{NAME}.*"]), f"{NAME}.config"],
    package_dir={f"{NAME}.config": "config"},
    package_data={f"{NAME}.config": ["*.yaml"], NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", sorted(glob("config/*.yaml"))),
    ],
    entry_points={"console_scripts": [f"{name} = {target}" for name, target in EXECUTABLES.items()]},
    zip_safe=False,
)
