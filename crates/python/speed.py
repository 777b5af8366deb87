"""Time per sample from Python, compared with the same algorithm in Rust on the same samples, in the same run.

    crates/python/test.sh --release --collect-only >/dev/null      # builds the module in release
    PYTHONPATH=target/python-module target/python/bin/python crates/python/speed.py
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import stylet

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = ("time_s", "position_m", "velocity_mps", "force_n")


def fastest(repeats, one):
    """Seconds of the fastest of many repetitions, which other programs disturb least."""
    best = np.inf
    for _ in range(repeats):
        core = stylet.Enhancer()
        start = time.perf_counter()
        one(core)
        best = min(best, time.perf_counter() - start)
    return best


def main():
    arrays = stylet.simulate(ROOT / "scenarios" / "three_layer_latex_constant.ron").arrays()
    columns = {c: np.ascontiguousarray(arrays[c]) for c in COLUMNS}
    n = len(columns["time_s"])
    with tempfile.NamedTemporaryFile(suffix=".bin") as file:
        np.column_stack([columns[c] for c in COLUMNS]).astype("<f8").tofile(file.name)
        command = ["cargo", "run", "--quiet", "--release", "-p", "stylet-core", "--example", "speed", "--", file.name]
        output = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    rust = {"step": float(output[1]), "run": float(output[3])}
    rows = list(zip(*(columns[c].tolist() for c in COLUMNS)))

    def steps(core):
        step = core.step
        for t, z, v, f in rows:
            step(time_s=t, position_m=z, velocity_mps=v, force_n=f)

    def brief(core):
        enhanced = core.enhanced
        for t, z, v, f in rows:
            enhanced(time_s=t, position_m=z, velocity_mps=v, force_n=f)

    run = 1e9 * fastest(100, lambda core: core.run(**columns)) / n
    step, enhanced = (1e9 * fastest(20, one) / n for one in (steps, brief))
    print(f"{n} samples; Python {sys.version.split()[0]}")
    print(f"run(arrays)   {run:6.0f} ns a sample, in Rust {rust['run']:.0f}: ratio {run / rust['run']:.2f}")
    print(f"step(...)     {step:6.0f} ns a sample, in Rust {rust['step']:.0f}")
    print(f"enhanced(...) {enhanced:6.0f} ns a sample")


if __name__ == "__main__":
    main()
