"""The node, with its topics remapped: ros2 launch stylet_ros stylet.launch.py wrench:=/ft/wrench tip:=/needle/tip axis:=z"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    arguments = {"wrench": "wrench", "tip": "tip", "axis": "z"}
    given = {name: LaunchConfiguration(name) for name in arguments}
    node = Node(package="stylet_ros", executable="stylet_node", output="screen", parameters=[{"axis": given["axis"]}],
                remappings=[("wrench", given["wrench"]), ("tip", given["tip"])])
    return LaunchDescription([DeclareLaunchArgument(name, default_value=value) for name, value in arguments.items()] + [node])
