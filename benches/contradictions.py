#!/usr/bin/env python3
"""Counts diagnoses whose verdict their own numbers refute.

usage: contradictions.py STYLET OUT [--cases N] [--seed S] [--hide WORDS] [--wrong WORDS]

Cases of the independent simulator (`stylet benchmark export`), and forces that no insertion gives: sinusoids, ramps, walls, jumps
of the zero and random walks along a planned motion. A contradiction is agreement, or a cause with a confidence above 0.9, beside
held-out predictions that miss by more than twice the noise with the scatter between recordings known, a residual that depends on a
feature (p < 1e-3), a parameter at its bound, a scatter of 30 % or 5 mm, or a word of agreement on the terminal that the file does
not repeat. Ends with 1 when there is any.
"""
import argparse, json, math, os, random, re, shutil, subprocess, sys

parser = argparse.ArgumentParser()
parser.add_argument("stylet")
parser.add_argument("out")
parser.add_argument("--cases", type=int, default=2)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--hide", default="clean,one,two,outside,mixed")
parser.add_argument("--wrong", default="all")
parser.add_argument("--shapes", type=int, default=6, help="seeds of each shape that is no insertion")
args = parser.parse_args()
stylet, out = os.path.abspath(args.stylet), os.path.abspath(args.out)
os.makedirs(out, exist_ok=True)

PHANTOM = """Scenario(
    name: "two gels",
    tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
        (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0),
    ]),
    motion: Program(start_m: -0.01, segments: [
        Move(velocity_mps: 0.002, duration_s: 15.0), Hold(duration_s: 3.0),
        Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 15.0),
        Move(velocity_mps: -0.004, duration_s: 5.0),
    ]),
    sensor: ForceTorque(noise_n: 0.02, ar1: 0.5),
)
"""


def columns(path):
    with open(path) as file:
        names = file.readline().strip().split(",")
        rows = [[float(x) for x in line.split(",")] for line in file]
    return [[row[names.index(name)] for row in rows] for name in ("time_s", "position_m", "force_n")]


def shapes(rng):
    """Forces over time and position, one function per shape and recording."""
    phase, wall, rate = rng.uniform(0, 6.28), rng.uniform(0.005, 0.04), rng.uniform(0.02, 0.2)
    hz, size = rng.choice([0.1, 0.3, 0.7, 2.0]), rng.choice([0.05, 0.12, 0.5, 2.0])
    state = {"zero": size, "until": 0.0, "walk": 0.0}

    def jumps(t, x, f):
        if t >= state["until"]:
            state.update(zero=rng.choice([-size, size]), until=t + rng.uniform(1, 5))
        return f + state["zero"]

    def walk(t, x, f):
        state["walk"] += rng.gauss(0, 0.3 * size * 0.07)
        return f + state["walk"]

    def noise():
        return rng.gauss(0, 0.02)

    return {
        "sinusoid": lambda t, x, f: size * math.sin(6.28 * hz * t + phase) + noise(),
        "ramp": lambda t, x, f: rate * t + noise(),
        "wall": lambda t, x, f: (3 * size if x > wall else 0.0) + noise(),
        "steep_wall": lambda t, x, f: 4000 * max(x - wall, 0.0) + noise(),
        "zero_jumps": jumps,
        "random_walk": walk,
        "jumps_alone": lambda t, x, f: jumps(t, x, 0.0) + noise(),
    }


