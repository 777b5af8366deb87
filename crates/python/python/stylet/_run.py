"""Simulated insertions."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from . import _data, _stylet


class Scenario:
    """A checked scenario: from a path, RON text or a dict (enum variants as in JSON: `{"Constant": {...}}`)."""

    def __init__(self, given):
        if not isinstance(given, _stylet.CheckedScenario):
            given = _stylet.load_scenario(*_data.source(given))
        self.checked = given
        """The scenario as the compiled functions take it."""

    def to_ron(self) -> str:
        """The scenario with every default written out."""
        return self.checked.to_ron()

    def __reduce__(self):
        return Scenario, (self.to_ron(),)

    def with_effects(self, effects=(), candidates=()) -> Scenario:
        """The scenario with further effects, and with further effects that a diagnosis searches for (`Effect`)."""
        return Scenario(self.checked.with_effects([e.checked for e in effects], [e.checked for e in candidates]))

    def __repr__(self) -> str:
        return self.to_ron()


class Run:
    """A simulated insertion: recording, truth, outputs of the online algorithm, scores."""

    def __init__(self, inner):
        self._inner = inner
        self.score: dict = json.loads(inner.score_json())
        """`score.json` as a dict."""

    @property
    def name(self) -> str:
        return self._inner.name

    @property
    def hash(self) -> str:
        """Hash over the results; the same scenario and seed give the same hash."""
        return self._inner.hash

    @property
    def combinations(self) -> list[str]:
        """Algorithm, model and sensor, such as `paper/ml/force_torque`."""
        return self._inner.combinations

    def arrays(self, combination: int = 0) -> dict[str, np.ndarray]:
        """Recording, truth and outputs, one value per sample."""
        return self._inner.columns(combination)

    def to_pandas(self, combination: int = 0):
        """The same as a data frame."""
        return _data.frame(self.arrays(combination))

    @property
    def ruptures_s(self) -> list[float]:
        """Times of the detected ruptures."""
        return self._inner.ruptures_s()

    @property
    def true_ruptures_s(self) -> list[float]:
        return self._inner.true_ruptures_s()

    def score_json(self) -> bytes:
        """`score.json`, the bytes that the command writes."""
        return bytes(self._inner.score_json())

    def recording_csv(self) -> bytes:
        """`recording.csv`, the bytes that the command writes."""
        return bytes(self._inner.recording_csv())

    def scenario_ron(self) -> str:
        return self._inner.scenario_ron()

    def html(self) -> str:
        """The report as one page."""
        return self._inner.html()

    def write(self, folder) -> None:
        """Writes the files of `stylet run` into a folder, all or none."""
        self._inner.write(Path(folder))

    def plot(self, combination: int = 0, ax=None):
        """Measured, enhanced and true tip force; a line at each detected rupture. Returns the axes."""
        new = ax is None
        ax = _data.axes(ax)
        c = self.arrays(combination)
        ax.plot(c["time_s"], c["force_n"], color="0.6", lw=1, label="measured")
        ax.plot(c["time_s"], c["true_tip_force_n"], color="k", lw=1, ls="--", label="true tip force")
        ax.plot(c["time_s"], c["enhanced_n"], color="#0072b2", lw=1.4, label="enhanced")
        for k, t in enumerate(self._inner.ruptures_s(combination)):
            ax.axvline(t, color="#d55e00", lw=1, label=None if k else "detected rupture")
        ax.set(xlabel="time (s)", ylabel="force (N)")
        if new:
            ax.set_title(self.name, loc="left", fontsize="medium")
        ax.legend(frameon=False, fontsize="small")
        return ax

    def _repr_html_(self) -> str:
        return _data.embedded(self.html())

    def __repr__(self) -> str:
        of = len(self.true_ruptures_s)
        score = self.score if "missed" in self.score else next(iter(self.score["runs"].values()))
        return f"Run({self.name!r}: {of - score['missed']} of {of} ruptures found, {score['false']} false)"


def simulate(scenario, seed: int | None = None, compare: bool = False) -> Run:
    """Simulates a scenario (path, RON text, dict or `Scenario`), runs the online algorithm on it and scores the result.

    `seed` replaces the scenario's; `compare` runs both tissue models. Gives the same bytes as `stylet run`."""
    return Run(_stylet.simulate(_data.scenario(scenario), seed, compare))
