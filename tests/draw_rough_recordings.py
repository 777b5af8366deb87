#!/usr/bin/env python3
"""Draws thirty recordings of two gels with a faulty zero or as instruments write them, for tests/rough_recordings.py.

usage: draw_rough_recordings.py STYLET FOLDER SEED      (needs numpy; scipy, h5py, pyarrow and openpyxl for their formats)

Sizes, signs and times of the disturbances, and encoding, delimiter, decimal sign, preamble, units and names of the files are random.
"""
import pathlib
import subprocess
import sys

import numpy as np

STYLET, FOLDER, SEED = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]), int(sys.argv[3])
PHANTOM = """Scenario(
    name: "two gels",
    tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
        (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0),
    ]),
    motion: Program(start_m: -0.01, segments: [
        Move(velocity_mps: 0.002, duration_s: 15.0), Hold(duration_s: 3.0),
        Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 15.0),
        Move(velocity_mps: -0.004, duration_s: 5.0),
    ]),
    sensor: ForceTorque(noise_n: 0.02, ar1: 0.5),
)
"""
# Contact is at 5 s, the first rupture at 13 s.
TIME = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
LENGTH = {"m": 1.0, "mm": 1e3, "um": 1e6}
FORCE = {"N": 1.0, "mN": 1e3, "kN": 1e-3}
NAMES = [("Time", "Position", "Force"), ("Zeit", "Weg", "Kraft"), ("Temps", "Déplacement", "Force"), ("t", "Extension", "Load")]


def insertion(rng):
    """Time (s), position (m) and force (N) of an insertion with its own noise."""
    out = FOLDER / "run"
    run = [STYLET, "run", FOLDER / "phantom.ron", "--seed", str(rng.integers(1, 10**6)), "-q", "--out", out]
    subprocess.run(run, check=True)
    table = np.genfromtxt(out / "recording.csv", delimiter=",", names=True)
    for file in out.iterdir():
        file.unlink()
    out.rmdir()
    return table["time_s"], table["position_m"], table["force_n"]


def write(name, t, x, f):
    np.savetxt(FOLDER / f"{name}.csv", np.c_[t, x, f], delimiter=",", header="time_s,position_m,force_n", comments="", fmt="%.9g")


def signed(rng, low, high):
    return round(float(rng.choice([-1, 1]) * rng.uniform(low, high)), 2)


def faulty_zeros(rng):
    """Seventeen recordings with a disturbance of the sensor's zero, and one cyclic motion."""
    for _ in range(4):
        t, x, f = insertion(rng)
        step = signed(rng, 0.2, 5)
        write(f"air_step_{step}".replace("-", "m"), t, x, f + np.where(t < rng.uniform(0.5, 4), step, 0))
    for _ in range(2):
        t, x, f = insertion(rng)
        step = signed(rng, 0.2, 2)
        write(f"tissue_step_{step}", t, x, f + np.where(t < rng.uniform(7, 11), step, 0))
    for _ in range(3):
        t, x, f = insertion(rng)
        rate = signed(rng, 4, 30)
        write(f"drift_{rate}_mn_per_s", t, x, f + 1e-3 * rate * t)
    for _ in range(3):
        t, x, f = insertion(rng)
        stiffness = abs(signed(rng, 5, 20))
        write(f"tilt_{stiffness}_n_per_m", t, x, f + stiffness * (x - x[0]))
    for _ in range(2):
        t, x, f = insertion(rng)
        bias = signed(rng, 1, 45)
        write(f"bias_{bias}", t, x, f + bias)
    t, x, f = insertion(rng)
    kept = t >= rng.uniform(5.8, 9)
    write("begins_loaded", t[kept] - t[kept][0], x[kept], f[kept])
    t, x, f = insertion(rng)
    jumps = np.repeat(rng.choice([-1.0, 1.0], 40), rng.integers(200, 900, 40))[: len(t)]
    write("zero_jumps", t, x, f + rng.uniform(0.08, 0.2) * jumps)
    period_s, depth_m = rng.uniform(2, 16), rng.uniform(0.003, 0.008)
    t = np.arange(0, 4 * period_s, 0.005)
    x = depth_m * (1 - np.abs((2 * t / period_s) % 2 - 1))
    slip, friction = 0.0, np.zeros_like(x)
    for k in range(1, len(x)):
        d = x[k] - x[k - 1]
        slip = np.clip(slip + d / 4e-4 * (1 - slip * np.sign(d)), -1, 1)
        friction[k] = 0.25 * slip
    write("cyclic_hysteresis", t, x, 120 * x + friction + rng.normal(0, 0.01, len(x)))


