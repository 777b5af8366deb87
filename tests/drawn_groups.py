#!/usr/bin/env python3
"""Drawn worlds: groups of simulated insertions with known spreads.

    tests/drawn_groups.py STYLET OUT [WORLDS [SEED]]

Each world has a group that makes the law (three recordings, diagnosed) and another one that deviates in surface, force,
friction and puncture force with the spreads below; recordings scatter about their group. Per world, in N: error on the other
group without and with --refit, after one recording, with the true group; the share of samples in the band of an unseen group
and, on further recordings of the first group, in that of the same group. At the end, how many true deviations lie in their
95 % intervals.
"""

import json
import math
import os
import random
import subprocess
import sys

GROUP_SD = {"surface": 1.0e-3, "force": 0.2, "friction": 0.2, "puncture": 0.2}
RECORDING_SD = {"surface": 0.1e-3, "force": 0.01, "friction": 0.03, "puncture": 0.05}
LAYERS = [(0.012, 150.0, 9000.0, 1.4), (0.04, 220.0, 12000.0, None)]
TEXT = """Scenario(name: "two gels", tissue: (surface_m: {surface}, layers: [{layers}]),
    motion: Program(start_m: -0.005, segments: [
        Move(velocity_mps: {speed}, duration_s: {way}), Hold(duration_s: 2.0), Move(velocity_mps: -{speed}, duration_s: {way})]),
    robot: Replay, sensor: ForceTorque(noise_n: 0.01), sample_hz: 100.0, seed: {seed})
"""


def scenario(deviation, speed, seed):
    force, friction, puncture = (math.exp(deviation[k]) for k in ("force", "friction", "puncture"))
    layers = []
    for thickness, k, b, f in LAYERS:
        rupture = "" if f is None else f", puncture_n: {f * force * puncture}"
        layers.append(f"(thickness_m: {thickness}, stiffness_n_per_m: {k * force}, friction_ns_per_m2: {b * force * friction}{rupture})")
    return TEXT.format(surface=deviation["surface"], layers=", ".join(layers), speed=speed, way=0.03 / speed, seed=seed)


def run(stylet, *arguments):
    done = subprocess.run([stylet, *arguments], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(arguments)}: {done.stderr}")


def main():
    stylet, out = sys.argv[1:3]
    worlds = int(sys.argv[3]) if len(sys.argv) > 3 else 20
    rng = random.Random(int(sys.argv[4]) if len(sys.argv) > 4 else 48)
    drawn = lambda sd: {k: rng.gauss(0.0, s) for k, s in sd.items()}
    plus = lambda a, b: {k: a[k] + b[k] for k in a}
    none = {k: 0.0 for k in GROUP_SD}

    def recordings(folder, group, count):
        files = []
        for k in range(count):
            path = os.path.join(folder, f"{k}.ron")
            os.makedirs(folder, exist_ok=True)
            with open(path, "w") as f:
                f.write(scenario(plus(group, drawn(RECORDING_SD)), 0.004, rng.randrange(10**6)))
            run(stylet, "run", path, "--out", os.path.join(folder, str(k)), "--quiet")
            files.append(os.path.join(folder, str(k), "recording.csv"))
        return files

    def predict(model, data, *more):
        target = os.path.join(out, "prediction")
        run(stylet, "predict", model, "--data", *data, "--out", target, "--quiet", *more)
        with open(os.path.join(target, "predict.json")) as f:
            return json.load(f)

    inside = total = worse = 0
    columns = ("law", "refit", "one", "truth", "unseen", "refit %", "same")
    print("world " + " ".join(f"{c:>8}" for c in columns))
    sums = [0.0] * len(columns)
    for world in range(worlds):
        folder = os.path.join(out, str(world))
        first, other = none, drawn(GROUP_SD)
        made = recordings(os.path.join(folder, "first"), first, 5)
        new = recordings(os.path.join(folder, "other"), other, 4)
        assumed, truth = os.path.join(folder, "assumed.ron"), os.path.join(folder, "truth.ron")
        for path, deviation in ((assumed, first), (truth, other)):
            with open(path, "w") as f:
                f.write(scenario(deviation, 0.004, 1))
        run(stylet, "diagnose", assumed, "--data", *made[:3], "--out", os.path.join(folder, "law"), "--quiet")
        law = os.path.join(folder, "law", "extended.ron")
        plain, refit = predict(law, new), predict(law, new, "--refit")
        one = predict(law, new[1:], "--refit-on", new[0])
        exact = predict(truth, new, "--same", "group")
        same = predict(law, made[3:], "--same", "group")
        row = [plain["rmse_n"], refit["rmse_n"], one["rmse_n"], exact["rmse_n"], plain["band_coverage"],
               refit["band_coverage"], same["band_coverage"]]
        for p in refit["refit"]["parameters"]:
            inside += abs(p["value"] - other[p["parameter"]]) < 1.96 * math.hypot(p["sd"], 1e-12)
            total += 1
        worse += row[1] > 1.03 * row[0] or row[2] > 1.03 * row[0]
        sums = [s + x for s, x in zip(sums, row)]
        print(f"{world:5} " + " ".join(f"{x:8.3f}" for x in row), flush=True)
    print(" mean " + " ".join(f"{s / worlds:8.3f}" for s in sums))
    print(f"deviations in their 95 % intervals: {inside} of {total}; refit worse by more than 3 %: {worse}")


main()
