"""Replay test: each sample of test/replay.csv is published to the node, whose `enhanced` must be exactly the column enhanced_n of that
file, which the command made. With STYLET_REPLAY_BYTES the received values are also written to that file."""

import csv
import os
import struct
import sys
import time
import unittest
from pathlib import Path

import launch
import launch_ros.actions
import launch_testing.actions
import rclpy
from geometry_msgs.msg import TwistStamped, WrenchStamped
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64, UInt32

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "scripts"))
from replay_recording import messages, read_samples  # noqa: E402


def generate_test_description():
    node = launch_ros.actions.Node(package="stylet_ros", executable="stylet_node", parameters=[{"pair_by_stamp": True}])
    return launch.LaunchDescription([node, launch_testing.actions.ReadyToTest()])


class TestReplay(unittest.TestCase):
    def test_the_enhanced_force_is_that_of_the_command(self):
        rclpy.init()
        node = rclpy.create_node("test_replay")
        enhanced, ruptures = [], []
        node.create_subscription(Float64, "enhanced", lambda m: enhanced.append(m.data), 10)
        node.create_subscription(UInt32, "ruptures", lambda m: ruptures.append(m.data), 10)
        tips = node.create_publisher(TwistStamped, "tip", qos_profile_sensor_data)
        wrenches = node.create_publisher(WrenchStamped, "wrench", qos_profile_sensor_data)
        self.wait(node, lambda: tips.get_subscription_count() and wrenches.get_subscription_count())
        for k, sample in enumerate(read_samples(HERE / "replay.csv")):
            tip, wrench = messages(sample)
            tips.publish(tip)
            wrenches.publish(wrench)
            self.wait(node, lambda: len(enhanced) > k)
        with open(HERE / "replay.csv", newline="") as file:
            expected = [float(row["enhanced_n"]) for row in csv.DictReader(file)]
        if "STYLET_REPLAY_BYTES" in os.environ:
            Path(os.environ["STYLET_REPLAY_BYTES"]).write_bytes(struct.pack(f"<{len(enhanced)}d", *enhanced))
        self.assertEqual(enhanced, expected)
        self.assertEqual(ruptures, [1, 2, 3])
        node.destroy_node()
        rclpy.shutdown()

    def wait(self, node, done, timeout_s=20.0):
        until = time.monotonic() + timeout_s
        while not done():
            self.assertLess(time.monotonic(), until, "the node does not answer")
            rclpy.spin_once(node, timeout_sec=0.1)
