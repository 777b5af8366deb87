#!/usr/bin/env python3
"""Whether the labels of parameters are right: insertions at one constant speed, where the truth about what trades is known.

usage: parameter_labels.py STYLET_BINARY [--cases N] [--seed S] [--check]

Draws phantoms of two or three layers, pierced at one constant speed into the middle of the last layer, and assumed numbers within their
tolerance; diagnoses two recordings each (with --check: `stylet check` instead). In the last layer, which does not rupture, stiffness and
friction trade with one another, and its thickness is not identifiable; in the layers before, the drop at the rupture determines both.
Prints how often this is said, how often 95 % intervals of parameters with each label hold the truth, and how often they are within 10 %.
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
parser.add_argument("--cases", type=int, default=100)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--check", action="store_true")
args = parser.parse_args()


def scenario(layers, speed_mps, duration_s, noise_n):
    def layer(l):
        puncture = f", puncture_n: {l['puncture_n']:.6f}" if l["puncture_n"] else ""
        return (f"(thickness_m: {l['thickness_m']:.6f}, stiffness_n_per_m: {l['stiffness_n_per_m']:.4f}, "
                f"friction_ns_per_m2: {l['friction_ns_per_m2']:.2f}{puncture})")

    return (f"Scenario(name: \"one speed\", tissue: (layers: [{', '.join(map(layer, layers))}]), motion: Program(start_m: -0.005, segments: "
            f"[Move(velocity_mps: {speed_mps:.5f}, duration_s: {duration_s:.3f})]), sensor: ForceTorque(noise_n: {noise_n:.4f}, ar1: 0.5))")


def rate(hits, of):
    if not of:
        return "-"
    p, z = hits / of, 1.96
    centre, half = p + z * z / (2 * of), z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    return f"{hits}/{of} = {100 * p:.0f} % ({100 * (centre - half) / (1 + z * z / of):.0f} to {100 * (centre + half) / (1 + z * z / of):.0f})"


rng = random.Random(args.seed)
partner, thickness, pierced = [], [], []
by_label = {}
with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)
    for case in range(args.cases):
        truth = []
        count = rng.choice([2, 3])
        for k in range(count):
            l = {"thickness_m": rng.uniform(0.015, 0.04), "stiffness_n_per_m": rng.uniform(30, 120), "friction_ns_per_m2": rng.uniform(5e3, 2e4)}
            l["puncture_n"] = None if k == count - 1 else rng.uniform(0.6, 0.95) * l["stiffness_n_per_m"] * l["thickness_m"]
            truth.append(l)
        depth_m = sum(l["thickness_m"] for l in truth[:-1]) + 0.5 * truth[-1]["thickness_m"]
        speed_mps, noise_n = rng.uniform(0.001, 0.005), rng.uniform(0.01, 0.02)
        motion = (speed_mps, (depth_m + 0.005) / speed_mps, noise_n)
        within = lambda x, tolerance: x * (1 + rng.uniform(-tolerance, tolerance))
        assumed = [{name: x and within(x, 0.05 if name == "thickness_m" else 0.2) for name, x in l.items()} for l in truth]
        (folder / "real.ron").write_text(scenario(truth, *motion))
        (folder / "assumed.ron").write_text(scenario(assumed, *motion))
        data = []
        for k in (1, 2):
            out = folder / f"r{k}"
            subprocess.run([args.stylet, "run", folder / "real.ron", "--seed", str(100 * case + k), "-q", "--out", out], check=True)
            data.append(out / "recording.csv")
        command = "check" if args.check else "diagnose"
        subprocess.run([args.stylet, command, folder / "assumed.ron", "--data", *data, "-q", "--out", folder / "out"], check=True)
        found = json.loads((folder / "out" / ("check.json" if args.check else "diagnosis.json")).read_text())
        label = {(p["layer"], p["name"]): p for p in found["parameters"] if "effect" not in p}
        of_last = {name: label[(count, name)] for name in ("stiffness_n_per_m", "friction_ns_per_m2", "thickness_m") if (count, name) in label}
        for name, other in (("stiffness_n_per_m", "friction_ns_per_m2"), ("friction_ns_per_m2", "stiffness_n_per_m")):
            p = of_last[name]
            partner.append(p["label"] == "trades_with" and p.get("trades_with") == f"{other} of layer {count}")
        if "thickness_m" in of_last:
            thickness.append(of_last["thickness_m"]["label"] in ("not_identifiable", "one_sided"))
        for b in found["base_parameters"]:
            p = label.get((b["layer"], b["name"]))
            if b["layer"] == 0:
                true = 0.0
            else:
                true = truth[b["layer"] - 1][b["name"]]
            if p is None or true is None or b["at_least"]:
                continue
            half = 0.5 * (b["high"] - b["low"])
            by_label.setdefault(p["label"], []).append((b["low"] <= true <= b["high"], half <= 0.1 * abs(b["value"])))
            if b["layer"] and b["layer"] < count and b["name"] in ("stiffness_n_per_m", "friction_ns_per_m2"):
                pierced.append(p["label"] == "determined")

print(f"last layer: stiffness and friction trade with each other   {rate(sum(partner), len(partner))}")
print(f"last layer: thickness not identifiable, or one-sided       {rate(sum(thickness), len(thickness))}")
print(f"pierced layers: stiffness and friction determined          {rate(sum(pierced), len(pierced))}")
for name, all in sorted(by_label.items()):
    print(f"{name:<18} interval holds the truth {rate(sum(h for h, _ in all), len(all)):<30} within 10 % {rate(sum(t for _, t in all), len(all))}")
