"""Chooses the settings of every entrant on the making set: tune.py STYLET [--cases N] [--seed S] [--env DIR] [--entrants a,b]

For every point of an entrant's grid in settings.json, the making set is replayed with the entrant's loose threshold and judged. The point with the
largest F1 (half a millimetre) is taken, and, where the judge says at which confidence F1 is largest, that as its threshold. The choices go to
chosen.json beside this file, which run_all.py reads.
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
    parser.add_argument("--cases", type=int, default=30)
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
        score = bench.score(label)
        threshold = score.get("best_threshold")
        print(f"{label}: F1 {score['f1_half_mm']:.3f}", flush=True)
        return name, score["f1_half_mm"], {**values, **({} if threshold is None else {"threshold": threshold})}

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
