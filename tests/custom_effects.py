#!/usr/bin/env python3
"""Whether a diagnosis treats a custom effect like one of the library.

usage: custom_effects.py STYLET_BINARY twins|named|clean [--cases N] [--seed S] [--effect NAME]

twins  Five effects of the library are hidden, N cases each (60 by default), and diagnosed without and with the same effects written as
       formulas (tests/custom_effects/twins.ron). The verdict is the same when both diagnoses name the same effects, up to the twins, and
       give the first strength within 2 % of one another; an effect that is ambiguous with its own twin alone counts as named. Also
       prints times.
named  Each of ten effects that the library does not have (tests/custom_effects/ten.ron) is hidden, N cases each (6), with all ten among
       the candidates: how often it is named first, or is not separable from what is named.
clean  N cases (60) without an effect, with all ten among the candidates: how often any effect is named, and how often one of the ten.

Phantoms have two or three layers; what is assumed is within 5 % (thicknesses) and 20 % (all else); two recordings per case, simulated by
`stylet run`. Seeds 12001 and below were looked at.
"""
import argparse
import json
import pathlib
import random
import re
import subprocess
import tempfile
import time

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("stylet")
parser.add_argument("part", choices=["twins", "named", "clean"])
parser.add_argument("--cases", type=int)
parser.add_argument("--seed", type=int, default=12001)
parser.add_argument("--effect", default="")
parser.add_argument("--verbose", action="store_true")
args = parser.parse_args()
here = pathlib.Path(__file__).resolve().parent / "custom_effects"
TWINS = {
    "nonlinear_elasticity": ("NonlinearElasticity(kappa_per_m: {})", "kappa_per_m", "kappa", 15.0),
    "stress_relaxation": ("StressRelaxation(terms: [(fraction: {}, time_constant_s: 2.0)])", "terms.0.fraction", "g", 0.3),
    "coulomb_friction": ("CoulombFriction(c_n_per_m: {})", "c_n_per_m", "c", 5.0),
    "drive_friction": ("DriveFriction(force_n: {})", "force_n", "f", 0.2),
    "force_drift": ("ForceDrift(rate_n_per_s: {})", "rate_n_per_s", "rate", 0.01),
}


def customs(path):
    """The `Custom(...)` entries of a file by name."""
    text = re.sub(r"//.*", "", path.read_text())
    entries = re.findall(r"\n    (Custom\(.*?\n    \)),", text, re.S)
    return {re.search(r'name: "(\w+)"', e).group(1): e for e in entries}


def draw(rng):
    """True and assumed layers, and two motions."""
    truth = []
    count = rng.choice([2, 3])
    for k in range(count):
        l = {"thickness_m": rng.uniform(0.015, 0.03), "stiffness_n_per_m": rng.uniform(30, 110), "friction_ns_per_m2": rng.uniform(4e3, 1.5e4)}
        l["puncture_n"] = None if k == count - 1 else rng.uniform(0.6, 0.95) * l["stiffness_n_per_m"] * l["thickness_m"]
        truth.append(l)
    within = lambda x, tolerance: x * (1 + rng.uniform(-tolerance, tolerance))
    assumed = [{n: x and within(x, 0.05 if n == "thickness_m" else 0.2) for n, x in l.items()} for l in truth]
    depth_m = sum(l["thickness_m"] for l in truth[:-1]) + 0.7 * truth[-1]["thickness_m"]
    motions = []
    for _ in range(2):
        v, hold = rng.uniform(0.0015, 0.004), rng.uniform(2.0, 4.0)
        first = 0.45 * depth_m / v
        second = 0.55 * depth_m / (1.6 * v)
        motions.append(
            f"Program(start_m: -0.005, segments: [Move(velocity_mps: {v:.5f}, duration_s: {0.005 / v + first:.3f}), "
            f"Hold(duration_s: {hold:.2f}), Ripple(velocity_mps: {1.6 * v:.5f}, amplitude_mps: {0.8 * v:.5f}, "
            f"frequency_hz: {rng.uniform(0.3, 0.8):.3f}, duration_s: {second:.3f}), Hold(duration_s: {hold:.2f}), "
            f"Move(velocity_mps: {-1.5 * v:.5f}, duration_s: {0.6 * depth_m / (1.5 * v):.3f})])"
        )
    return truth, assumed, motions, rng.uniform(0.006, 0.015)


def scenario(layers, effects, motion, noise_n):
    def layer(l):
        puncture = f", puncture_n: {l['puncture_n']:.6f}" if l["puncture_n"] else ""
        return (f"(thickness_m: {l['thickness_m']:.6f}, stiffness_n_per_m: {l['stiffness_n_per_m']:.4f}, "
                f"friction_ns_per_m2: {l['friction_ns_per_m2']:.2f}{puncture})")

    return (f"Scenario(name: \"case\", tissue: (layers: [{', '.join(map(layer, layers))}]), effects: [{effects}], motion: {motion}, "
            f"sensor: ForceTorque(noise_n: {noise_n:.4f}, ar1: 0.5))")


