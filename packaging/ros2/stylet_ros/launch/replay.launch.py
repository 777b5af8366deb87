"""A recording played to the node in its own time: ros2 launch stylet_ros replay.launch.py recording:=recording.csv"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument("recording", description="CSV with time_s, position_m, velocity_mps, force_n"),
        Node(package="stylet_ros", executable="stylet_node", output="screen", parameters=[{"pair_by_stamp": True}]),
        Node(package="stylet_ros", executable="replay_recording.py", output="screen", parameters=[{"recording": LaunchConfiguration("recording")}]),
    ])
