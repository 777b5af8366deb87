#!/usr/bin/env python3
"""Hashes every number that the commands write, ignoring names: the same before and after a renaming.

usage: tests/number_hashes.py STYLET [SCENARIOS]      prints one line per command: hash, how many numbers, command

Numbers of JSON and CSV files are collected and sorted, so that neither the spelling nor the order of keys matters; times of day and
hashes over text are left out. Run it with the binary before and the binary after, and compare the output.
"""
import csv, hashlib, json, os, subprocess, sys, tempfile

stylet = os.path.abspath(sys.argv[1])
scenarios = os.path.abspath(sys.argv[2] if len(sys.argv) > 2 else os.path.join(os.path.dirname(__file__), "..", "scenarios"))
PHANTOM = """Scenario(
    name: "two gels",
    tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
        (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0),
    ]),
    EFFECTS
    motion: Program(start_m: -0.005, segments: [
        Move(velocity_mps: 0.002, duration_s: 15.0), Hold(duration_s: 3.0),
        Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 15.0),
        Move(velocity_mps: -0.004, duration_s: 5.0),
    ]),
    sensor: ForceTorque(noise_n: 0.01, ar1: 0.5),
)
"""
EFFECTS = {
    "assumed": "",
    "coulomb": "effects: [CoulombFriction(c_n_per_m: 6.0)],",
    "relaxation": "effects: [StressRelaxation(terms: [(fraction: 0.3, time_constant_s: 2.7)])],",
}
SWEEP = """Sweep(scenario: "assumed.ron", trials: 64, vary: [(path: "sensor.noise_n", with: LogUniform(0.005, 0.1))])"""


def numbers_of(value):
    if isinstance(value, bool) or value is None:
        return
    if isinstance(value, (int, float)):
        yield repr(float(value))
    elif isinstance(value, list):
        for v in value:
            yield from numbers_of(v)
    elif isinstance(value, dict):
        for v in value.values():
            yield from numbers_of(v)


def numbers_in(path):
    if path.endswith(".json"):
        with open(path) as f:
            yield from numbers_of(json.load(f))
    elif path.endswith(".csv"):
        with open(path, newline="") as f:
            for row in csv.reader(f):
                for cell in row:
                    try:
                        yield repr(float(cell))
                    except ValueError:
                        pass


def report(name, folder):
    found = []
    for base, _, files in sorted(os.walk(folder)):
        for f in sorted(files):
            if f != "manifest.json":  # sizes and check sums of the other files, names included
                found += numbers_in(os.path.join(base, f))
    print(hashlib.sha256("\n".join(sorted(found)).encode()).hexdigest()[:16], f"{len(found):8}", name, flush=True)


with tempfile.TemporaryDirectory() as work:
    os.chdir(work)
    for name, effects in EFFECTS.items():
        with open(f"{name}.ron", "w") as f:
            f.write(PHANTOM.replace("EFFECTS", effects))
    with open("sweep.ron", "w") as f:
        f.write(SWEEP)

    def ask(name, *arguments):
        done = subprocess.run([stylet, *arguments, "--out", name, "--quiet"], capture_output=True, text=True)
        if done.returncode not in (0, 1):
            print("failed:", name, done.stderr.strip()[:400], flush=True)
        report(" ".join([arguments[0], name]), name)

    for s in ("three_layer_latex_constant", "three_layer_latex_sinusoidal", "isinglass_50_sinusoidal", "bovine_liver_constant"):
        ask(f"run-{s}", "run", os.path.join(scenarios, s + ".ron"))
    for s in ("06_sinusoid_coloured", "09_soft_boundary", "14_gaps", "12_ripple"):
        ask(f"run-{s}", "run", os.path.join(scenarios, "compare", s + ".ron"))
    for name in EFFECTS:
        for seed in ("1", "2"):
            ask(f"made-{name}-{seed}", "run", f"{name}.ron", "--seed", seed)
    ask("enhanced", "enhance", "made-coulomb-1/recording.csv")
    ask("sweep", "sweep", "sweep.ron")
    ask("compare", "compare", os.path.join(scenarios, "compare", "09_soft_boundary.ron"), "--algorithms", "Paper,Stylet", "--seeds", "20")
    for name in EFFECTS:
        ask(f"diagnosis-{name}", "diagnose", "assumed.ron", "--data", f"made-{name}-1/recording.csv", f"made-{name}-2/recording.csv")
    ask("prediction", "predict", "diagnosis-coulomb/extended.ron", "--data", "made-coulomb-1/recording.csv")
    ask("identifiability", "identifiability", "assumed.ron")
