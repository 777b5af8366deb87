"""Sparse regressions on cases of the independent simulator: the peers of `stylet diagnose`.

    python diagnose.py TUNING_TERMS TUNING_TRUTH TEST_TERMS ANSWERS

The folders of terms hold what `cargo run --release -p stylet-diagnose --example regression_tables` wrote for two challenges. Every peer sees
the residual of the fitted base law, what the parameters of the base law change (projected out), and what every effect of the library adds to
the force at the values from which Stylet's own search begins.

Every peer is tuned by itself on the tuning challenge, to the most right answers: its own settings (see diagnose_regressions.py);
whether residual and columns are whitened with the noise's colour, as Stylet does; whether what the ruptures say comes as further
rows; the smallest contribution that counts, in noise standard deviations and as a share of the largest; the largest number of
effects, where of equal scores the larger number is taken. Then it answers the test challenge: ANSWERS/NAME.json, for
`stylet benchmark score`; Stylet's own answers go to ANSWERS/stylet.json. An effect with a chosen column stands with its class: those
with a column that correlates with it above 0.98.

Saturation, quantisation and spikes are read off the raw force and are no terms of a residual: no peer can name them. Nor does a
regression say that something is outside its library.
"""

import itertools
import json
import pathlib
import sys
import time
import warnings

import numpy as np

warnings.filterwarnings("ignore")

from diagnose_cases import Case, answer, chosen, right  # noqa: E402
from diagnose_regressions import PEERS  # noqa: E402

VIEWS = list(itertools.product((False, True), repeat=2))  # whitened, rows of ruptures
LEAST = [0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.13, 0.16, 0.2, 0.25, 0.3, 0.4, 0.6]
SHARE = [0.0, 0.1, 0.2, 0.35, 0.5]
MOST = [99, 3, 2, 1]  # of equal scores the one that names more effects
CUTS = [(least, share, most) for most, least, share in itertools.product(MOST, LEAST, SHARE)]


def load(folder, truth=None):
    paths = sorted(p for p in folder.glob("*.json") if not p.name.endswith(".stylet.json"))
    return [Case(p, truth and truth[p.name.split(".")[0]]) for p in paths]


def tune(cases):
    """The best of every peer: (score, view, setting, cut)."""
    results = {name: {} for name in PEERS}
    for number, case in enumerate(cases):
        for view in VIEWS:
            problem = case.problem(*view)
            for name, peer in PEERS.items():
                for setting, coefficients in peer.scan(problem).items():
                    if view[1] and setting[0] == "NARX":
                        continue  # rows of ruptures have no sample before
                    found, worth = problem.contributions(coefficients), {}
                    rows = results[name].setdefault((view, setting), np.zeros((len(cases), len(CUTS)), bool))
                    for k, cut in enumerate(CUTS):
                        named = chosen(found, *cut)  # the largest first: how many there are says which
                        if len(named) not in worth:
                            worth[len(named)] = right(case.truth, answer(problem, named))
                        rows[number, k] = worth[len(named)]
        print(f"tuning: {number + 1} of {len(cases)}", file=sys.stderr, flush=True)
    best = {}
    for name, settings in results.items():
        for (view, setting), rows in settings.items():
            score = rows.mean(axis=0)
            k = int(np.argmax(score))
            if name not in best or (score[k], CUTS[k][2]) > (best[name][0], best[name][3][2]):
                best[name] = (score[k], view, setting, CUTS[k])
    return best


def describe(best):
    score, (whitened, ruptures), setting, (least, share, most) = best
    said = [
        " ".join(str(s) for s in setting),
        "whitened" if whitened else "not whitened",
        "with rows of ruptures" if ruptures else "without rows of ruptures",
        f"at least {least:g} sd and {share:g} of the largest",
        "any number" if most > 3 else f"at most {most}",
    ]
    return f"{'; '.join(said)} (right in {100 * score:.0f} % of the tuning cases)"


def put(path, answers):
    part = path.with_suffix(".part")
    part.write_text(json.dumps(answers, indent=1))
    part.rename(path)


def main():
    tuning, truth, test, out = map(pathlib.Path, sys.argv[1:5])
    tuned_on = load(tuning, json.loads(truth.read_text()))
    cases = load(test)
    out.mkdir(parents=True, exist_ok=True)
    best = tune(tuned_on)
    print(f"tuned on {len(tuned_on)} cases:")
    for name in PEERS:
        print(f"    {name}: {describe(best[name])}")
    answers, seconds = {name: {} for name in PEERS}, {name: [] for name in PEERS}
    stylet = {}
    for number, case in enumerate(cases):
        for name, peer in PEERS.items():
            _, view, setting, cut = best[name]
            problem = case.problem(*view)
            start = time.process_time()
            coefficients = peer.fit(problem, setting)
            seconds[name].append(time.process_time() - start)
            answers[name][case.number] = answer(problem, chosen(problem.contributions(coefficients), *cut))
        stylet[case.number] = json.loads(case.path.with_suffix(".stylet.json").read_text())
        print(f"test: {number + 1} of {len(cases)}", file=sys.stderr, flush=True)
    put(out / "stylet.json", stylet)
    for name in PEERS:
        put(out / f"{name.split()[0].lower()}.json", answers[name])
    print("\nseconds per case, median and 90 %:")
    took = [s["seconds"] for s in stylet.values()]
    print(f"    {'Stylet, everything':<28}{np.median(took):6.2f}{np.quantile(took, 0.9):7.2f}")
    for name, took in seconds.items():
        print(f"    {name:<28}{np.median(took):6.2f}{np.quantile(took, 0.9):7.2f}")
    before = [c.about["base_s"] + c.about["terms_s"] for c in cases]
    print(f"    before a peer can begin (base fit, columns): {np.median(before):.2f}")


main()
