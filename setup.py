"""ament_python package: `pip install .` and `colcon build` install the same files; pyproject.toml has the metadata."""

from glob import glob

from setuptools import find_packages, setup

NAME = "grasp_ros"

setup(
    python_requires=">=3.11,<3.13",
    packages=[*find_packages(include=[NAME, f"{NAME}.*"]), f"{NAME}.config"],
    package_dir={f"{NAME}.config": "config"},  # scenes and layouts are part of the package however it is installed
    package_data={NAME: ["py.typed", "*.pyi"], f"{NAME}.config": ["*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", sorted(glob("config/*"))),
        (f"lib/{NAME}", sorted(glob("resource/lib/*"))),  # where `ros2 run` looks
    ],
    zip_safe=False,
)
