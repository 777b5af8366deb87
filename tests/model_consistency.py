#!/usr/bin/env python3
"""How often `stylet compare-models` is right: sessions of one phantom, and of one with a parameter changed by three standard deviations.

usage: model_consistency.py STYLET_BINARY [--cases N] [--seed S]

Each case draws a phantom of two layers and assumed numbers within their tolerance, records three sessions of two insertions (other noise), and
diagnoses each. The first two have one truth; in the third, stiffness or friction of one layer is changed by three times the standard
deviation that the first comparison states for its difference.
"""
import argparse
import json
import math
import pathlib
import random
import subprocess
import tempfile

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("stylet")
parser.add_argument("--cases", type=int, default=60)
parser.add_argument("--seed", type=int, default=1)
args = parser.parse_args()
rng = random.Random(args.seed)

MOTIONS = [
    "Move(velocity_mps: 0.002, duration_s: 15.0), Hold(duration_s: 3.0), Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, "
    "duration_s: 8.0), Move(velocity_mps: -0.004, duration_s: 5.0)",
    "Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.3, duration_s: 18.0), Move(velocity_mps: -0.003, duration_s: 5.0)",
]


def scenario(layers, motion):
    def layer(l):
        puncture = f", puncture_n: {l['puncture_n']!r}" if l["puncture_n"] else ""
        return f"(thickness_m: {l['thickness_m']!r}, stiffness_n_per_m: {l['stiffness_n_per_m']!r}, friction_ns_per_m2: {l['friction_ns_per_m2']!r}{puncture})"

    return (f"Scenario(name: \"session\", tissue: (layers: [{', '.join(map(layer, layers))}]), motion: Program(start_m: -0.005, segments: [{motion}]), "
            "sensor: ForceTorque(noise_n: 0.01, ar1: 0.5))")


def rate(hits, of):
    p, z = hits / of, 1.96
    centre, half = p + z * z / (2 * of), z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    return f"{hits}/{of} = {100 * p:.0f} % ({100 * (centre - half) / (1 + z * z / of):.0f} to {100 * (centre + half) / (1 + z * z / of):.0f})"


with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)

    def call(*arguments):
        subprocess.run([args.stylet, *arguments, "-q"], check=True)

    def session(name, truth, seed):
        data = []
        for k, motion in enumerate(MOTIONS):
            (folder / "real.ron").write_text(scenario(truth, motion))
            data.append(folder / f"{name}{k}" / "recording.csv")
            call("run", folder / "real.ron", "--seed", str(seed + k), "--out", folder / f"{name}{k}")
        call("diagnose", folder / "assumed.ron", "--data", *data, "--out", folder / name)
        return folder / name

    def compared(a, b):
        call("compare-models", a, b, "--out", folder / "compared")
        return json.loads((folder / "compared" / "consistency.json").read_text())

    same, found, named = 0, 0, 0
    for case in range(args.cases):
        draw = lambda puncture: {"thickness_m": rng.uniform(0.015, 0.022), "stiffness_n_per_m": rng.uniform(40, 120),
                                 "friction_ns_per_m2": rng.uniform(5e3, 2e4), "puncture_n": puncture}
        truth = [draw(None), draw(None)]
        truth[0]["puncture_n"] = 0.8 * truth[0]["stiffness_n_per_m"] * truth[0]["thickness_m"]
        off = lambda name, x: x and x * (1 + rng.uniform(-1, 1) * (0.05 if name == "thickness_m" else 0.2))
        (folder / "assumed.ron").write_text(scenario([{n: off(n, x) for n, x in l.items()} for l in truth], MOTIONS[0]))
        first = session("first", truth, 1000 * case)
        comparison = compared(first, session("second", truth, 1000 * case + 10))
        same += comparison["is_consistent"]
        sd = {p["parameter"]: p["sd"] for p in comparison["parameters"]}
        layer, name = rng.randrange(2), rng.choice(["stiffness_n_per_m", "friction_ns_per_m2"])
        changed = [dict(l) for l in truth]
        changed[layer][name] += rng.choice([-3, 3]) * sd[f"{name} of layer {layer + 1}"]
        comparison = compared(first, session("third", changed, 1000 * case + 20))
        found += not comparison["is_consistent"]
        named += any(p["differs"] and p["parameter"] == f"{name} of layer {layer + 1}" for p in comparison["parameters"])

print(f"one truth: consistent                          {rate(same, args.cases)}")
print(f"one parameter changed by 3 sd: found           {rate(found, args.cases)}")
print(f"                               and named       {rate(named, args.cases)}")
