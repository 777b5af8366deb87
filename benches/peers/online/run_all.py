"""Runs the benchmark of online puncture detection: run_all.py STYLET [--cases 100] [--seed S] [--out DIR] [--entrants a,b]

Sets up the entrants, exports the streams, has every entrant answer them, two side by side, judges all answers in one call and prints the
table; the page is in DIR/page. Stylet's own entrants are `Stylet` and `Paper`. Settings are those that tune.py chose (chosen.json), or else the
programs' defaults.
"""

import argparse
import pathlib
import shutil
import subprocess

from common import HERE, Bench, in_pairs, load

OWN = ["Stylet", "Paper"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stylet")
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--split", default="judge")
    parser.add_argument("--world", default="plain", help="plain or rich")
    parser.add_argument("--measured", help="data set whose insertions form the row `measured`")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("target/online-benchmark"))
    parser.add_argument("--env", type=pathlib.Path, default=pathlib.Path("target/peers-online"))
    parser.add_argument("--entrants", help="only these, with commas between")
    options = parser.parse_args()
    settings = load("settings.json")
    chosen = load("chosen.json") if (HERE / "chosen.json").exists() else {}
    names = options.entrants.split(",") if options.entrants else OWN + list(settings)
    if set(names) - set(OWN):
        subprocess.run([HERE / "setup.sh", options.env.resolve()], check=True)
    bench = Bench(options.stylet, options.env, options.out)
    bench.export(options.split, options.cases, options.seed, options.world, options.measured)

    def answer(name):
        if name in OWN:
            bench.own_answers(name)
        else:
            bench.answers(name, settings[name], chosen.get(name, {}))
        print(f"{name} has answered", flush=True)

    in_pairs(answer, names)
    page = bench.out / "page"
    if page.exists():
        shutil.rmtree(page)
    print(bench.call("judge-online", bench.streams, *map(bench.folder, names), "--out", page), end="")
    print(f"page: {page}")


if __name__ == "__main__":
    main()
