"""The online algorithm."""

from __future__ import annotations

import json

import numpy as np

from . import _data, _stylet


def _config(config) -> tuple[str, str]:
    return ("ron", "") if config is None else _data.source(config)


class Enhancer:
    """The online algorithm: `step` for each sample of the force sensor, or `run` for arrays. Arguments are given by keyword.

    `config` is None (the defaults), a path, RON text (`"Enhance(model: KelvinVoigt)"`) or a dict. `storage` is the number of
    samples of a layer that are kept for its re-estimation."""

    def __init__(self, config=None, storage: int = 16384):
        self._inner = _stylet.Enhancer(*_config(config), storage)
        # The compiled methods directly, without a Python call per sample.
        self.__dict__["step"] = self._inner.step
        self.__dict__["enhanced"] = self._inner.enhanced

    def step(self, *, time_s: float, position_m: float, velocity_mps: float, force_n: float) -> _stylet.Output:
        """Processes one sample."""
        return self._inner.step(time_s=time_s, position_m=position_m, velocity_mps=velocity_mps, force_n=force_n)

    def enhanced(self, *, time_s: float, position_m: float, velocity_mps: float, force_n: float) -> float:
        """Processes one sample and returns only the enhanced force in N: the fastest call."""
        return self._inner.enhanced(time_s=time_s, position_m=position_m, velocity_mps=velocity_mps, force_n=force_n)

    def run(self, *, time_s, position_m, velocity_mps=None, force_n) -> dict[str, np.ndarray]:
        """Processes arrays, continuing from the last sample. Returns `enhanced_n`, `error_n`, `state` and `ruptures`, one value per
        sample. Without a velocity, the derivative of the position is used."""
        return self._inner.run(
            time_s=_data.column(time_s),
            position_m=_data.column(position_m),
            velocity_mps=None if velocity_mps is None else _data.column(velocity_mps),
            force_n=_data.column(force_n),
        )

    def reset(self) -> None:
        """Returns to the initial state."""
        self._inner.reset()


class Enhanced:
    """Outputs of the online algorithm on a recording."""

    def __init__(self, inner):
        self._inner = inner
        self._columns = inner.columns()
        self.result: dict = json.loads(inner.json())
        """`enhance.json` as a dict."""
        found = self.result["found"][0]
        self.ruptures: list[dict] = found["ruptures"]
        """Detected ruptures: time, position, located position, detector."""
        self.layers: list[dict] = found["layers"]
        """Estimates of the traversed layers, with 95 % intervals."""

    def html(self) -> str:
        """The report as one HTML page."""
        return self._inner.html()

    def arrays(self) -> dict[str, np.ndarray]:
        """Recording and outputs, one value per sample."""
        return self._columns

    def to_pandas(self):
        return _data.frame(self._columns)

    def plot(self, ax=None):
        """Measured and enhanced force. Returns the axes."""
        ax = _data.axes(ax)
        c = self._columns
        ax.plot(c["time_s"], c["force_n"], color="0.6", lw=1, label="measured")
        ax.fill_between(c["time_s"], c["low_n"], c["high_n"], color="#0072b2", alpha=0.2, lw=0, label="95 %")
        ax.plot(c["time_s"], c["enhanced_n"], color="#0072b2", lw=1.4, label="enhanced")
        for k, rupture in enumerate(self.ruptures):
            ax.axvline(rupture["time_s"], color="#d55e00", lw=1, label=None if k else "detected rupture")
        ax.set(xlabel="time (s)", ylabel="force (N)")
        ax.legend(frameon=False, fontsize="small")
        return ax

    def _repr_html_(self) -> str:
        return _data.embedded(self.html())

    def __repr__(self) -> str:
        return f"Enhanced({len(self._columns['time_s'])} samples, {len(self.ruptures)} ruptures)"


def enhance(data, config=None) -> Enhanced:
    """Runs the online algorithm on a recording: a data frame or dict of arrays with `time_s`, `position_m`, `force_n` (and
    `velocity_mps`), or the path of a CSV file."""
    if isinstance(data, (str, bytes)) or hasattr(data, "__fspath__"):
        data = _data.read_csv(data)
        data.pop("velocity_mps")
    time_s, position_m, force_n, velocity_mps = _data.columns(data)
    return Enhanced(_stylet.enhance(*_config(config), time_s, position_m, force_n, velocity_mps))