def command(*words):
    start = time.monotonic()
    subprocess.run([args.stylet, *map(str, words), "-q"], check=True)
    return time.monotonic() - start


class Case:
    def __init__(self, folder, seed, hidden):
        rng = random.Random(seed)
        truth, assumed, motions, noise_n = draw(rng)
        self.folder, self.data = folder, []
        effect = hidden(rng)
        for k, motion in enumerate(motions):
            (folder / "real.ron").write_text(scenario(truth, effect, motion, noise_n))
            command("run", folder / "real.ron", "--seed", 10 * seed + k, "--out", folder / f"r{k}")
            self.data.append(folder / f"r{k}" / "recording.csv")
        (folder / "assumed.ron").write_text(scenario(assumed, "", motions[0], noise_n))

    def diagnose(self, *effects):
        options = ["--effects", *effects] if effects else []
        took = command("diagnose", self.folder / "assumed.ron", "--data", *self.data, *options, "--out", self.folder / "out")
        return json.loads((self.folder / "out" / "diagnosis.json").read_text()), took


def rate(hits, of):
    return f"{hits}/{of}"


def twins(folder):
    for k, (name, (line, path, of_twin, size)) in enumerate(TWINS.items()):
        if args.effect not in name:
            continue
        same, found, times, cases = 0, 0, [0.0, 0.0], args.cases or 60
        for c in range(cases):
            case = Case(folder, args.seed * 1000 + 100 * k + c, lambda rng: line.format(round(size * rng.uniform(0.7, 1.6), 6)))
            before, a = case.diagnose()
            after, b = case.diagnose(here / "twins.ron")
            times = [times[0] + a, times[1] + b]
            classes = []
            for d in (before, after):
                of = [{x.removeprefix("twin_") for x in [e["effect"], *e["equivalent"]]} for e in d["causes"]]
                classes.append(sorted(sorted(x) for x in of))
            strengths = []
            for d in (before, after):
                for e in d["causes"]:
                    if e["effect"].removeprefix("twin_") == name:
                        strengths.append(e["parameters"][of_twin if e["effect"].startswith("twin_") else path]["value"])
            # An exact twin makes a named effect ambiguous; effects of the sensor's baseline are settled before the others.
            of_twin_only = any(x.startswith("twin_") != e["effect"].startswith("twin_") for e in after["causes"] for x in e["equivalent"]
                               if x.removeprefix("twin_") == e["effect"].removeprefix("twin_") == name)
            verdict = "named" if after["verdict"] == "ambiguous" and of_twin_only else after["verdict"]
            close = len(strengths) in (0, 2) and (not strengths or abs(strengths[1] - strengths[0]) <= 0.02 * abs(strengths[0]))
            ok = before["verdict"].replace("ambiguous", "named") == verdict.replace("ambiguous", "named") and classes[0] == classes[1] and close
            same += ok
            found += any(e["effect"].removeprefix("twin_") == name for e in after["causes"])
            if args.verbose or not ok:
                print("  ", name, c, "same" if ok else "other", before["verdict"], after["verdict"], classes, strengths, flush=True)
        print(f"{name}: same verdict {rate(same, cases)}, named {rate(found, cases)}, time {times[1] / times[0]:.2f} of that without formulas", flush=True)


def named(folder):
    total, of = 0, 0
    for k, (name, text) in enumerate(customs(here / "ten.ron").items()):
        if args.effect not in name:
            continue
        hits, cases, others = 0, args.cases or 6, []
        for c in range(cases):
            # The hidden effect differs from its typical values.
            vary = lambda rng: re.sub(r"\(start: ([-+0-9.e]+)", lambda m: f"(start: {m.group(1)}, value: {float(m.group(1)) * rng.uniform(0.7, 1.5):.6g}", text)
            found, _ = Case(folder, args.seed * 1000 + 500 + 10 * k + c, vary).diagnose(here / "ten.ron")
            classes = [[e["effect"], *e["equivalent"]] for e in found["causes"]]
            hit = any(name in x for x in classes)
            hits += hit
            if args.verbose or not hit:
                others.append(f"{found['verdict']} {classes}")
        total, of = total + hits, of + cases
        print(f"{name}: {rate(hits, cases)} {'; '.join(others)}", flush=True)
    print(f"named: {rate(total, of)}")


def clean(folder):
    of_ten, named_any, custom, cases = customs(here / "ten.ron"), 0, 0, args.cases or 60
    for c in range(cases):
        found, _ = Case(folder, args.seed * 1000 + 700 + c, lambda rng: "").diagnose(here / "ten.ron")
        names = [e["effect"] for e in found["causes"]]
        named_any += bool(names)
        custom += any(name in of_ten for name in names)
        if names or args.verbose:
            print("  ", c, found["verdict"], names, flush=True)
    print(f"clean, with ten formulas among the candidates: any effect is named in {rate(named_any, cases)}, one of the ten in {rate(custom, cases)}")


with tempfile.TemporaryDirectory() as folder:
    {"twins": twins, "named": named, "clean": clean}[args.part](pathlib.Path(folder))
