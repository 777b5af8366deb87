#!/usr/bin/env python3
"""Counts causes that `stylet diagnose` is sure of in recordings that are no insertions into the assumed tissue.

usage: tests/no_insertions.py STYLET [--seed S] [--only WORDS]

Thirty shapes of force: sinusoids, ramps, walls, steps, random walks, retractions, other phantoms. Each is recorded twice, at two speeds, and diagnosed
with scenarios/three_layers.ron and without a scenario. Prints one line per diagnosis; a cause with a confidence above 0.9 or the verdict that the
simulation agrees counts as wrong, except where it is right: without a scenario another phantom is an insertion and a linear wall is a layer; the
scenario describes one of the phantoms. Exit code 1 when anything is wrong.
"""

import argparse
import json
import math
import random
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCENARIO = ROOT / "scenarios" / "three_layers.ron"
OTHER_PHANTOMS = ["isinglass_25_constant", "isinglass_70_sinusoidal", "bovine_liver_constant", "abdomen_sinusoidal", "three_layer_latex_constant"]
LINEAR_WALLS = ("hard wall", "soft wall")
PHANTOM_OF_SCENARIO = "other phantom, three_layer_latex_constant"
RATE_HZ, NOISE_N, START_M, END_M, HOLD_S = 200.0, 0.01, -0.008, 0.075, 2.0


def motion(speed):
    """Time in s and position in m of an insertion with a hold and a retraction."""
    travel_s = (END_M - START_M) / speed
    back_s = (END_M - START_M) / 0.008
    out = []
    for k in range(int((travel_s + HOLD_S + back_s) * RATE_HZ)):
        t = k / RATE_HZ
        forward = START_M + speed * min(t, travel_s)
        out.append((t, forward - 0.008 * max(t - travel_s - HOLD_S, 0.0)))
    return out


def walk(rng, step_n):
    """A function that sums normal steps, one per call."""
    total = [0.0]

    def next_value(t, x):
        total[0] += rng.gauss(0, step_n)
        return total[0]

    return next_value


def telegraph(rng, size_n, rate_hz):
    """A force that jumps to a drawn level at random times."""
    level = [0.0]

    def next_value(t, x):
        if rng.random() < rate_hz / RATE_HZ:
            level[0] = rng.uniform(-size_n, size_n)
        return level[0]

    return next_value


def shapes(rng):
    """Name and, per recording, the force in N as a function of time and position."""
    u, sin, tau = rng.uniform, math.sin, 2 * math.pi
    out = {}
    for hz in (0.1, 0.7, 3.0, 20.0):
        a, p = u(0.3, 5), u(0, tau)
        out[f"sinusoid of {hz} Hz"] = lambda: lambda t, x, a=a, p=p, hz=hz: a * sin(tau * hz * t + p)
    for mm in (3.0, 20.0):
        a = u(0.5, 3)
        out[f"sinusoid over {mm} mm"] = lambda: lambda t, x, a=a, mm=mm: a * sin(tau * x * 1e3 / mm)
    rate, slope = u(0.05, 0.3), u(20, 100)
    out["ramp in time"] = lambda: lambda t, x: rate * t
    out["falling ramp in time"] = lambda: lambda t, x: 4 - rate * t
    out["ramp in position"] = lambda: lambda t, x: slope * (x - START_M)
    out["falling ramp in position"] = lambda: lambda t, x: 5 - slope * (x - START_M)
    out["parabola in time"] = lambda: lambda t, x: 0.02 * (t - 10) ** 2
    for name, k, power in (("hard wall", 2e4, 1.0), ("soft wall", 2e3, 1.0), ("hardening wall", 5e5, 2.0)):
        at = u(0.05, 0.06)
        out[name] = lambda at=at, k=k, power=power: lambda t, x: k * max(x - at, 0.0) ** power
    one = u(3, 15)
    out["one step"] = lambda: lambda t, x: 3.0 if t > one else 0.0
    out["one step down"] = lambda: lambda t, x: -2.0 if t > one else 0.0
    out["stairs"] = lambda: lambda t, x: 0.5 * math.floor(t / 2.5)
    out["random levels"] = lambda: telegraph(rng, 2.0, 0.5)
    out["many random levels"] = lambda: telegraph(rng, 1.0, 5.0)
    for step in (0.003, 0.01, 0.05):
        out[f"random walk of {step} N"] = lambda step=step: walk(rng, step)
    out["nothing"] = lambda: lambda t, x: 0.0
    return out


