"""The online core."""

from __future__ import annotations

import json

import numpy as np

from . import _data, _stylet


def _config(config) -> tuple[str, str]:
    return ("ron", "") if config is None else _data.source(config)


class Enhancer:
    """The online core: one `step` per sample of the force sensor, or `run` over arrays.

    `config` is None (the defaults), a path, RON text (`"Enhance(model: KelvinVoigt)"`) or a dict. `storage` is how many
    samples of a layer are kept for its re-estimation."""

    def __init__(self, config=None, storage: int = 16384):
        self._inner = _stylet.Enhancer(*_config(config), storage)
        self.step = self._inner.step
        """step(time_s, position_m, velocity_mps, force_n) -> Output"""
        self.enhanced = self._inner.enhanced
        """enhanced(time_s, position_m, velocity_mps, force_n) -> enhanced force in N, the quickest way"""

    def run(self, time_s, position_m, force_n, velocity_mps=None) -> dict[str, np.ndarray]:
        """Many samples; goes on from the last: `enhanced_n`, `error_n`, `state`, `ruptures`, one value per sample. Without a
        velocity it is the slope of the position."""
        velocity = None if velocity_mps is None else _data.column(velocity_mps)
        return self._inner.run(
            _data.column(time_s), _data.column(position_m), velocity, _data.column(force_n)
        )

    def reset(self) -> None:
        """Forgets every sample."""
        self._inner.reset()


class Enhanced:
    """What the core made of a recording."""

    def __init__(self, inner):
        self._inner = inner
        self._columns = inner.columns()
        self.result: dict = json.loads(inner.json())
        """`enhance.json` as a dict."""
        found = self.result["found"][0]
        self.ruptures: list[dict] = found["ruptures"]
        """Declared ruptures: instant, position that the drop was traced back to, what declared it."""
        self.layers: list[dict] = found["layers"]
        """Estimates of the traversed layers, each number with its 95 % interval."""

    def html(self) -> str:
        """The report, a page of its own."""
        return self._inner.html()

    def arrays(self) -> dict[str, np.ndarray]:
        """Recording and outputs, one value per sample."""
        return self._columns

    def to_pandas(self):
        return _data.frame(self._columns)

    def plot(self, ax=None):
        """Measured and enhanced force. Returns the axes."""
        ax = _data.axes(ax)[0]
        c = self._columns
        ax.plot(c["time_s"], c["force_n"], color="0.6", lw=1, label="measured")
        ax.fill_between(c["time_s"], c["low_n"], c["high_n"], color="#0072b2", alpha=0.2, lw=0, label="95 %")
        ax.plot(c["time_s"], c["enhanced_n"], color="#0072b2", lw=1.4, label="enhanced")
        for k, rupture in enumerate(self.ruptures):
            ax.axvline(rupture["time_s"], color="#d55e00", lw=1, label=None if k else "rupture found")
        ax.set(xlabel="time (s)", ylabel="force (N)")
        ax.legend(frameon=False, fontsize="small")
        return ax

    def _repr_html_(self) -> str:
        return _data.embedded(self.html())

    def __repr__(self) -> str:
        return f"Enhanced({len(self._columns['time_s'])} samples, {len(self.ruptures)} ruptures)"


def enhance(data, config=None) -> Enhanced:
    """Runs the core over a recording: a data frame or dict of arrays with `time_s`, `position_m`, `force_n` (and
    `velocity_mps`), a tuple in this order, or the path of a CSV."""
    if isinstance(data, (str, bytes)) or hasattr(data, "__fspath__"):
        data = _data.read_csv(data)
        data.pop("velocity_mps")
    time_s, position_m, force_n, velocity_mps = _data.columns(data)
    return Enhanced(_stylet.enhance(*_config(config), time_s, position_m, force_n, velocity_mps))
