"""Installs the package into a ROS workspace; colcon calls it."""

from glob import glob

from setuptools import setup

PACKAGE = "rise_ros"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=[PACKAGE, f"{PACKAGE}.examples"],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", glob("launch/*.launch.py")),  # noqa: PTH207
        (f"share/{PACKAGE}/config", glob("config/*")),  # noqa: PTH207
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The rise-tui authors",
    maintainer_email="rise-tui@users.noreply.github.com",
    description="Starts rise-tui's engine and its nodes with ros2 run and ros2 launch; the reference robot wrapper.",
    license="MIT",
    entry_points={
        "console_scripts": [
            *(
                f"{name} = rise_ros.programs:{name}"
                for name in (
                    "engine",
                    "console",
                    "doctor",
                    "robot_sim",
                    "keyword_spotter",
                    "gaze_trigger",
                    "answer_node",
                    "task_tree",
                )
            ),
            "robot_wrapper = rise_ros.robot_wrapper:main",
        ]
    },
)
