"""Starts the bridge: `ros2 launch vigil_bridge bridge.launch.py graph:=left params_file:=left.yaml obey:=false`."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ROVER = str(Path(get_package_share_directory("vigil_bridge")) / "config" / "rover.yaml")
# Name, default, description. Parameters that are left empty stay as the file has them.
PARAMETERS = [
    ("graph", "", "name of a graph on this machine, host:port of its UDP socket, or path of its Unix socket"),
    ("channel_list", "", "file of `vigil channels`, where graph is an address"),
    ("obey", "", "true: commands pass from cmd_vel_in to cmd_vel_out as Vigil has them; false: diagnostics only"),
]
OTHERS = [
    ("params_file", ROVER, "file of parameters: which channel is which field of which topic"),
    ("namespace", "", "namespace of the node and its topics"),
    ("cmd_vel_in", "cmd_vel_in", "topic of the planner's commands"),
    ("cmd_vel_out", "cmd_vel", "topic of the base's commands"),
]


def bridge(context):
    # As what they are: launch would take a graph's name '7' for a number.
    kinds = {"graph": str, "channel_list": str, "obey": bool}
    given = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kinds[name])
        for name, _, _ in PARAMETERS
        if context.launch_configurations[name]
    }
    return [
        Node(
            package="vigil_bridge",
            executable="bridge",
            name="vigil_bridge",
            namespace=LaunchConfiguration("namespace"),
            output="screen",
            parameters=[LaunchConfiguration("params_file"), given],
            remappings=[(name, LaunchConfiguration(name)) for name in ("cmd_vel_in", "cmd_vel_out")],
        )
    ]


def generate_launch_description():
    said = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in PARAMETERS]
    said += [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in OTHERS]
    return LaunchDescription([*said, OpaqueFunction(function=bridge)])
