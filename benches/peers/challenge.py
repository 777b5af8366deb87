"""An entrant to the challenge of `stylet benchmark export`: a sparse regression (LassoCV) that sees the exported files alone.

    stylet benchmark export --wrong nothing,thickness --severity large --cases 60 --seed 702 --out out/challenge
    target/peers/bin/python benches/peers/challenge.py out/challenge out/answers.json
    stylet benchmark score out/challenge out/answers.json

Per recording: means over 20 ms; ruptures where the force falls most between 60 % of a layer and 12 % beyond its far face. Columns:
the assumed law's `K` and `b` of every layer, which are fitted freely, and what the library's effects that are linear in their
strength would add. An effect is named when its column, together with those of the assumed law, contributes more than a tenth of what
remains, or 0.3 noise standard deviations, whichever is larger. Whoever wants to enter with a better method starts here.
"""

import json
import pathlib
import re
import sys
import warnings

import numpy as np
from sklearn.linear_model import LassoCV

warnings.filterwarnings("ignore")
BLOCK_S, BAND = 0.02, 1e-5


def assumed_tissue(text):
    number = r"(-?[\d.e+-]+)"
    surface = float(re.search(r"surface_m: " + number, text)[1])
    layers = []
    for line in text.splitlines():
        if "thickness_m" in line:
            layers.append([float(re.search(key + ": " + number, line)[1]) for key in ("thickness_m", "stiffness_n_per_m")])
    return surface, np.array(layers)


def blocks(path):
    t, z, f = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)[:3]
    size = max(1, round(BLOCK_S / np.median(np.diff(t))))
    n = len(t) // size * size
    t, z, f = (x[:n].reshape(-1, size).mean(axis=1) for x in (t, z, f))
    return t, z, f, np.gradient(z, t)


def ruptured(z, f, fronts):
    """How many layers have given way, block by block."""
    fall = np.zeros_like(f)
    fall[2:-2] = (f[3:-1] + f[4:]) / 2 - (f[:-4] + f[1:-3]) / 2
    count, since = np.zeros(len(z), int), 0
    for near, far in zip(fronts[:-1], fronts[1:]):
        low, high = near + 0.6 * (far - near), far + 0.12 * (far - near)
        here = np.flatnonzero((z >= low) & (z <= high) & (np.arange(len(z)) > since))
        if len(here) == 0:
            continue
        since = here[np.argmin(fall[here])]
        count[since:] += 1
    return count


def columns(t, z, v, count, fronts):
    sign = np.where(np.abs(v) > BAND * 10, np.sign(v), 0.0)
    base, inside = [], np.zeros_like(z)
    for i, (near, far) in enumerate(zip(fronts[:-1], fronts[1:])):
        length = np.clip(z - near, 0.0, far - near)
        inside += length
        base += [np.where(count == i, np.maximum(z - near, 0.0), 0.0), v * length]
    elastic = sum(base[::2])
    slide, relaxed = np.zeros_like(z), np.zeros_like(z)
    for k in range(1, len(z)):
        step = abs(z[k] - z[k - 1])
        slide[k] = sign[k] + (slide[k - 1] - sign[k]) * np.exp(-step / 8e-4)
        relaxed[k] = 0.0 if count[k] > count[k - 1] else relaxed[k - 1] + (elastic[k] - relaxed[k - 1]) * 0.01
    extra = {
        "coulomb_friction": sign * inside,
        "presliding_friction": slide * inside,
        "drive_friction": sign,
        "force_bias": np.ones_like(z),
        "force_drift": t,
        "tool_inertia": np.gradient(v, t),
        "cutting_force": (sign > 0) * (inside > 0),
        "asymmetric_friction": np.abs(v) * inside,
        "power_law_friction": sign * np.sqrt(np.abs(v)) * inside,
        "nonlinear_elasticity": elastic**2,
        "stress_relaxation": relaxed,
    }
    return np.array(base).T, extra


def answer(folder):
    surface, layers = assumed_tissue((folder / "assumed.ron").read_text())
    fronts = surface + np.concatenate([[0.0], np.cumsum(layers[:, 0])])
    base, extra, force, quiet = [], [], [], []
    for path in sorted(folder.glob("*.csv")):
        t, z, f, v = blocks(path)
        b, e = columns(t, z, v, ruptured(z, f, fronts), fronts)
        base.append(b)
        extra.append(np.array(list(e.values())).T)
        force.append(f)
        quiet.append(np.median(np.abs(np.diff(f))) / 0.6745 / np.sqrt(2))
    names = list(e)
    base, extra, force = np.vstack(base), np.vstack(extra), np.concatenate(force)
    q, _ = np.linalg.qr(base / np.maximum(np.linalg.norm(base, axis=0), 1e-12))
    left = force - q @ (q.T @ force)
    extra = extra - q @ (q.T @ extra)
    size = np.maximum(np.sqrt(np.mean(extra**2, axis=0)), 1e-12)
    fit = LassoCV(cv=4, alphas=30, fit_intercept=False).fit(extra / size, left)
    share = np.abs(fit.coef_)
    least = max(0.3 * np.median(quiet), 0.1 * np.sqrt(np.mean(left**2)))
    found = [(share[k], names[k]) for k in np.argsort(-share) if share[k] > least]
    if not found:
        return {"verdict": "none"}
    return {"verdict": "named", "causes": [{"effect": name} for _, name in found[:2]]}


def main():
    folder, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    answers = {}
    for case in sorted((folder / "cases").iterdir()):
        answers[case.name] = answer(case)
        print(case.name, answers[case.name], file=sys.stderr, flush=True)
    part = out.with_suffix(".part")
    part.write_text(json.dumps(answers, indent=1))
    part.rename(out)


main()