def refuted(d, text):
    """What refutes a diagnosis: reasons why agreement and sure causes are impossible."""
    gain, scatter = d["gain"], d.get("random_effect_sd", {})
    why = []
    if gain["rmse_given_scatter_n"] > 2 * gain["floor_n"]:
        why.append("misses by %.1f times the noise" % (gain["rmse_given_scatter_n"] / gain["floor_n"]))
    if d["residual_structure"]["p_value"] < 1e-3:
        why.append("residual test %.0e" % d["residual_structure"]["p_value"])
    why += ["%s at its bound" % b["name"] for b in d["base_parameters"] if b["at_bound"] and not b.get("at_least")]
    why += ["%s of %s at its bound" % (p, c["effect"]) for c in d["causes"] for p in c.get("at_bound", [])]
    if max(scatter.get("puncture", 0), scatter.get("friction", 0)) >= 0.3:
        why.append("relative scatter")
    if max(scatter.get("rupture_depth_m", 0), scatter.get("surface_m", 0)) >= 5e-3:
        why.append("scatter in mm")
    claims = []
    if d["agrees"] or "agrees with the data" in text:
        claims.append("agrees")
    claims += ["%s sure" % c["effect"] for c in d["causes"] if c["confidence"] > 0.9]
    found = ["%s, but %s" % (c, w) for c in claims for w in why]
    if d["agrees"] != ("agrees with the data" in text):
        found.append("file and terminal differ")
    if d["agrees"] and d["verdict"] != "none":
        found.append("agrees under the verdict " + d["verdict"])
    return found


def diagnose(name, scenario, data):
    folder = os.path.join(out, "results", name)
    done = subprocess.run([stylet, "diagnose", scenario, "--out", folder, "--data", *data], capture_output=True, text=True)
    if done.returncode:
        return None, done.stderr.strip()
    with open(os.path.join(folder, "diagnosis.json")) as file:
        d = json.load(file)
    shutil.rmtree(folder)
    return d, done.stdout


count, refused, contradictions, agreed, sure_shapes = 0, 0, [], 0, []


def judge(name, scenario, data, is_shape=False):
    global count, refused, agreed
    d, text = diagnose(name, scenario, data)
    if d is None:
        refused += 1
        return
    count += 1
    agreed += d["agrees"]
    contradictions.extend("%s: %s" % (name, w) for w in refuted(d, text))
    if is_shape:
        if d["agrees"]:
            contradictions.append("%s: agrees" % name)
        sure_shapes.extend("%s: %s %.2f" % (name, c["effect"], c["confidence"]) for c in d["causes"] if c["confidence"] > 0.9)


if args.cases:
    challenge = os.path.join(out, "challenge")
    if not os.path.exists(challenge):
        subprocess.run([stylet, "benchmark", "export", "--wrong", args.wrong, "--severity", "large", "--hide", args.hide, "--cases",
                        str(args.cases), "--seed", str(args.seed), "--out", challenge], check=True, stdout=subprocess.DEVNULL)
    for case in sorted(os.listdir(os.path.join(challenge, "cases"))):
        folder = os.path.join(challenge, "cases", case)
        data = sorted(os.path.join(folder, f) for f in os.listdir(folder) if f.endswith(".csv"))
        judge(case, os.path.join(folder, "assumed.ron"), data)

phantom = os.path.join(out, "phantom.ron")
with open(phantom, "w") as file:
    file.write(PHANTOM)
clean = []
for seed in (1, 2, 3, 4):
    folder = os.path.join(out, "run%d" % seed)
    subprocess.run([stylet, "run", phantom, "--seed", str(seed), "-q", "--out", folder], check=True)
    clean.append(columns(os.path.join(folder, "recording.csv")))
for number in range(args.shapes):
    names = shapes(random.Random(0))
    for shape in names:
        data = []
        recordings = (1, 2, 4)[number % 3]
        for r in range(recordings):
            force = shapes(random.Random(1000 * args.seed + 10 * number + r))[shape]
            data.append(os.path.join(out, "%s_%d_%d.csv" % (shape, number, r)))
            with open(data[-1], "w") as file:
                file.write("time_s,position_m,force_n\n")
                for t, x, f in zip(*clean[r]):
                    file.write("%.6f,%.9f,%.6f\n" % (t, x, force(t, x, f)))
        judge("%s_%d" % (shape, number), phantom, data, is_shape=True)

print("\n".join(contradictions + ["sure of a shape: " + s for s in sure_shapes]))
print("%d diagnoses, %d refused, %d agree, %d contradictions, %d causes above 0.9 in shapes that are no insertion"
      % (count, refused, agreed, len(contradictions), len(sure_shapes)))
sys.exit(1 if contradictions else 0)
