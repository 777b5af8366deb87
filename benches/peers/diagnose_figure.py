"""The picture: accuracy by strength, and false names."""

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402
from diagnose_cases import wilson  # noqa: E402

COLOURS = ["#5b9bd5", "#e69138", "#6aa84f", "#a64d79", "#999999"]
LABELS = [
    "clean:\nfalsely accused",
    "one effect,\nstrong",
    "one effect,\nmedium",
    "one effect,\nfaint",
    "two effects,\nboth",
    "outside the library:\nwrongly named",
]


def draw(path, table, labels, command):
    """Bars with Wilson intervals; `table[name][label]` is (cases counted, cases), `labels` those of the six rows."""
    settings = {"svg.hashsalt": "stylet", "svg.fonttype": "none", "font.family": "sans-serif", "font.size": 11}
    matplotlib.rcParams.update(settings)
    names = list(table)
    fig, axes = plt.subplots(1, 2, figsize=(13, 5.4), gridspec_kw={"width_ratios": [4, 2]}, sharey=True)
    halves = [
        (axes[0], [1, 2, 3, 4], "named, or in its class (higher is better)"),
        (axes[1], [0, 5], "something named that is not there (lower is better)"),
    ]
    width = 0.16
    for axis, which, title in halves:
        for n, name in enumerate(names):
            for place, row in enumerate(which):
                count, of = table[name][labels[row]]
                if of == 0:
                    continue
                low, high = wilson(count, of)
                at = place + (n - 0.5 * (len(names) - 1)) * width
                axis.bar(at, 100 * count / of, 0.92 * width, color=COLOURS[n], label=name if place == 0 else None)
                axis.plot([at, at], [100 * low, 100 * high], color="#222222", lw=1.4)
                axis.text(at, 100 * high + 1.2, str(count), ha="center", va="bottom", fontsize=9)
        axis.set_xticks(range(len(which)), [f"{LABELS[r]}\n({table[names[0]][labels[r]][1]} cases)" for r in which])
        axis.set_title(title, fontsize=10.5)
        axis.set_ylim(0, 112)
        axis.set_yticks(range(0, 101, 20))
        axis.grid(axis="y", color="#dddddd", lw=0.8)
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("cases in %, with 95 % Wilson intervals")
    handles, texts = axes[0].get_legend_handles_labels()
    fig.legend(handles, texts, loc="lower center", ncol=len(names), frameon=False, bbox_to_anchor=(0.5, 0.03))
    fig.text(0.99, 0.008, command, ha="right", va="bottom", fontsize=8, color="#666666")
    fig.tight_layout(rect=(0, 0.1, 1, 1))
    beside = path.with_suffix(".part")
    fig.savefig(beside, format="svg", metadata={"Date": None}, facecolor="white")
    beside.replace(path)
