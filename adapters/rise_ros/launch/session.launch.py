"""A session, and what it needs around it.

    ros2 launch rise_ros session.launch.py config:=$HOME/studies/lab_opening robot:=rise mode:=real robot_sim:=true

The console is started by hand, in a terminal of its own: rise-tui --config $HOME/studies/lab_opening
"""

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    OpaqueFunction,
    RegisterEventHandler,
    SetEnvironmentVariable,
)
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch_ros.actions import Node

ARGUMENTS = {
    "config": (None, "The scenario's folder."),
    "robot": ("", "Another robot profile than the scenario's."),
    "mode": ("", "debug or real; without it, the scenario's."),
    "rule": ("", "A rule to begin with, for a study that runs by itself."),
    "namespace": ("", "Namespace of all these nodes."),
    "ros_domain_id": ("", "ROS domain of all these nodes; without it, that of the terminal."),
    "robot_sim": ("false", "true: a simulated robot on the wire, in place of the robot's wrapper."),
    "recover": ("false", "true: go on with the latest session that did not end, if there is one."),
}


def launch(context):
    chosen = {name: context.launch_configurations[name] for name in ARGUMENTS}
    arguments = ["--config", chosen["config"], "--recover" if chosen["recover"] == "true" else "--new"]
    for name in ("robot", "mode", "rule"):
        if chosen[name]:
            arguments += [f"--{name}", chosen[name]]
    # Ending a session means stopping the robot, waiting for its answer and completing the record: up to 11 s.
    engine = Node(
        package="rise_ros",
        executable="engine",
        namespace=chosen["namespace"],
        arguments=arguments,
        output="screen",
        sigterm_timeout="15",
        sigkill_timeout="15",
    )
    entities = [engine]
    if chosen["ros_domain_id"]:
        entities.insert(0, SetEnvironmentVariable("ROS_DOMAIN_ID", chosen["ros_domain_id"]))
    if chosen["robot_sim"] == "true":
        robot = ["--robot", chosen["robot"]] if chosen["robot"] else []
        entities.append(
            Node(
                package="rise_ros",
                executable="robot_sim",
                namespace=chosen["namespace"],
                arguments=["--ros", "rclpy", "--config", chosen["config"], *robot],
                output="screen",
            )
        )
    over = EmitEvent(event=Shutdown(reason="the session has ended"))
    entities.append(RegisterEventHandler(OnProcessExit(target_action=engine, on_exit=[over])))
    return entities


def generate_launch_description():
    declared = [
        DeclareLaunchArgument(name, description=about, **({} if default is None else {"default_value": default}))
        for name, (default, about) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=launch)])
