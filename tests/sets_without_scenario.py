#!/usr/bin/env python3
"""Real sets of repeated insertions, diagnosed with the shipped data set and without any scenario.

    STYLET_MEASURED=folder tests/sets_without_scenario.py STYLET OUT [SET ...]

Sets: skin, muscle, stack (three speeds). Per set the error (N) on recordings that are predicted from the others, with the shipped
data set and with the layers that `stylet diagnose --repeats` finds in the recordings alone, and their ratio (bar: 1.03). The air
and load files of the data sets are not given to the second. Results stay in OUT and are used again. Some twenty minutes.
"""

import glob
import json
import os
import subprocess
import sys

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
SETS = {
    "skin": ("skin", "skin_2mmps_*.csv"),
    "muscle": ("muscle", "muscle_2mmps_*.csv"),
    "stack": ("skin_on_muscle", "skin-on-muscle_*.csv"),
}
MAP = 'Columns(time: (name: "time", scale: 1e-6), position: (name: "pz", scale: 1e-3), force: (name: "fz"))\n'


def diagnosed(stylet, folder, arguments):
    """Error (N) and number of layers of a diagnosis, which is made if it is not there."""
    if not os.path.exists(os.path.join(folder, "diagnosis.json")):
        done = subprocess.run([stylet, "diagnose", *arguments, "--out", folder, "--quiet"], capture_output=True, text=True)
        if done.returncode:
            sys.exit(done.stderr)
    with open(os.path.join(folder, "diagnosis.json")) as file:
        found = json.load(file)
    layers = {b["layer"] for b in found["base_parameters"] if b["layer"] > 0}
    return found["repeats"]["mean"]["model_n"], len(layers)


def main():
    measured = os.environ.get("STYLET_MEASURED", "")
    if len(sys.argv) < 3 or not measured:
        sys.exit(__doc__)
    stylet, out, names = os.path.abspath(sys.argv[1]), sys.argv[2], sys.argv[3:] or list(SETS)
    os.makedirs(out, exist_ok=True)
    columns = os.path.join(out, "map.ron")
    with open(columns, "w") as file:
        file.write(MAP)
    missed = 0
    for name in names:
        data_set, pattern = SETS[name]
        files = sorted(glob.glob(os.path.join(measured, "needle_phantom", pattern)))
        shipped = os.path.join(ROOT, "scenarios", "measured", data_set + ".ron")
        with_n, of = diagnosed(stylet, os.path.join(out, name + "-shipped"), [shipped])
        alone = ["--repeats", "--data", *files, "--columns", columns]
        without_n, found = diagnosed(stylet, os.path.join(out, name + "-alone"), alone)
        ratio = without_n / with_n
        missed += ratio > 1.03
        print(f"{name:8} shipped {with_n:.3f} N ({of} layers), without a scenario {without_n:.3f} N ({found} layers), ratio {ratio:.3f}", flush=True)
    sys.exit(1 if missed else 0)


main()
