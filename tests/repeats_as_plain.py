#!/usr/bin/env python3
"""Drawn repeats of one insertion, diagnosed with `--repeats` and without: the same causes?

usage: tests/repeats_as_plain.py STYLET OUT [--cases N] [--seed S] [--hide clean|one]

Each case draws a phantom of two or three layers, an insertion with a hold, a trembling advance and a retraction, and four repeats in which
surface and noise differ. With `--hide one` the simulation has an effect that the assumed scenario lacks. Prints one line per case and the
number of cases in which both diagnoses name the same effects, and in which each is right. About a minute of processor time per case.
"""

import argparse
import json
import os
import random
import subprocess
import sys

parser = argparse.ArgumentParser()
parser.add_argument("stylet")
parser.add_argument("out")
parser.add_argument("--cases", type=int, default=10)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--hide", choices=["clean", "one"], default="clean")
args = parser.parse_args()
stylet, out = os.path.abspath(args.stylet), os.path.abspath(args.out)
RUNS = 4
EFFECTS = [
    lambda rng: f"CoulombFriction(c_n_per_m: {rng.uniform(2, 8):.3f})",
    lambda rng: f"PowerLawFriction(exponent: {rng.uniform(0.5, 0.8):.3f})",
    lambda rng: f"NonlinearElasticity(kappa_per_m: {rng.uniform(20, 60):.3f})",
    lambda rng: f"CuttingForce(force_n: {rng.uniform(0.1, 0.5):.3f})",
    lambda rng: f"ForceDrift(rate_n_per_s: {rng.uniform(0.004, 0.02):.4f})",
    lambda rng: f"LowPassLag(time_constant_s: {rng.uniform(0.05, 0.2):.3f})",
]


def scenario(rng, effect, surface_m):
    layers, depth = [], 0.0
    for last in [False] * rng.choice([1, 2]) + [True]:
        thickness, stiffness = rng.uniform(0.012, 0.02), rng.uniform(40, 120)
        thickness = 0.05 if last else thickness
        puncture = "" if last else f", puncture_n: {stiffness * thickness * rng.uniform(0.5, 0.8):.4f}"
        layers.append(
            f"(thickness_m: {thickness:.5f}, stiffness_n_per_m: {stiffness:.3f}, "
            f"friction_ns_per_m2: {rng.uniform(6e3, 16e3):.1f}{puncture})"
        )
        depth += 0.015 if last else thickness
    speed = rng.uniform(0.0015, 0.004)
    first_s = (depth + 0.005) * 0.6 / speed
    motion = (
        f"Program(start_m: -0.005, segments: [Move(velocity_mps: {speed:.5f}, duration_s: {first_s:.3f}), Hold(duration_s: 3.0), "
        f"Ripple(velocity_mps: {speed:.5f}, amplitude_mps: {0.3 * speed:.5f}, frequency_hz: 0.5, duration_s: {first_s / 1.5:.3f}), "
        f"Move(velocity_mps: {-2 * speed:.5f}, duration_s: {0.4 * first_s:.3f})])"
    )
    effects = f"effects: [{effect}], " if effect else ""
    return (
        f'Scenario(name: "drawn", tissue: (surface_m: {surface_m:.6f}, layers: [{", ".join(layers)}]), {effects}motion: {motion}, '
        "sensor: ForceTorque(noise_n: 0.01, ar1: 0.3))"
    )


def run(*arguments):
    done = subprocess.run([stylet, *arguments, "--quiet"], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(arguments)}: {done.stderr}")


def causes(folder):
    with open(os.path.join(folder, "diagnosis.json")) as file:
        found = json.load(file)
    return [found["verdict"]] + sorted(cause["effect"] for cause in found["causes"])


def snake(effect):
    return "".join(("_" if c.isupper() and k else "") + c.lower() for k, c in enumerate(effect.split("(")[0]))


same = right_repeats = right_plain = 0
for case in range(args.cases):
    rng = random.Random(1000 * args.seed + case)
    effect = EFFECTS[case % len(EFFECTS)](rng) if args.hide == "one" else None
    folder = os.path.join(out, f"{args.hide}-{args.seed}-{case}")
    os.makedirs(folder, exist_ok=True)
    draw = rng.random()
    recordings = []
    for k in range(RUNS):
        real = os.path.join(folder, f"real{k}.ron")
        with open(real, "w") as file:
            file.write(scenario(random.Random(draw), effect, rng.gauss(0, 1e-4)))
        run("run", real, "--seed", str(1 + k + RUNS * case), "--out", os.path.join(folder, f"run{k}"))
        recordings.append(os.path.join(folder, f"run{k}", "recording.csv"))
    assumed = os.path.join(folder, "assumed.ron")
    with open(assumed, "w") as file:
        file.write(scenario(random.Random(draw), None, 0.0))
    for name, more in [("repeats", ["--repeats"]), ("plain", [])]:
        run("diagnose", assumed, *more, "--data", *recordings, "--out", os.path.join(folder, name))
    repeats, plain = (causes(os.path.join(folder, name)) for name in ("repeats", "plain"))
    wanted = [snake(effect)] if effect else []
    same += repeats[1:] == plain[1:]
    right_repeats += repeats[1:] == wanted and repeats[0] != "unknown"
    right_plain += plain[1:] == wanted and plain[0] != "unknown"
    print(f"{case:3} {effect or 'clean':44} repeats {' '.join(repeats):44} plain {' '.join(plain)}", flush=True)
print(f"same causes {same} of {args.cases}; right: --repeats {right_repeats}, plain {right_plain}")