def text_file(rng, k):
    """One table of text: encoding, delimiter, decimal sign, preamble and units row are random."""
    t, x, f = insertion(rng)
    time, length, force = (rng.choice(list(units)) for units in (TIME, LENGTH, FORCE))
    names = NAMES[rng.integers(len(NAMES))]
    comma = bool(rng.integers(2))
    delimiter = str(rng.choice([";", "\t"] if comma else [",", ";", "\t", "|"]))
    units_row = bool(rng.integers(2))
    number = lambda v, digits: f"{v:.{digits}f}".replace(".", "," if comma else ".")
    lines = [f"# instrument {k}", ""] if rng.integers(2) else []
    if units_row:
        lines += [delimiter.join(names), delimiter.join(f"({u})" for u in (time, length, force))]
    else:
        lines += [delimiter.join(f"{n} [{u}]" for n, u in zip(names, (time, length, force)))]
    for row in zip(t * TIME[time], x * LENGTH[length], f * FORCE[force]):
        lines.append(delimiter.join(number(v, d) for v, d in zip(row, (6, 7, 8))))
    encoding = str(rng.choice(["utf-8", "utf-8-sig", "utf-16", "cp1252"]))
    end = str(rng.choice(["\n", "\r\n"]))
    (FOLDER / f"text_{k}.{rng.choice(['csv', 'txt', 'dat'])}").write_bytes((end.join(lines) + end).encode(encoding))


def binary_files(rng):
    """A file of each library that is installed."""
    t, x, f = insertion(rng)
    try:
        import scipy.io

        scipy.io.savemat(FOLDER / "matlab.mat", {"time_ms": t * 1e3, "position_mm": x * 1e3, "force_n": f}, do_compression=bool(rng.integers(2)))
    except ImportError:
        print("no scipy: no MATLAB file")
    try:
        import h5py

        with h5py.File(FOLDER / "groups.h5", "w") as h:
            for name, column in (("time_s", t), ("position_mm", x * 1e3), ("force_n", f)):
                h.create_dataset(f"run/{name}", data=column, compression="gzip" if rng.integers(2) else None)
    except ImportError:
        print("no h5py: no HDF5 file")
    try:
        import pyarrow
        import pyarrow.parquet

        table = pyarrow.table({"stamp": pyarrow.array((t * 1e6).astype("int64"), pyarrow.timestamp("us")), "position_mm": x * 1e3, "force_mn": f * 1e3})
        pyarrow.parquet.write_table(table, FOLDER / "columns.parquet", compression=str(rng.choice(["snappy", "gzip", "zstd", "none"])))
    except ImportError:
        print("no pyarrow: no Parquet file")
    try:
        import openpyxl

        book = openpyxl.Workbook()
        sheet = book.active
        for row in (["Specimen", int(rng.integers(1, 99))], [], ["Time", "Extension", "Load"], ["s", "mm", "N"]):
            sheet.append(row)
        for row in zip(t[::4], x[::4] * 1e3, f[::4]):
            sheet.append([float(v) for v in row])
        book.save(FOLDER / "machine.xlsx")
    except ImportError:
        print("no openpyxl: no spreadsheet")


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    (FOLDER / "phantom.ron").write_text(PHANTOM)
    rng = np.random.default_rng(SEED)
    faulty_zeros(rng)
    for k in range(8):
        text_file(rng, k)
    binary_files(rng)


if __name__ == "__main__":
    main()
