"""ament_python package: `pip install .` and `colcon build` install the same files."""

from glob import glob

from setuptools import find_packages, setup

NAME = "grasp_ros"

setup(
    name=NAME,
    version="0.1.0",
    description="A grasp held together by Hunt-Crossley impacts: exact simulation, control and measurement over ROS 2",
    license="Apache-2.0",
    python_requires=">=3.11,<3.13",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    # grasp_ros/config is a link to config: scenes and layouts are part of the package however it is installed.
    package_data={NAME: ["config/*", "py.typed", "studies/paper/templates/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", sorted(glob("config/*"))),
        (f"lib/{NAME}", sorted(glob("resource/lib/*"))),  # where `ros2 run` looks
    ],
    install_requires=[
        "ros-jazzy-rclpy[fastrtps]",
        "ros-jazzy-common-interfaces",
        "numpy",
        "rosbags",
        "mcap",
        "zstandard",
        "numba",
        "matplotlib",
        "pillow",
        "tqdm",
        "PyYAML",
        "jinja2",
        "rich",
    ],
    extras_require={
        "test": [
            "pytest", "pytest-xdist", "hypothesis", "gmpy2", "mpmath", "mcap-ros2-support", "mypy", "ruff",
            "types-PyYAML", "types-tqdm", "colcon-common-extensions", "scipy", "xarray", "zarr>=3.1", "distributed",
            "ruamel.yaml", "playwright",
        ],
        "map": ["xarray", "zarr>=3.1", "scipy"],
        "cluster": ["xarray", "zarr>=3.1", "scipy", "distributed"],
        "study": [
            "gmpy2", "mpmath", "scipy", "heyoka", "scikit-sundae", "pytest-benchmark", "xarray", "zarr>=3.1",
            "ruamel.yaml",
        ],
    },
    entry_points={
        "console_scripts": [
            "plant = grasp_ros.graph.nodes.start:plant",
            "left_controller = grasp_ros.graph.nodes.start:left_controller",
            "right_controller = grasp_ros.graph.nodes.start:right_controller",
            "monitor = grasp_ros.graph.nodes.start:monitor",
            "grasp = grasp_ros.cli.main:main",
        ]
    },
    zip_safe=False,
)
