"""Chooses the settings of every entrant on the making set: tune.py STYLET [--cases N] [--seed S] [--env DIR] [--entrants a,b]

For every point of an entrant's grid in settings.json, the making set is replayed with the entrant's loose threshold. The answers are judged for
twenty thresholds of the confidence, so a grid needs no thresholds. Point and threshold with the largest F1 (needle moved by no
more than half a millimetre) go to chosen.json beside this file, which run_all.py reads.
"""

import argparse
import itertools
import json
import pathlib

from common import HERE, Bench, in_pairs, load, options_of


def points(grid):
    for values in itertools.product(*grid.values()):
        yield dict(zip(grid, values))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stylet")
    parser.add_argument("--cases", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--env", type=pathlib.Path, default=pathlib.Path("target/peers-online"))
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("target/peers-online/tuning"))
    parser.add_argument("--entrants", help="only these, with commas between")
    options = parser.parse_args()
    settings = load("settings.json")
    names = options.entrants.split(",") if options.entrants else list(settings)
    bench = Bench(options.stylet, options.env, options.out)
    bench.export("make", options.cases, options.seed)

    def judged(job):
        name, point = job
        label = "_".join([name, *(f"{key}{value}" for key, value in point.items())])
        values = {**settings[name]["loose"], **point}
        bench.answers(label, settings[name], values)
        with open(bench.folder(label) / "events.csv") as lines:
            confidences = sorted(float(line.rsplit(",", 1)[1]) for line in list(lines)[1:])
        # Thresholds that keep ever fewer of the events: the last one keeps a twentieth of them.
        ranks = {int(len(confidences) * (1 - 0.05 ** (k / 19))) for k in range(20)}
        thresholds = {bench.at_threshold(label, confidences[rank]): confidences[rank] for rank in ranks if confidences}
        if not thresholds:
            return name, 0.0, values
        scores = bench.scores(list(thresholds))
        f1, above = max(((scores[above]["all"]["f1_half_mm"]["value"] or 0.0), above) for above in thresholds)
        threshold = float(f"{thresholds[above]:.3g}")
        print(f"{label}: F1 {f1:.3f} with threshold {threshold}", flush=True)
        return name, f1, {**values, "threshold": threshold}

    best = {}
    jobs = [(name, point) for name in names for point in points(settings[name]["grid"])]
    for name, f1, values in in_pairs(judged, jobs):
        if name not in best or f1 > best[name][0]:
            best[name] = (f1, values)
    chosen = load("chosen.json") if (HERE / "chosen.json").exists() else {}
    for name, (f1, values) in best.items():
        chosen[name] = values
        print(f"{name}: F1 {f1:.3f} with {' '.join(options_of(values))}")
    (HERE / "chosen.json").write_text(json.dumps(chosen, indent=2) + "\n")


if __name__ == "__main__":
    main()
