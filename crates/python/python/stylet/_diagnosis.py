"""Diagnosis of measured recordings."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np

from . import _data, _stylet
from ._run import Scenario


class Diagnosis:
    """Verdict, causes with intervals, extended scenario, gain."""

    def __init__(self, inner, measured, read):
        self._inner = inner
        self._measured = measured
        self._read = read
        self.result: dict = json.loads(inner.json())
        """`diagnosis.json` as a dict."""

    @property
    def verdict(self) -> str:
        """`none`, `named`, `ambiguous`, `unknown` or `parameters`."""
        return self.result["verdict"]

    @property
    def agrees(self) -> bool:
        """Whether the simulation agrees with the data: no effect is missing, and no finding contradicts."""
        return self.result["agrees"]

    @property
    def findings(self) -> list[str]:
        """What contradicts agreement or limits the confidences, one sentence each."""
        return [finding["message"] for finding in self.result["findings"]]

    @property
    def gain(self) -> dict:
        """RMS before and after, and noise floor, in N."""
        return self.result["gain"]

    @property
    def causes(self):
        """A table: effect, parameter, value, low, high, whether it is at a bound, confidence."""
        return _data.frame(self._rows())

    def _rows(self) -> list[dict]:
        return [
            {"effect": cause["effect"], "parameter": name, **{k: p[k] for k in ("value", "low", "high")}}
            | {"at_bound": name in cause.get("at_bound", []), "confidence": cause["confidence"]}
            for cause in self.result["causes"]
            for name, p in (cause["parameters"] or {"": {"value": np.nan, "low": np.nan, "high": np.nan}}).items()
        ]

    @property
    def base_parameters(self):
        """A table: assumed and fitted parameters of the layers; where `at_least` is set only `low` is known."""
        return _data.frame(self.result["base_parameters"])

    @property
    def parameters(self):
        """A table: what the recordings say about each parameter (`label`), and with which other one it trades."""
        return _data.frame(self.result["parameters"])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the `parameters`, in their order and units."""
        return np.array(self.result["covariance"])

    @property
    def grade(self) -> str:
        """`A` to `D`; `result["grade"]["parts"]` has the reasons."""
        return self.result["grade"]["letter"]

    @property
    def extended(self) -> Scenario:
        """The scenario with re-fitted parameters and the effects found."""
        return Scenario(self._inner.extended())

    def extended_ron(self) -> str:
        """`extended.ron`, the text that the command writes."""
        return self._inner.extended_ron()

    def json(self) -> bytes:
        """`diagnosis.json`, the bytes that the command writes."""
        return bytes(self._inner.json())

    def predict(self, data) -> np.ndarray:
        """Force in N of the extended scenario along a recorded motion (a data frame or dict of arrays)."""
        time_s = _data.column(data["time_s"])
        velocity = _data.column(data["velocity_mps"]) if "velocity_mps" in data else None
        return self._inner.predict(time_s, _data.column(data["position_m"]), velocity)

    def write(self, folder) -> None:
        """Writes `diagnosis.json` and `extended.ron`."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in (("diagnosis.json", self.json()), ("extended.ron", self.extended_ron().encode())):
            part = folder / f".{name}.part"
            part.write_bytes(content)
            os.replace(part, folder / name)

    def plot(self, recording: int = 0, ax=None):
        """Measured force, prediction of the extended scenario and residual of one recording, by its index. Returns the axes."""
        name, data = self._measured[recording]
        if not isinstance(data, dict):
            data = _stylet.read_csv(os.fspath(data), *self._read)[0]
        ax = _data.axes(ax)
        predicted = self.predict(data)
        ax.plot(data["time_s"], data["force_n"], color="0.6", lw=1, label="measured")
        ax.plot(data["time_s"], predicted, color="#0072b2", lw=1.2, label="extended scenario")
        ax.plot(data["time_s"], data["force_n"] - predicted, color="#d55e00", lw=0.8, label="residual")
        ax.set_title(name, loc="left", fontsize="medium")
        ax.set(xlabel="time (s)", ylabel="force (N)")
        ax.legend(frameon=False, fontsize="small")
        return ax

    def __repr__(self) -> str:
        names = ", ".join(c["effect"] for c in self.result["causes"]) or "nothing"
        gain = self.gain
        return (
            f"Diagnosis({self.verdict}: {names}; residual {gain['rmse_before_n']:.3g} -> "
            f"{gain['rmse_after_n']:.3g} N, noise {gain['floor_n']:.3g} N)"
        )

    def html(self) -> str:
        """The report as one HTML page."""
        return self._inner.html()

    def _repr_html_(self) -> str:
        return _data.embedded(self.html())


def recordings(measured, names=None) -> tuple[list, list]:
    """Recordings as the compiled module takes them, and as they are kept for plots."""
    if isinstance(measured, (str, os.PathLike, dict)) or hasattr(measured, "columns"):
        measured = [measured]
    given: list = []
    kept: list = []
    for k, one in enumerate(measured):
        if isinstance(one, (str, os.PathLike)):
            given.append(os.fspath(one))
            kept.append((Path(one).name, one))
        else:
            name = names[k] if names else f"recording {k + 1}"
            time_s, position_m, force_n, velocity_mps = _data.columns(one)
            given.append((name, time_s, position_m, force_n, velocity_mps))
            data = {"time_s": time_s, "position_m": position_m, "force_n": force_n}
            kept.append((name, data if velocity_mps is None else data | {"velocity_mps": velocity_mps}))
    return given, kept


def diagnose(
    assumed, measured, *, columns=None, repair: bool = False, force: bool = False, names=None, progress=None
) -> Diagnosis:
    """Compares an assumed scenario with measured recordings.

    `assumed`: path, RON text, dict or `Scenario`. `measured`: paths of CSV files, data frames, or dicts of arrays with
    `time_s`, `position_m`, `force_n` (and `velocity_mps`). With two or more the gain is measured on held-out recordings.
    `columns`: path of a column map for the files. `force`: diagnose although `check` says that the result would mean nothing.
    `progress`: True, False, or a callable `(text, count)`; by default shown where tqdm is there. Ctrl-C ends it. Gives the same bytes as `stylet diagnose`."""
    given, kept = recordings(measured, names)
    if not given:
        raise _stylet.StyletError("no recordings: give at least one")
    bar = _data.Progress(True if progress is None else progress)
    try:
        inner = _stylet.diagnose(_data.scenario(assumed), given, columns and os.fspath(columns), repair, force, bar)
    finally:
        bar.close()
    return Diagnosis(inner, kept, (columns and os.fspath(columns), repair))


def identify(measured, *, layers: int | None = None, columns=None, repair: bool = False, names=None, progress=None) -> Diagnosis:
    """Finds the layers that recordings show, `layers` of them or as many as there are, and diagnoses what is left.

    Arguments as for `diagnose`, without a scenario. `.extended` is the phantom, `.base_parameters` its numbers. Gives the same bytes as
    `stylet identify`."""
    given, kept = recordings(measured, names)
    if not given:
        raise _stylet.StyletError("no recordings: give at least one")
    bar = _data.Progress(True if progress is None else progress)
    try:
        inner = _stylet.identify(given, layers, columns and os.fspath(columns), repair, bar)
    finally:
        bar.close()
    return Diagnosis(inner, kept, (columns and os.fspath(columns), repair))


class Check:
    """What recordings can show, before a diagnosis."""

    def __init__(self, text: str, html: str):
        self.result: dict = json.loads(text)
        """`check.json` as a dict."""
        self._text, self._html = text, html

    @property
    def usable(self) -> bool:
        """Whether a diagnosis would mean anything."""
        return all(item["light"] != "unusable" for item in self.result["items"])

    @property
    def items(self):
        """A table: topic, light (`good`, `limited`, `unusable`), message."""
        return _data.frame(self.result["items"])

    @property
    def parameters(self):
        """A table: what the recordings say about each parameter of the layers."""
        return _data.frame(self.result["parameters"])

    @property
    def effects(self):
        """A table: effect, whether its typical size would be seen, and the smallest size that would."""
        return _data.frame(self.result["effects"])

    def json(self) -> bytes:
        """`check.json`, the bytes that the command writes."""
        return self._text.encode()

    def html(self) -> str:
        """The report as one HTML page."""
        return self._html

    def _repr_html_(self) -> str:
        return _data.embedded(self.html())

    def __repr__(self) -> str:
        lights = [item["light"] for item in self.result["items"]]
        return f"Check({', '.join(f'{lights.count(x)} {x}' for x in ('good', 'limited', 'unusable'))})"


def check(assumed, measured, *, columns=None, repair: bool = False, names=None) -> Check:
    """What recordings can show about an assumed scenario: data, contact, motion, parameters, effects.

    Arguments as for `diagnose`. Gives the same bytes as `stylet check`."""
    given, _ = recordings(measured, names)
    return Check(*_stylet.check(_data.scenario(assumed), given, columns and os.fspath(columns), repair))
