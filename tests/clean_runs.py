#!/usr/bin/env python3
"""Counts how many sets of clean recordings of `stylet run` are diagnosed as clean.

usage: tests/clean_runs.py STYLET [--sets N] [--seed S]

Each set is one drawn phantom with two recordings, diagnosed with the scenario that made them. Two rows: force noise of 1 mN at 200 Hz, and 20 mN at
1 kHz. Any cause is an error of the simulator or of the diagnosis.
"""

import argparse
import json
import math
import random
import subprocess
import tempfile
from pathlib import Path

ROWS = {"1 mN at 200 Hz": (0.001, 200.0), "20 mN at 1 kHz": (0.02, 1000.0)}


def scenario(rng, noise_n, sample_hz):
    """RON text of a drawn phantom with one to three layers."""
    layers = []
    for _ in range(rng.randint(1, 3)):
        layers.append(
            f"(thickness_m: {rng.uniform(0.012, 0.03):.4f}, stiffness_n_per_m: {rng.uniform(30, 100):.1f}, "
            f"friction_ns_per_m2: {rng.uniform(5e3, 15e3):.0f}, puncture_n: {rng.uniform(0.5, 1.2):.2f})"
        )
    speed = rng.uniform(0.0015, 0.004)
    return f"""Scenario(
    name: "clean",
    tissue: (layers: [{", ".join(layers)}]),
    motion: Program(start_m: -0.008, segments: [
        Move(velocity_mps: {speed:.5f}, duration_s: {0.03 / speed:.3f}),
        Hold(duration_s: {rng.uniform(1, 3):.2f}),
        Ripple(velocity_mps: {speed:.5f}, amplitude_mps: {0.5 * speed:.5f}, frequency_hz: {rng.uniform(0.3, 2.0):.3f}, duration_s: {0.02 / speed:.3f}),
        Move(velocity_mps: -0.004, duration_s: 5.0),
    ]),
    sample_hz: {sample_hz},
    sensor: ForceTorque(noise_n: {noise_n}, ar1: 0.0),
)
"""


def wilson(hits, n, z=1.96):
    """95 % interval of a rate."""
    p = hits / n
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return centre - half, centre + half


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stylet", type=Path)
    parser.add_argument("--sets", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    command = str(args.stylet.resolve())
    for row, (noise_n, sample_hz) in ROWS.items():
        rng = random.Random(f"{args.seed} {row}")
        clean = 0
        for k in range(args.sets):
            with tempfile.TemporaryDirectory() as folder:
                Path(folder, "clean.ron").write_text(scenario(rng, noise_n, sample_hz))
                for seed in ("1", "2"):
                    subprocess.run(
                        [command, "run", "clean.ron", "--seed", seed, "-q", "--out", f"run{seed}"], cwd=folder, check=True
                    )
                data = ["run1/recording.csv", "run2/recording.csv"]
                subprocess.run(
                    [command, "diagnose", "clean.ron", "--data", *data, "-q", "--out", "diagnosis"],
                    cwd=folder,
                    check=True,
                    stdout=subprocess.DEVNULL,
                )
                diagnosis = json.loads(Path(folder, "diagnosis", "diagnosis.json").read_text())
            causes = [c["effect"] for c in diagnosis["causes"]]
            clean += diagnosis["verdict"] == "none" and not causes
            if diagnosis["verdict"] != "none" or causes:
                print(f"  {row}, set {k}: {diagnosis['verdict']} {' '.join(causes)}", flush=True)
        low, high = wilson(clean, args.sets)
        print(f"{row}: clean {clean} of {args.sets} ({100 * low:.0f} to {100 * high:.0f} %)", flush=True)


main()
