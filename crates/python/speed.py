"""What a sample costs from Python, beside the same core in Rust over the same samples, in the same run.

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


def least(repeats, one):
    """Seconds of the quickest of many: what other programs do not disturb."""
    best = np.inf
    for _ in range(repeats):
        core = stylet.Enhancer()
        begun = time.perf_counter()
        one(core)
        best = min(best, time.perf_counter() - begun)
    return best


def main():
    arrays = stylet.simulate(ROOT / "scenarios" / "three_layer_latex_constant.ron").arrays()
    columns = {c: np.ascontiguousarray(arrays[c]) for c in COLUMNS}
    n = len(columns["time_s"])
    with tempfile.NamedTemporaryFile(suffix=".bin") as file:
        np.column_stack([columns[c] for c in COLUMNS]).astype("<f8").tofile(file.name)
        command = ["cargo", "run", "--quiet", "--release", "-p", "stylet-core", "--example", "speed", "--", file.name]
        said = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    rust = {"step": float(said[1]), "run": float(said[3])}
    rows = list(zip(*(columns[c].tolist() for c in COLUMNS)))

    def steps(core):
        step = core.step
        for t, z, v, f in rows:
            step(t, z, v, f)

    def brief(core):
        enhanced = core.enhanced
        for t, z, v, f in rows:
            enhanced(t, z, v, f)

    run = 1e9 * least(100, lambda core: core.run(**columns)) / n
    step, enhanced = (1e9 * least(20, one) / n for one in (steps, brief))
    print(f"{n} samples; Python {sys.version.split()[0]}")
    print(f"run(arrays)   {run:6.0f} ns a sample, in Rust {rust['run']:.0f}: ratio {run / rust['run']:.2f}")
    print(f"step(...)     {step:6.0f} ns a sample, in Rust {rust['step']:.0f}")
    print(f"enhanced(...) {enhanced:6.0f} ns a sample")


if __name__ == "__main__":
    main()
