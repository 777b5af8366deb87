"""Sparse regressions on the cases with hidden effects: the peers of `stylet diagnose`.

    python diagnose.py CASES_DIR TUNING_CASES TUNING_SEED TEST_CASES TEST_SEED FIGURE.svg

CASES_DIR holds what `cargo run --release -p stylet-diagnose --example peers_cases` wrote for both seeds. Every peer sees the
residual of the fitted base law and the change of the simulated force by every effect of the library, at the values from which
Stylet's own search begins (all its starting shapes; of a breathing tissue the six best frequencies; lines at the five
highest peaks of the periodogram).

Every peer is tuned by itself on the tuning seed, to the best mean of two rates, clean called clean and hidden effects named: its
own settings (see diagnose_regressions.py); whether residual and columns are whitened with the noise's colour in air, as Stylet
does; whether what the ruptures say comes as further rows; the smallest contribution that counts, in noise standard
deviations and as a share of the largest; the largest number of effects, where of equal scores the larger number is taken. Then it is
judged on the test seed.

Right: as many effects named as hidden, and each hidden one among them; an effect with a chosen column that correlates above
0.98 with one of a hidden effect's counts as that one. Stylet: as many causes as effects, each effect in the class of one.
Saturation, quantisation and outliers are read off the raw force and are no terms of a residual: cases with them are counted
apart. A force gain cannot be seen by anybody: right is to name nothing. Effects below 0.15 noise sd are left out.
"""

import itertools
import pathlib
import sys
import time
import warnings

import numpy as np

warnings.filterwarnings("ignore")

import diagnose_figure  # noqa: E402
from diagnose_cases import Case, chosen, judge, judge_stylet, rows, wilson  # noqa: E402
from diagnose_regressions import PEERS  # noqa: E402

VIEWS = list(itertools.product((False, True), repeat=2))  # whitened, rows of ruptures
LEAST = [0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.13, 0.16, 0.2, 0.25, 0.3, 0.4, 0.6]
SHARE = [0.0, 0.1, 0.2, 0.35, 0.5]
MOST = [99, 3, 2, 1]  # of equal scores the one that names more effects
CUTS = [(least, share, most) for most, least, share in itertools.product(MOST, LEAST, SHARE)]


def load(folder, seed, count):
    return [Case(folder / f"{seed}-{index:04}.json") for index in range(count)]


def tune(cases):
    """The best of every peer: (score, view, setting, cut, rates on clean and hidden)."""
    clean = np.array([c.kind == "clean" for c in cases])
    right = {name: {} for name in PEERS}
    for number, case in enumerate(cases):
        for view in VIEWS:
            problem = case.problem(*view)
            for name, peer in PEERS.items():
                for setting, coefficients in peer.scan(problem).items():
                    if view[1] and setting[0] == "NARX":
                        continue  # rows of ruptures have no sample before
                    found, verdicts = problem.contributions(coefficients), {}
                    told = right[name].setdefault((view, setting), np.zeros((len(cases), len(CUTS)), bool))
                    for k, cut in enumerate(CUTS):
                        named = chosen(found, *cut)  # the largest first: how many there are says which
                        if len(named) not in verdicts:
                            verdicts[len(named)] = judge(case, problem, named)[1]
                        told[number, k] = verdicts[len(named)]
        print(f"tuning: {number + 1} of {len(cases)}", file=sys.stderr, flush=True)
    best = {}
    for name, settings in right.items():
        for (view, setting), told in settings.items():
            rates = told[clean].mean(axis=0), told[~clean].mean(axis=0)
            score = 0.5 * (rates[0] + rates[1])
            k = int(np.argmax(score))
            if name not in best or (score[k], CUTS[k][2]) > (best[name][0], best[name][3][2]):
                best[name] = (score[k], view, setting, CUTS[k], (rates[0][k], rates[1][k]))
    return best


def describe(best):
    _, (whitened, ruptures), setting, (least, share, most), (clean, hidden) = best
    said = [
        " ".join(str(s) for s in setting),
        "whitened" if whitened else "not whitened",
        "with rows of ruptures" if ruptures else "without rows of ruptures",
        f"at least {least:g} sd and {share:g} of the largest",
        "any number" if most > 3 else f"at most {most}",
    ]
    return f"{'; '.join(said)}\n    on the tuning cases: clean {100 * clean:.0f} %, hidden {100 * hidden:.0f} %"


def rate(count, of):
    if of == 0:
        return "-"
    low, high = wilson(count, of)
    return f"{count}/{of} = {100 * count / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def main():
    folder, figure = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[6])
    tuning_cases, tuning, test_cases, test = map(int, sys.argv[2:6])
    tuned_on = [c for c in load(folder, tuning, tuning_cases) if c.counts() and c.kind != "outside"]
    best = tune(tuned_on)
    cases = load(folder, test, test_cases)
    labels = [r[0] for r in rows(cases)]
    names = ["Stylet", *PEERS]
    table = {n: {r[0]: [0, len(r[1])] for r in rows(cases)} for n in names}
    exact, held = {n: [] for n in names}, {n: [] for n in names}
    false, seconds = {n: [] for n in names}, {n: [] for n in names}
    for number, case in enumerate(cases):
        answers = {"Stylet": (judge_stylet(case), {c[0] for c in case.answer["named"]})}
        seconds["Stylet"].append(case.answer["processor_s"])
        for name, peer in PEERS.items():
            _, view, setting, cut, _ = best[name]
            problem = case.problem(*view)
            start = time.process_time()
            coefficients = peer.fit(problem, setting)
            seconds[name].append(time.process_time() - start)
            named = chosen(problem.contributions(coefficients), *cut)
            answers[name] = (judge(case, problem, named), {n for n, _ in named})
        for name, ((exactly, right), said) in answers.items():
            for label, members, wanted in rows([case]):
                table[name][label][0] += bool(members) and right == wanted
            if case.counts() and case.kind in ("single", "two"):
                exact[name].append(exactly)
                held[name].append(set(case.hidden) <= said)
                false[name].append(len(said - set(case.hidden)))
        print(f"test: {number + 1} of {len(cases)}", file=sys.stderr, flush=True)

    clean = sum(c.kind == "clean" for c in tuned_on)
    print(f"tuned on {clean} clean and {len(tuned_on) - clean} hidden cases of seed {tuning}:")
    for name in PEERS:
        print(f"{name}: {describe(best[name])}")
    print(f"\njudged on {len(cases)} cases of seed {test}:\n")

    def line(label, cell):
        print(f"{label:<46}" + "".join(f"{cell(n):<26}" for n in names).rstrip())

    line("", lambda n: n)
    for label in labels:
        line(label, lambda n: rate(*table[n][label]))
    line("hidden: exactly these named", lambda n: rate(sum(exact[n]), len(exact[n])))
    line("hidden: these among the named", lambda n: rate(sum(held[n]), len(held[n])))
    line("hidden: false names per case", lambda n: f"{np.mean(false[n]):.2f}")
    line("processor s per case: median", lambda n: f"{np.median(seconds[n]):.2f}")
    line("                      p90", lambda n: f"{np.quantile(seconds[n], 0.9):.2f}")
    line("                      largest", lambda n: f"{max(seconds[n]):.2f}")
    before = np.median([c.about["base_s"] + c.about["terms_s"] for c in cases])
    print(f"\nBefore a peer can begin: base fit and columns, {before:.2f} s (median); Stylet's time holds everything.")
    diagnose_figure.draw(figure, table, labels[:6], f"bash benches/peers/diagnose.sh {len(cases)} {test}")


main()
