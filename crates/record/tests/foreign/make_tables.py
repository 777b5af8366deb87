"""Writes the tables, workspaces and bags next to it with other programs' libraries.

    pip install h5py numpy pandas pyarrow scipy openpyxl odfpy xlwt rosbags
    python3 make_tables.py

All hold the insertion of make.py: 60 samples at 100 Hz, position 1 mm + 4 mm/s, force 0.5 N + 2 N/s.
"""

from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
import xlwt
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

here = Path(__file__).parent
t = np.arange(60) / 100.0
z = 1e-3 + 4e-3 * t
f = 0.5 + 2.0 * t
table = pd.DataFrame({"Time": t, "Extension": z * 1e3, "Load": f})
begin = 1_767_261_600_000_000_000


def rows(write):
    """A sheet as a testing machine exports it: a title, names, units, values."""
    write(0, ["Specimen 3"])
    write(1, ["Time", "Extension", "Load"])
    write(2, ["s", "mm", "N"])
    for k, row in enumerate(table.itertuples(index=False)):
        write(3 + k, [float(v) for v in row])


with pd.ExcelWriter(here / "machine.xlsx") as book:
    pd.DataFrame([["notes"]]).to_excel(book, sheet_name="Notes", header=False, index=False)
    sheet = book.book.create_sheet("Data")
    rows(lambda _, row: sheet.append(row))

text = pd.concat([pd.DataFrame([["s", "mm", "N"]], columns=table.columns), table.astype(object)])
with pd.ExcelWriter(here / "machine.ods", engine="odf") as book:
    text.to_excel(book, sheet_name="Data", index=False)

book = xlwt.Workbook()
sheet = book.add_sheet("Data")
rows(lambda at, row: [sheet.write(at, k, v) for k, v in enumerate(row)])
book.save(str(here / "machine.xls"))

# pandas: an index column, empty fields for missing values.
holes = pd.DataFrame({"time_s": t, "position_m": z, "force_n": f})
holes.to_csv(here / "pandas.csv")
np.savetxt(here / "savetxt.txt", np.c_[t, z, f], header="time_s position_m force_n")

scipy.io.savemat(here / "scipy_v5.mat", {"log": {"t": t, "pz": z * 1e3, "wrench": np.c_[f * 0, f * 0, -f]}, "note": "gel"}, do_compression=True)
scipy.io.savemat(here / "scipy_v5_plain.mat", {"time_s": t, "position_m": z, "force_n": f})

with h5py.File(here / "matrices.h5", "w") as file:
    file["t"] = t
    file["t"].attrs["unit"] = "s"
    file["wrench"] = np.c_[f * 0, f * 0, f]
    file["tip"] = np.c_[z * 0, z * 0.6, z * 0.8]

stamps = pa.array((begin + np.round(t * 1e9)).astype("int64"), pa.timestamp("ns"))
columns = {"stamp": stamps, "position_m": z, "force_n": f}
pq.write_table(pa.table(columns), here / "timestamp.parquet")
pq.write_table(pa.table(columns), here / "timestamp96.parquet", use_deprecated_int96_timestamps=True)

# A ROS 2 bag with wrench and pose on topics of their own, the pose 5 ms earlier and at half the rate.
store = get_typestore(Stores.ROS2_HUMBLE)
kinds = store.types
header = kinds["std_msgs/msg/Header"]
time = kinds["builtin_interfaces/msg/Time"]
vector = kinds["geometry_msgs/msg/Vector3"]
bag = here / "bag"


def stamp(s):
    ns = begin + round(s * 1e9)
    return ns, header(time(ns // 10**9, ns % 10**9), "tool0")


with Writer(bag, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
    wrench = writer.add_connection("/ft/wrench", "geometry_msgs/msg/WrenchStamped", typestore=store)
    pose = writer.add_connection("/tip", "geometry_msgs/msg/PoseStamped", typestore=store)
    messages = []
    for k in range(60):
        ns, h = stamp(t[k])
        values = kinds["geometry_msgs/msg/Wrench"](vector(0.0, 0.0, float(f[k])), vector(0.0, 0.0, 0.0))
        messages.append((ns, wrench, kinds["geometry_msgs/msg/WrenchStamped"](h, values)))
    for k in range(-1, 61, 2):
        s = k / 100.0 + 0.005
        ns, h = stamp(s)
        at = kinds["geometry_msgs/msg/Pose"](kinds["geometry_msgs/msg/Point"](0.0, 0.0, 1e-3 + 4e-3 * s), kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0))
        messages.append((ns, pose, kinds["geometry_msgs/msg/PoseStamped"](h, at)))
    for ns, connection, message in sorted(messages, key=lambda m: m[0]):
        writer.write(connection, ns, store.serialize_cdr(message, message.__msgtype__))
(here / "bag" / "bag.db3").rename(here / "bag.db3")
for left in (here / "bag").iterdir():
    left.unlink()
(here / "bag").rmdir()

# Text as `ros2 topic echo --csv` and `rostopic echo -p` print it.
with open(here / "ros2_echo.csv", "w") as out:
    for k in range(60):
        ns, _ = stamp(t[k])
        out.write(f"{ns // 10**9},{ns % 10**9},tool0,0.0,0.0,{f[k]!r},0.0,0.0,0.0\n".replace("np.float64(", "").replace(")", ""))
with open(here / "rostopic_echo.txt", "w") as out:
    names = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    out.write(",".join(names + [f"field.wrench.force.{a}" for a in "xyz"]) + "\n")
    for k in range(60):
        ns, _ = stamp(t[k])
        out.write(f"{ns},{k},{ns},tool0,0.0,0.0,{float(f[k])!r}\n")
with open(here / "pose.csv", "w") as out:
    out.write("stamp_ns,z_mm\n")
    for k in range(-1, 62):
        ns, _ = stamp(k / 100.0)
        out.write(f"{ns},{1e3 * (1e-3 + 4e-3 * k / 100.0)!r}\n")
