#!/usr/bin/env python3
"""Whether `stylet check` is right about the effects that recordings could show.

usage: check_against_outcome.py STYLET_BINARY [--cases N] [--seed S] [--jobs J]

Each case draws a phantom of two layers and assumed numbers within their tolerance, and records two insertions without any effect. `check` says
for each effect from which size on it would be seen and below which it would be missed. One effect is drawn and recorded at exactly these two
sizes, with other noise; `diagnose` then finds it or not. An effect counts as found when it is a cause, or equivalent to one.

Also printed: how often the recordings of one truth are said to differ in a parameter.
"""
import argparse
import concurrent.futures
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
parser.add_argument("--jobs", type=int, default=2)
args = parser.parse_args()

MOTIONS = [
    "Move(velocity_mps: 0.002, duration_s: 15.0), Hold(duration_s: 3.0), Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, "
    "duration_s: 8.0), Move(velocity_mps: -0.004, duration_s: 5.0)",
    "Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.3, duration_s: 18.0), Move(velocity_mps: -0.003, duration_s: 5.0)",
]


def scenario(layers, motion, effect=""):
    def layer(l):
        puncture = f", puncture_n: {l['puncture_n']!r}" if l["puncture_n"] else ""
        return f"(thickness_m: {l['thickness_m']!r}, stiffness_n_per_m: {l['stiffness_n_per_m']!r}, friction_ns_per_m2: {l['friction_ns_per_m2']!r}{puncture})"

    return (f"Scenario(name: \"check\", tissue: (layers: [{', '.join(map(layer, layers))}]), effects: [{effect}], "
            f"motion: Program(start_m: -0.005, segments: [{motion}]), sensor: ForceTorque(noise_n: 0.01, ar1: 0.5))")


def effect_ron(effect, parameters):
    """An effect of `check.json` as a scenario has it; a path `terms.0.x` is a field of the first term."""
    terms = {path.removeprefix("terms.0."): v for path, v in parameters.items() if path.startswith("terms.0.")}
    fields = [f"{path}: {v!r}" for path, v in parameters.items() if not path.startswith("terms.0.")]
    if terms:
        fields.append("terms: [(" + ", ".join(f"{name}: {v!r}" for name, v in terms.items()) + ")]")
    return "".join(word.capitalize() for word in effect.split("_")) + "(" + ", ".join(fields) + ")"


def rate(hits, of):
    if of == 0:
        return "-"
    p, z = hits / of, 1.96
    centre, half = p + z * z / (2 * of), z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    return f"{hits}/{of} = {100 * p:.0f} % ({100 * (centre - half) / (1 + z * z / of):.0f} to {100 * (centre + half) / (1 + z * z / of):.0f})"


def run_case(case):
    rng = random.Random(f"{args.seed}-{case}")
    draw = lambda puncture: {"thickness_m": rng.uniform(0.015, 0.022), "stiffness_n_per_m": rng.uniform(40, 120),
                             "friction_ns_per_m2": rng.uniform(5e3, 2e4), "puncture_n": puncture}
    truth = [draw(None), draw(None)]
    truth[0]["puncture_n"] = 0.8 * truth[0]["stiffness_n_per_m"] * truth[0]["thickness_m"]
    off = lambda name, x: x and x * (1 + rng.uniform(-1, 1) * (0.05 if name == "thickness_m" else 0.2))
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "assumed.ron").write_text(scenario([{n: off(n, x) for n, x in l.items()} for l in truth], MOTIONS[0]))

        def call(*arguments):
            return subprocess.run([args.stylet, *map(str, arguments), "-q"], capture_output=True, text=True)

        def recorded(name, effect, seed):
            files = []
            for k, motion in enumerate(MOTIONS):
                (folder / "real.ron").write_text(scenario(truth, motion, effect))
                run = call("run", folder / "real.ron", "--seed", seed + k, "--out", folder / f"{name}{k}")
                if run.returncode:
                    raise SystemExit(f"case {case}: {effect}: {run.stderr}")
                files.append(folder / f"{name}{k}" / "recording.csv")
            return files

        def diagnosed(name, effect, seed):
            run = call("diagnose", folder / "assumed.ron", "--data", *recorded(name, effect, seed), "--out", folder / name)
            if run.returncode:
                raise SystemExit(f"case {case}: {effect}: {run.stderr}")
            return json.loads((folder / name / "diagnosis.json").read_text())

        seed = 100_000 * args.seed + 100 * case
        check = call("check", folder / "assumed.ron", "--data", *recorded("clean", "", seed), "--out", folder / "check")
        if check.returncode:
            raise SystemExit(f"case {case}: {check.stderr}")
        effects = json.loads((folder / "check" / "check.json").read_text())["effects"]
        drawn = rng.choice([e for e in effects if e["smallest"] and e["hidden_below"]])
        found = []
        for k, size in enumerate(["smallest", "hidden_below"]):
            d = diagnosed(size, effect_ron(drawn["effect"], drawn[size]), seed + 10 * (k + 1))
            found.append(any(drawn["effect"] in [c["effect"], *c["equivalent"]] for c in d["causes"]))
        clean = diagnosed("again", "", seed + 50)
        p_values = [p["p_value"] for p in clean["by_recording"]]
        return drawn["effect"], found, min(p_values, default=1.0) * len(p_values)


with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
    results = list(pool.map(run_case, range(args.cases)))
count = len(results)
print(f"at the size from which it is seen: found      {rate(sum(f[0] for _, f, _ in results), count)}")
print(f"at the size below which it is missed: found   {rate(sum(f[1] for _, f, _ in results), count)}")
for below in [0.05, 0.001]:
    print(f"recordings of one truth, p < {below}: differ    {rate(sum(p < below for _, _, p in results), count)}")
for effect in sorted({e for e, _, _ in results}):
    mine = [f for e, f, _ in results if e == effect]
    print(f"  {effect:<26} {sum(f[0] for f in mine)} and {sum(f[1] for f in mine)} of {len(mine)}")