def write(path, rows):
    path.write_text("time_s,position_m,force_n\n" + "".join(f"{t:.6f},{x:.8f},{f:.6f}\n" for t, x, f in rows))


def read(path):
    lines = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
    names = lines[0].split(",")
    columns = [names.index(n) for n in ("time_s", "position_m", "force_n")]
    return [[float(line.split(",")[k]) for k in columns] for line in lines[1:]]


def simulated(command, folder, scenario, seed):
    out = folder / f"run-{seed}"
    subprocess.run([command, "run", scenario, "--seed", str(seed), "--out", out, "-q"], check=True)
    return read(out / "recording.csv")


def recordings(command, folder, rng):
    """Pairs of recordings by name."""
    out = {}
    for name, draw in shapes(rng).items():
        pair = []
        for speed in (0.004, 0.006):
            force = draw()
            pair.append([(t, x, force(t, x) + rng.gauss(0, NOISE_N)) for t, x in motion(speed)])
        out[name] = pair
    for part in ("second half", "last third"):
        pair = []
        for seed in (1, 2):
            rows = simulated(command, folder, SCENARIO, 10 * len(part) + seed)
            deepest = max(range(len(rows)), key=lambda k: rows[k][1])
            back = rows[deepest:] if part == "second half" else rows[deepest + 2 * (len(rows) - deepest) // 3 :]
            # Where the simulated motion ends at the deepest point, the way back is a pull of dry friction.
            if len(back) < 400:
                x0 = rows[deepest][1]
                back = [(k / RATE_HZ, x0 - 0.005 * k / RATE_HZ, -20.0 * max(x0 - 0.005 * k / RATE_HZ, 0) + rng.gauss(0, NOISE_N)) for k in range(3000)]
            pair.append([(t - back[0][0], x, f) for t, x, f in back])
        out[f"retraction only, {part}"] = pair
    for k, name in enumerate(OTHER_PHANTOMS):
        out[f"other phantom, {name}"] = [simulated(command, folder, ROOT / "scenarios" / f"{name}.ron", 100 * k + s) for s in (1, 2)]
    return out


def judge(command, folder, files, scenario):
    """What is said, and whether that is wrong."""
    out = folder / "out"
    arguments = ["diagnose", *([scenario] if scenario else []), "--data", *files, "--out", out, "-q"]
    done = subprocess.run([command, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        return "refused: " + " ".join(done.stderr.split())[:90], done.returncode not in (1, 2)
    d = json.loads((out / "diagnosis.json").read_text())
    causes = ", ".join(f"{c['effect']} {c['confidence']:.2f}" for c in d["causes"])
    sure = any(c["confidence"] > 0.9 for c in d["causes"])
    return f"{d['verdict']}{' agrees' if d['agrees'] else ''}: {causes or 'no cause'}", sure or d["agrees"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stylet", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="only shapes whose name holds these words")
    args = parser.parse_args()
    command = str(args.stylet.resolve())
    wrong = count = 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name, pair in recordings(command, folder, random.Random(args.seed)).items():
            if args.only not in name:
                continue
            files = [folder / "a.csv", folder / "b.csv"]
            for file, rows in zip(files, pair):
                write(file, rows)
            for scenario in (SCENARIO, None):
                said, is_wrong = judge(command, folder, files, scenario)
                if scenario is None:
                    is_insertion = name.startswith("other phantom")
                    is_right = is_insertion or (name in LINEAR_WALLS and said.endswith("agrees: no cause"))
                else:
                    is_right = name == PHANTOM_OF_SCENARIO and said.endswith("agrees: no cause")
                is_wrong = is_wrong and not is_right
                wrong, count = wrong + is_wrong, count + 1
                print(f"{name:38} {'with' if scenario else 'no':4} scenario {'WRONG' if is_wrong else 'ok':5} {said}", flush=True)
    print(f"{count} diagnoses, {wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
