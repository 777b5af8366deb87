"""Many drawn insertions."""

from __future__ import annotations

import json
import os
from pathlib import Path

from . import _data, _stylet


class Sweep:
    """One row per insertion."""

    def __init__(self, inner):
        self._inner = inner
        self.summary: dict = json.loads(inner.summary_json())
        """`summary.json` as a dict: rates with intervals, worst trials, what explains them."""

    def arrays(self) -> dict:
        return self._inner.columns()

    def to_pandas(self):
        """trial, seed, drawn quantities, scores."""
        return _data.frame(self.arrays())

    def html(self) -> str:
        return self._inner.html()

    def plot(self, quantity: str | None = None, score: str = "enhancement.rms_relative", ax=None):
        """A score against a drawn quantity (the first). Returns the axes."""
        columns = self.arrays()
        quantity = quantity or self.summary["drawn"][0]
        ax = _data.axes(ax)[0]
        ax.plot(columns[quantity], columns[score], ".", ms=3, color="#0072b2")
        ax.set(xlabel=quantity, ylabel=score)
        return ax

    def _repr_html_(self) -> str:
        return _data.embedded(self.html())

    def __repr__(self) -> str:
        s = self.summary
        return f"Sweep({s['sweep']!r}: {s['trials']} trials, {s['failed']['value']:.3g} failed)"


def sweep(given, scenario=None, *, trials: int | None = None, seed: int | None = None, progress=None) -> Sweep:
    """Runs a sweep: the path of a sweep file, or a dict (`{"trials": 100, "vary": [{"path": ..., "with": {"Normal": {...}}}]}`)
    over a `scenario` (path, RON text, dict). Ctrl-C ends it."""
    told = _data.Progress(True if progress is None else progress, trials)
    try:
        if isinstance(given, dict):
            if scenario is None:
                raise _stylet.StyletError("a sweep given as a dict needs `scenario`")
            kind, text = _data.source(scenario)
            whole = {"scenario": "scenario.ron"} | given
            inner = _stylet.sweep(None, json.dumps(whole), kind, text, trials, seed, told)
        else:
            inner = _stylet.sweep(Path(os.fspath(given)), None, "ron", "", trials, seed, told)
    finally:
        told.close()
    return Sweep(inner)
