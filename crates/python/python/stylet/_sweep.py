"""Sweeps: insertions with random parameters."""

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
        """Data frame: trial, seed, varied parameters, scores."""
        return _data.frame(self.arrays())

    def html(self) -> str:
        return self._inner.html()

    def plot(self, quantity: str | None = None, score: str = "enhancement.rms_relative", ax=None):
        """A score over a varied parameter (by default the first). Returns the axes."""
        columns = self.arrays()
        quantity = quantity or self.summary["drawn"][0]
        ax = _data.axes(ax)
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
    and its `scenario` (path, RON text, dict). Ctrl-C ends it."""
    bar = _data.Progress(True if progress is None else progress, trials)
    try:
        if isinstance(given, dict):
            if "scenario" in given:
                raise _stylet.StyletError(
                    "the dict of a sweep has no entry `scenario`: pass it as the second argument, sweep({...}, scenario)"
                )
            if scenario is None:
                raise _stylet.StyletError("a sweep given as a dict needs a second argument: sweep({...}, scenario)")
            whole = {"scenario": "scenario.ron"} | given
            inner = _stylet.sweep(None, json.dumps(whole), _data.scenario(scenario), trials, seed, bar)
        else:
            inner = _stylet.sweep(Path(os.fspath(given)), None, None, trials, seed, bar)
    finally:
        bar.close()
    return Sweep(inner)
