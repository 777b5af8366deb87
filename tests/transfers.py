#!/usr/bin/env python3
"""Transfers: a law identified from one group of real insertions predicts another group.

    STYLET_MEASURED=folder tests/transfers.py STYLET OUT [LAW ...]

Groups are the shipped sets: the stack at three speeds (three days), skin, muscle. Each law is diagnosed once into OUT and
kept there. Per transfer, in N over all samples: error of the law, with --refit (each recording from the others), after one
recording (mean over the recordings), the floor (mean of the other recordings of the group), the mean curve of the training
recordings by depth and hold, the same shifted and scaled by two numbers from one recording, and the share of samples in the
bands. Averages are geometric means of the errors over the floor.
"""

import glob
import json
import math
import os
import re
import subprocess
import sys

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
GROUPS = {
    "stack1": ("skin_on_muscle", "needle_phantom/skin-on-muscle_1mmps_*.csv"),
    "stack2": ("skin_on_muscle", "needle_phantom/skin-on-muscle_2mmps_*.csv"),
    "stack3": ("skin_on_muscle", "needle_phantom/skin-on-muscle_3mmps_*.csv"),
    "skin": ("skin", "needle_phantom/skin_2mmps_*.csv"),
    "muscle": ("muscle", "needle_phantom/muscle_2mmps_*.csv"),
}
LAWS = {
    "stack1": ["stack1"], "stack2": ["stack2"], "stack3": ["stack3"],
    "stack12": ["stack1", "stack2"], "stack13": ["stack1", "stack3"], "stack23": ["stack2", "stack3"],
    "skin": ["skin"], "muscle": ["muscle"],
}
STACKS = ["stack1", "stack2", "stack3"]
TARGETS = {law: STACKS if law.startswith("stack") else ["skin", "muscle"] for law in LAWS}
MAP = 'Columns(time: (name: "time", scale: 1e-6), position: (name: "pz", scale: 1e-3), force: (name: "fz"))\n'
DEPTH_BINS, HOLD_BINS = 100, 25
FOLDER = os.environ.get("STYLET_MEASURED", "")


def files(group):
    return sorted(glob.glob(os.path.join(FOLDER, GROUPS[group][1])))


def run(stylet, arguments):
    done = subprocess.run([stylet, *arguments], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(arguments)}: {done.stderr}")
    return done.stdout


def diagnose(stylet, out, law):
    """Folder of a law, diagnosed if it is not there."""
    folder = os.path.join(out, "laws", law)
    if os.path.exists(os.path.join(folder, "diagnosis.json")):
        return folder
    os.makedirs(os.path.join(out, "sets"), exist_ok=True)
    groups = LAWS[law]
    with open(os.path.join(ROOT, "scenarios", "measured", GROUPS[groups[0]][0] + ".ron")) as f:
        text = f.read()
    text = re.sub(r"parts: \[.*?\n    \],\n", "", text, flags=re.S)
    names = ", ".join(f'"{GROUPS[g][1]}"' for g in groups)
    text = re.sub(r"recordings: \[.*?\],", lambda _: f"recordings: [{names}],", text)
    path = os.path.join(out, "sets", law + ".ron")
    with open(path, "w") as f:
        f.write(text)
    run(stylet, ["diagnose", path, "--out", folder, "--quiet"])
    return folder


def read(path):
    """Time (s), position (mm) and force (N) from the start of the motion on."""
    with open(path) as f:
        names = f.readline().strip().split(",")
        at = [names.index(n) for n in ("time", "pz", "fz")]
        rows = [[float(line.split(",")[k]) for k in at] for line in f if line.strip()]
    return [r[0] * 1e-6 for r in rows], [r[1] for r in rows], [r[2] for r in rows]


def places(t, z):
    """Place of every sample: 0 to 1 advance by depth, 1 to 2 hold by time, 2 to 3 retraction by depth."""
    low, high = min(z), max(z)
    near = min(0.005 * (high - low), 0.1)
    deepest = next(i for i, x in enumerate(z) if x > high - near)
    last = max(i for i, x in enumerate(z) if x > high - near)
    out, far, back = [], -1e9, 1e9
    for i, x in enumerate(z):
        if i <= deepest:
            far = max(far, x)
            out.append((0, far))
        elif i <= last:
            out.append((1, (t[i] - t[deepest]) / max(t[last] - t[deepest], 1e-9)))
        else:
            back = min(back, x)
            out.append((2, back))
    return out


def grid(place):
    segment, x = place
    if segment == 1:
        return 1000 + min(max(x * HOLD_BINS - 0.5, 0), HOLD_BINS - 1)
    return segment * 1000 + min(max(x / 26 * DEPTH_BINS - 0.5, 0), DEPTH_BINS - 1)


def curve(ps, f):
    """Means per bin, as sorted (place, force)."""
    sums = {}
    for p, y in zip(ps, f):
        s = sums.setdefault(round(grid(p)), [0.0, 0])
        s[0] += y
        s[1] += 1
    return {k: s / n for k, (s, n) in sums.items()}


def mean(curves):
    keys = set().union(*curves)
    out = {}
    for k in keys:
        known = [c[k] for c in curves if k in c]
        out[k] = sum(known) / len(known)
    return out


