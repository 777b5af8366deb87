"""Draws the table of `diagnose.sh`: correct answers, and false attributions, with 95 % Wilson intervals.

    python diagnose_draw.py TABLE.txt PICTURE.svg
"""

import pathlib
import re
import sys

import matplotlib

matplotlib.use("svg")
matplotlib.rcParams["svg.hashsalt"] = "stylet"
import matplotlib.pyplot as plt  # noqa: E402

NAMES = {"stylet": "Stylet", "lassocv": "LassoCV", "frols": "FROLS", "stlsq": "STLSQ", "sr3": "SR3"}
COLOURS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#999999"]
HIDDEN = {"clean": "nothing", "one": "one effect", "two": "two effects", "outside": "outside\nthe library"}
ROW = re.compile(r"^\s+(\w+): (\w+), \w+\s+(\S.*?%) \((\d+) to (\d+)\)\s+(\S.*?%) \((\d+) to (\d+)\)")


def read(path):
    """{world: {program: {hidden: (right, low, high, wrong, low, high)}}} in per cent."""
    table, program = {}, None
    for line in path.read_text().splitlines():
        if line.startswith("-- "):
            program = line[3:].strip()
        row = ROW.match(line)
        if row:
            world, hidden, right, *right_ends, wrong, low, high = row.groups()
            share = [100 * int(x.split("/")[0]) / int(x.split("/")[1].split()[0]) for x in (right, wrong)]
            rates = (share[0], *map(int, right_ends), share[1], int(low), int(high))
            table.setdefault(world, {}).setdefault(program, {})[hidden] = rates
    return table


def main(table, picture):
    table = read(table)
    figure, axes = plt.subplots(len(table), 2, figsize=(12, 3.1 * len(table)), sharey=True, squeeze=False)
    for row, (world, programs) in zip(axes, table.items()):
        for axis, first, what in zip(row, (0, 3), ("correct, and nothing else named", "false attribution")):
            for k, (program, name) in enumerate(NAMES.items()):
                rates = [programs[program][hidden] for hidden in HIDDEN]
                at = [g + 0.16 * (k - 2) for g in range(len(HIDDEN))]
                share = [t[first] for t in rates]
                ends = [[max(s - t[first + 1], 0) for s, t in zip(share, rates)], [max(t[first + 2] - s, 0) for s, t in zip(share, rates)]]
                axis.bar(at, share, 0.14, color=COLOURS[k], label=name)
                axis.errorbar(at, share, ends, fmt="none", ecolor="#333333", elinewidth=0.8, capsize=2)
            axis.set_title(f"{world}: {what}", fontsize=10, loc="left")
            axis.set_xticks(range(len(HIDDEN)), list(HIDDEN.values()), fontsize=9)
            axis.set_ylim(0, 105)
            axis.grid(axis="y", color="#dddddd", linewidth=0.6)
            axis.set_axisbelow(True)
            axis.spines[["top", "right"]].set_visible(False)
        row[0].set_ylabel("cases in %", fontsize=9)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=len(NAMES), frameon=False, fontsize=9)
    figure.tight_layout(rect=(0, 0, 1, 0.95))
    figure.savefig(picture, metadata={"Date": None})


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
