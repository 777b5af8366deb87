#!/usr/bin/env python3
"""Publishes a recording (CSV with time_s, position_m, velocity_mps, force_n) as `tip` and `wrench` (force along z), in its own time."""

import csv
import time


def read_samples(path):
    """Samples (stamp_ns, position_m, velocity_mps, force_n), stamps from 0."""
    with open(path, newline="") as file:
        rows = csv.DictReader(file)
        missing = {"time_s", "position_m", "velocity_mps", "force_n"} - set(rows.fieldnames or ())
        if missing:
            raise ValueError(f"{path}: no column {', '.join(sorted(missing))}; `stylet convert` writes such a table")
        return [(round(float(r["time_s"]) * 1e9), float(r["position_m"]), float(r["velocity_mps"]), float(r["force_n"])) for r in rows]


def messages(sample):
    """The messages `tip` and `wrench` of a sample."""
    from geometry_msgs.msg import TwistStamped, WrenchStamped

    stamp_ns, position_m, velocity_mps, force_n = sample
    tip, wrench = TwistStamped(), WrenchStamped()
    for message in (tip, wrench):
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    tip.twist.linear.x, tip.twist.linear.y = position_m, velocity_mps
    wrench.wrench.force.z = force_n
    return tip, wrench


def main():
    import rclpy
    from geometry_msgs.msg import TwistStamped, WrenchStamped
    from rclpy.qos import qos_profile_sensor_data

    rclpy.init()
    node = rclpy.create_node("replay_recording")
    samples = read_samples(node.declare_parameter("recording", "recording.csv").value)
    tips = node.create_publisher(TwistStamped, "tip", qos_profile_sensor_data)
    wrenches = node.create_publisher(WrenchStamped, "wrench", qos_profile_sensor_data)
    began = time.monotonic()
    for sample in samples:
        time.sleep(max(0.0, began + (sample[0] - samples[0][0]) / 1e9 - time.monotonic()))
        tip, wrench = messages(sample)
        tips.publish(tip)
        wrenches.publish(wrench)
    node.get_logger().info(f"{len(samples)} samples published")
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
