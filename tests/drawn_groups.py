#!/usr/bin/env python3
"""Drawn worlds: groups of simulated insertions with known spreads.

    tests/drawn_groups.py STYLET OUT [WORLDS [SEED]]
    tests/drawn_groups.py STYLET OUT WORLDS SEED documented
    tests/drawn_groups.py STYLET OUT WORLDS SEED transfer

Each world has a group that makes the law (three recordings, diagnosed) and another one that deviates in surface, force,
friction and puncture force with the spreads below; recordings scatter about their group. Per world, in N: error on the other
group without and with --refit, after one recording, with the true group; the share of samples in the band of an unseen group
and, on further recordings of the first group, in that of the same group. At the end, how many true deviations lie in their
95 % intervals.

With `documented` the other group is drawn with the spreads that the band assumes by default (docs/reference/spreads.md).

With `transfer` each parameter of the other group differs with probability 1/2, by a size between the bounds of DIFFERENCE and
with either sign; the others are equal. Counted are the worlds in which `diagnose --transfer` names the parameters that
differ and no other, and the true differences in their 95 % intervals.
"""

import json
import math
import os
import random
import subprocess
import sys

GROUP_SD = {"surface": 1.0e-3, "force": 0.2, "friction": 0.2, "puncture": 0.2}
DOCUMENTED_SD = {"surface": 1.9e-3, "force": 0.32, "friction": 0.34, "puncture": 0.37}
RECORDING_SD = {"surface": 0.1e-3, "force": 0.01, "friction": 0.03, "puncture": 0.05}
DIFFERENCE = {"surface": (0.5e-3, 2.0e-3), "force": (0.15, 0.4), "friction": (0.15, 0.4), "puncture": (0.15, 0.4)}
NONE = {k: 0.0 for k in GROUP_SD}
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


def plus(a, b):
    return {k: a[k] + b[k] for k in a}


class Worlds:
    def __init__(self, stylet, out, seed):
        self.stylet, self.out, self.rng = stylet, out, random.Random(seed)

    def drawn(self, sd):
        return {k: self.rng.gauss(0.0, s) for k, s in sd.items()}

    def differences(self):
        """Each parameter equal, or different by a size between bounds."""
        size = lambda bounds: self.rng.choice((-1.0, 1.0)) * self.rng.uniform(*bounds)
        return {k: size(b) if self.rng.random() < 0.5 else 0.0 for k, b in DIFFERENCE.items()}

    def recordings(self, folder, group, count):
        files = []
        for k in range(count):
            path = os.path.join(folder, f"{k}.ron")
            os.makedirs(folder, exist_ok=True)
            with open(path, "w") as f:
                f.write(scenario(plus(group, self.drawn(RECORDING_SD)), 0.004, self.rng.randrange(10**6)))
            run(self.stylet, "run", path, "--out", os.path.join(folder, str(k)), "--quiet")
            files.append(os.path.join(folder, str(k), "recording.csv"))
        return files

    def model(self, folder, made):
        """Model of the recordings `made` of a group without deviation."""
        assumed = os.path.join(folder, "assumed.ron")
        with open(assumed, "w") as f:
            f.write(scenario(NONE, 0.004, 1))
        run(self.stylet, "diagnose", assumed, "--data", *made, "--out", os.path.join(folder, "law"), "--quiet")
        return os.path.join(folder, "law", "extended.ron")

    def result(self, name, *arguments):
        target = os.path.join(self.out, name)
        run(self.stylet, *arguments, "--out", target, "--quiet")
        with open(os.path.join(target, name + ".json")) as f:
            return json.load(f)

    def predict(self, model, data, *more):
        return self.result("predict", "predict", model, "--data", *data, *more)


def predictions(worlds, count, group_sd):
    inside = total = worse = 0
    columns = ("law", "refit", "one", "truth", "unseen", "refit %", "same")
    print("world " + " ".join(f"{c:>8}" for c in columns))
    sums = [0.0] * len(columns)
    for world in range(count):
        folder = os.path.join(worlds.out, str(world))
        other = worlds.drawn(group_sd)
        made = worlds.recordings(os.path.join(folder, "first"), NONE, 5)
        new = worlds.recordings(os.path.join(folder, "other"), other, 4)
        truth = os.path.join(folder, "truth.ron")
        with open(truth, "w") as f:
            f.write(scenario(other, 0.004, 1))
        law = worlds.model(folder, made[:3])
        plain, refit = worlds.predict(law, new), worlds.predict(law, new, "--refit")
        one = worlds.predict(law, new[1:], "--refit-on", new[0])
        exact = worlds.predict(truth, new, "--same", "group")
        same = worlds.predict(law, made[3:], "--same", "group")
        row = [plain["rmse_n"], refit["rmse_n"], one["rmse_n"], exact["rmse_n"], plain["band_coverage"],
               refit["band_coverage"], same["band_coverage"]]
        for p in refit["refit"]["parameters"]:
            inside += abs(p["value"] - other[p["parameter"]]) < 1.96 * math.hypot(p["sd"], 1e-12)
            total += 1
        worse += row[1] > 1.03 * row[0] or row[2] > 1.03 * row[0]
        sums = [s + x for s, x in zip(sums, row)]
        print(f"{world:5} " + " ".join(f"{x:8.3f}" for x in row), flush=True)
    print(" mean " + " ".join(f"{s / count:8.3f}" for s in sums))
    print(f"deviations in their 95 % intervals: {inside} of {total}; refit worse by more than 3 %: {worse}")


def transfers(worlds, count):
    exact = missed = false = inside = total = another = 0
    for world in range(count):
        folder = os.path.join(worlds.out, str(world))
        other = worlds.differences()
        made = worlds.recordings(os.path.join(folder, "first"), NONE, 3)
        new = worlds.recordings(os.path.join(folder, "other"), other, 4)
        found = worlds.result("transfer", "diagnose", "--transfer", worlds.model(folder, made), "--data", *new)
        named = {p["parameter"] for p in found["parameters"] if p["differs"]}
        differ = {k for k, d in other.items() if d != 0.0}
        another += found["verdict"] == "another_law"
        exact += named == differ and found["verdict"] != "another_law"
        missed += len(differ - named)
        false += len(named - differ)
        for p in found["parameters"]:
            true = other[p["parameter"]] if p["parameter"] == "surface" else math.exp(other[p["parameter"]])
            inside += p["low"] <= true <= p["high"]
            total += 1
        cells = [f"{p['parameter']} {other[p['parameter']]:+.5f} {p['probability']:.3f}" + ("*" if p["differs"] else " ")
                 for p in found["parameters"]]
        right = "right" if named == differ else "WRONG"
        print(f"{world:5} {right} {found['verdict']:11} misfit {found['misfit_ratio']:5.2f}  " + "  ".join(cells), flush=True)
    print(f"exactly the parameters that differ: {exact} of {count}; missed {missed}, named without a difference {false}, "
          f"another law {another}; differences in their 95 % intervals: {inside} of {total}")


def main():
    stylet, out = sys.argv[1:3]
    count = int(sys.argv[3]) if len(sys.argv) > 3 else 20
    worlds = Worlds(stylet, out, int(sys.argv[4]) if len(sys.argv) > 4 else 48)
    if sys.argv[5:] == ["transfer"]:
        transfers(worlds, count)
    else:
        predictions(worlds, count, DOCUMENTED_SD if sys.argv[5:] == ["documented"] else GROUP_SD)


main()