def at(c, g):
    low = math.floor(g)
    a = c.get(low, c.get(low + 1))
    b = c.get(low + 1, a)
    if a is None:
        near = min(c, key=lambda k: abs(k - g))
        return c[near]
    return a + (g - low) * (b - a)


def moved(ps, shift):
    return [(s, x if s == 1 else x - shift) for s, x in ps]


def error(pairs):
    pairs = list(pairs)
    return math.sqrt(sum((a - b) ** 2 for a, b in pairs) / len(pairs))


class Run:
    def __init__(self, path):
        self.t, self.z, self.f = read(path)
        self.ps = places(self.t, self.z)
        self.curve = curve(self.ps, self.f)

    def rms(self, c, shift=0.0, scale=1.0):
        return error((y, scale * at(c, grid(p))) for y, p in zip(self.f, moved(self.ps, shift)))


RUNS = {}


def runs(group):
    if group not in RUNS:
        RUNS[group] = [Run(path) for path in files(group)]
    return RUNS[group]


def shift_and_scale(run, c):
    """Best shift (mm) and scale of a curve for one run, by least squares."""
    best = (math.inf, 0.0, 1.0)
    step = slice(None, None, 4)
    for shift in (0.2 * k for k in range(-25, 26)):
        model = [at(c, grid(p)) for p in moved(run.ps, shift)[step]]
        scale = sum(m * y for m, y in zip(model, run.f[step])) / max(sum(m * m for m in model), 1e-12)
        e = error((y, scale * m) for m, y in zip(model, run.f[step]))
        best = min(best, (e, shift, scale))
    return best[1:]


def floor(group):
    rs = runs(group)
    return average([r.rms(mean([o.curve for o in rs if o is not r])) for r in rs])


def average(values):
    return sum(values) / len(values)


def predict(stylet, folder, out, data, *more):
    columns = os.path.join(out, "map.ron")
    with open(columns, "w") as f:
        f.write(MAP)
    target = os.path.join(out, "prediction")
    run(stylet, ["predict", os.path.join(folder, "extended.ron"), "--data", *data, "--columns", columns,
                 "--out", target, "--quiet", *more])
    with open(os.path.join(target, "predict.json")) as f:
        return json.load(f)


def rms(p):
    return average([r["rmse_n"] for r in p["recordings"]])


def main():
    stylet, out = sys.argv[1:3]
    os.makedirs(out, exist_ok=True)
    old = "--refit-on" not in run(stylet, ["predict", "--help"])
    refit = ["--refit", "surface,friction"] if old else ["--refit"]
    ratios, worse, worse_one, covered = {}, 0, 0, {"own": [], "transfer": []}
    print(f"{'law':8} {'to':7} {'floor':>6} {'law':>6} {'refit':>6} {'one':>6} {'mean':>6} {'two':>6} {'band':>5} {'same':>5} {'unseen':>6} {'refit':>5}")
    for law in sys.argv[3:] or LAWS:
        folder = diagnose(stylet, out, law)
        train = mean([r.curve for g in LAWS[law] for r in runs(g)])
        for group in TARGETS[law]:
            own = group in LAWS[law]
            data = files(group)
            plain = predict(stylet, folder, out, data)
            fitted = predict(stylet, folder, out, data, *refit)
            row = {"floor": floor(group), "law": rms(plain), "refit": rms(fitted)}
            ones = []
            for k, one in enumerate(data):
                rest = data[:k] + data[k + 1:]
                if not old:
                    ones.append(rms(predict(stylet, folder, out, rest, *refit, "--refit-on", one)))
            row["one"] = average(ones) if ones else math.nan
            row["mean"] = average([r.rms(train) for r in runs(group)])
            two = []
            for r in runs(group):
                shift, scale = shift_and_scale(r, train)
                two.append(average([o.rms(train, shift, scale) for o in runs(group) if o is not r]))
            row["two"] = average(two)
            bands = plain.get("coverage_by_group", {})
            cells = [plain["band_coverage"], bands.get("same", math.nan), bands.get("unseen", math.nan), fitted["band_coverage"]]
            print(f"{law:8} {group:7} " + " ".join(f"{row[k]:6.3f}" for k in ("floor", "law", "refit", "one", "mean", "two")) +
                  " " + " ".join(f"{100 * c:5.0f}" for c in cells), flush=True)
            covered["own" if own else "transfer"].append(plain["band_coverage"])
            worse += row["refit"] > 1.03 * row["law"]
            worse_one += row["one"] > 1.03 * row["law"]
            for k in ("law", "refit", "one", "mean", "two"):
                ratios.setdefault(("own" if own else "transfer", k), []).append(math.log(row[k] / row["floor"]))
    for kind in ("own", "transfer"):
        parts = [f"{k} {math.exp(average(v)):.3f}" for (of, k), v in ratios.items() if of == kind]
        if parts:
            band = [f"{100 * min(covered[kind]):.0f}", f"{100 * average(covered[kind]):.0f}", f"{100 * max(covered[kind]):.0f}"]
            print(f"{kind}: error over floor: {', '.join(parts)}; in the band (least, mean, most): {', '.join(band)} %")
    print(f"refit worse by more than 3 %: {worse} (each from the others), {worse_one} (after one recording)")


if __name__ == "__main__":
    main()
