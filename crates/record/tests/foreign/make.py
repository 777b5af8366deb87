"""Writes the files next to it with other programs' libraries: h5py, pyarrow, the Python packages mcap and mcap-ros2-support.

    pip install h5py numpy pyarrow mcap mcap-ros2-support
    python3 make.py

All hold the same insertion: 60 samples at 100 Hz, position 1 mm + 4 mm/s, force 0.5 N + 2 N/s (in the units each says).
"""

import json
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from mcap.writer import CompressionType, Writer
from mcap_ros2.writer import Writer as Ros2Writer

here = Path(__file__).parent
t = np.arange(60) / 100.0
z = 1e-3 + 4e-3 * t
f = 0.5 + 2.0 * t


def matlab(path):
    """As MATLAB's save -v7.3 lays it out: a user block, vectors as 1 x n in HDF5's order, a struct as a group."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in [("time", t * 1e3), ("pz", z * 1e3)]:
            d = file.create_dataset(name, data=values[np.newaxis, :])
            d.attrs["MATLAB_class"] = np.bytes_("double")
        log = file.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        wrench = np.zeros((6, len(t)), dtype=np.float32)
        wrench[2] = -f
        d = log.create_dataset("wrench", data=wrench, compression="gzip", chunks=(6, 20))
        d.attrs["MATLAB_class"] = np.bytes_("single")
        text = file.create_dataset("note", data=np.array([[ord(c)] for c in "gel"], dtype=np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + b" " * 8 + b"\x00\x02IM")


def parquet(path):
    table = pa.table({"time_s": t, "position_m": z, "force_n": f.astype(np.float32), "label": ["gel"] * len(t)})
    pq.write_table(table, path, compression="zstd")


def mcap_json(path):
    with open(path, "wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b'{"type": "object"}')
        force = writer.register_channel("/ft.sensor", "json", schema)
        pose = writer.register_channel("/pose", "json", schema)
        start = 1_700_000_000_000_000_000
        # Poses come at 25 Hz and lie on the same line; the topic of the force decides the rows.
        for k in range(60):
            at = start + k * 10_000_000
            if k % 4 == 0:
                body = {"position": {"z": z[k] * 1e3}, "frame": "base"}
                writer.add_message(pose, at, json.dumps(body).encode(), at)
            writer.add_message(force, at, json.dumps({"f": [0.0, 0.0, f[k]]}).encode(), at)
        writer.finish()


STAMPED = """std_msgs/Header header
geometry_msgs/Wrench wrench
float64 position
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Wrench
Vector3 force
Vector3 torque
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def mcap_ros(path):
    with open(path, "wb") as file:
        writer = Ros2Writer(file)
        schema = writer.register_msgdef("lab_msgs/msg/Insertion", STAMPED)
        for k in range(60):
            nothing = {"x": 0.0, "y": 0.0, "z": 0.0}
            message = {
                "header": {"stamp": {"sec": 12, "nanosec": k * 10_000_000}, "frame_id": "tool"},
                "wrench": {"force": {"x": 0.0, "y": 0.0, "z": f[k]}, "torque": nothing},
                "position": z[k],
            }
            at = 12_000_000_000 + k * 10_000_000
            writer.write_message(topic="/insertion", schema=schema, message=message, log_time=at, publish_time=at)
        writer.finish()


matlab(here / "matlab.mat")
parquet(here / "table.parquet")
mcap_json(here / "json.mcap")
mcap_ros(here / "ros2.mcap")
