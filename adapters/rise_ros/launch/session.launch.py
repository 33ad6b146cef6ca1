"""A session with the programs that it needs.

    ros2 launch rise_ros session.launch.py config:=$HOME/studies/lab_opening robot:=rise mode:=real robot_sim:=true

Every option of `rise-engine serve` is an argument (`--show-args` lists them). Start the console by hand, in its own
terminal: rise-tui --config $HOME/studies/lab_opening
"""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
    SetEnvironmentVariable,
    TimerAction,
)
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch_ros.actions import Node
from rise_ros import session_arguments as arguments

RESTARTS = 5
"""Maximum number of restarts of a crashed engine."""
RESTART_SECONDS = 1.0


def launch(context):
    given = {name: context.launch_configurations[name] for name in arguments.ARGUMENTS}
    problems = arguments.find_problems(given, arguments.typed_arguments(sys.argv, Path(__file__).name))
    if problems:
        raise ValueError("; ".join(problems))
    entities = engine(given, RESTARTS if given["respawn"] == "true" else 0)
    if given["ros_domain_id"]:
        entities.insert(0, SetEnvironmentVariable("ROS_DOMAIN_ID", given["ros_domain_id"]))
    if given["robot_sim"] == "true":
        entities.append(
            Node(
                package="rise_ros",
                executable="robot_sim",
                namespace=given["namespace"],
                arguments=arguments.robot_arguments(given),
                ros_arguments=arguments.robot_ros_arguments(given),
                output="screen",
            )
        )
    return entities


def engine(given, restarts):
    """Return the session's process, and the reaction to its end."""
    # At the end, the engine stops the robot, waits for its answer and completes the record: up to 31 s with recorders.
    node = Node(
        package="rise_ros",
        executable="engine",
        namespace=given["namespace"],
        arguments=arguments.engine_arguments(given),
        ros_arguments=arguments.engine_ros_arguments(given),
        output="screen",
        sigterm_timeout="40",
        sigkill_timeout="15",
    )

    def go_on(event, context):
        if not restarts or context.is_shutdown or not arguments.is_crash(event.returncode):
            return [EmitEvent(event=Shutdown(reason="the session has ended"))]
        again = engine(arguments.recovery_arguments(given), restarts - 1)
        return [
            LogInfo(msg=f"the engine has crashed ({event.returncode}); it goes on with the session"),
            TimerAction(period=RESTART_SECONDS, actions=again),
        ]

    return [RegisterEventHandler(OnProcessExit(target_action=node, on_exit=go_on)), node]


def generate_launch_description():
    declared = [
        DeclareLaunchArgument(name, description=about, default_value=default)
        for name, (default, about) in arguments.ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=launch)])
