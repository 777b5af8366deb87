#!/usr/bin/env python3
"""Enhanced force in retraction with a model of another group of real insertions, against the core's own friction.

    STYLET_MEASURED=folder tests/enhance_transfers.py STYLET OUT [MODEL ...]

OUT is the folder in which tests/transfers.py has kept its models (by default all of them are used). Prints the RMS (N) of measured and
enhanced force while the needle retracts inside the tissue, more than 1 mm from its deepest position, where nothing acts on the tip, as means
over recordings, and in how many recordings the model is worse than the core alone.
"""

import csv
import glob
import math
import os
import subprocess
import sys
import tempfile

from transfers import FOLDER, GROUPS

SURFACE_M = 0.014


def enhanced(stylet, out, log, model, folder):
    """Position, measured and enhanced force of the samples that the core has used."""
    command = [stylet, "enhance", log, "--columns", os.path.join(out, "map.ron"), "-q", "--out", folder]
    subprocess.run(command + (["--model", model] if model else []), check=True, capture_output=True)
    with open(os.path.join(folder, "enhanced.csv"), newline="") as file:
        rows = [[row[name] for name in ("position_m", "force_n", "enhanced_n")] for row in csv.DictReader(file)]
    return [[float(x) for x in row] for row in rows if row[2] not in ("", "nan", "NaN")]


def retraction_rms(rows):
    deepest = max(range(len(rows)), key=lambda k: rows[k][0])
    inside = [r for r in rows[deepest:] if SURFACE_M < r[0] < rows[deepest][0] - 1e-3]
    return [math.sqrt(sum(r[k] ** 2 for r in inside) / len(inside)) for k in (1, 2)]


def main():
    stylet, out = os.path.abspath(sys.argv[1]), sys.argv[2]
    models = sys.argv[3:] or sorted(os.listdir(os.path.join(out, "laws")))
    worse = total = 0
    with tempfile.TemporaryDirectory() as folder:
        for group, (_, pattern) in GROUPS.items():
            logs = sorted(glob.glob(os.path.join(FOLDER, pattern)))
            alone = [retraction_rms(enhanced(stylet, out, log, None, folder)) for log in logs]
            for name in models:
                model = os.path.join(out, "laws", name, "extended.ron")
                with_model = [retraction_rms(enhanced(stylet, out, log, model, folder))[1] for log in logs]
                count = sum(w > a[1] for w, a in zip(with_model, alone))
                worse, total = worse + count, total + len(logs)
                mean = lambda x: sum(x) / len(x)
                print(
                    f"{name} -> {group}: measured {mean([a[0] for a in alone]):.3f}, alone {mean([a[1] for a in alone]):.3f}, "
                    f"with model {mean(with_model):.3f} N; worse in {count} of {len(logs)}"
                )
    print(f"worse in {worse} of {total}")


if __name__ == "__main__":
    main()
