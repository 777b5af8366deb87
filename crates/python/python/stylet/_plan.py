"""Planning of the next insertion."""

from __future__ import annotations

import json
import os

from . import _data, _stylet
from ._diagnosis import recordings


class Plan:
    """The motion that best separates the remaining candidate causes, and the probability that it decides."""

    def __init__(self, inner):
        self._inner = inner
        self.result: dict = json.loads(inner.json())
        """`plan.json` as a dict."""

    @property
    def probability_decided(self) -> float:
        """Probability that the next diagnosis identifies the correct single cause."""
        return self.result["probability_decided"]

    @property
    def pairs(self):
        """A table: two candidates, nats between them before and after, whether any motion within the limits separates them."""
        return _data.frame(self.result["pairs"])

    def motion_ron(self) -> str:
        """The motion: for `stylet run --motion`, or as `motion` of a scenario."""
        return self._inner.motion_ron()

    def json(self) -> bytes:
        """`plan.json`, the bytes that the command writes."""
        return bytes(self._inner.json())

    def html(self) -> str:
        """The report as one HTML page."""
        return self._inner.html()

    def plot(self, ax=None):
        """Nats between the candidates before and after the planned insertion. Returns the axes."""
        ax = _data.axes(ax)
        pairs = [p for p in self.result["pairs"] if p["distinguishable"]]
        names = [f"{p['a']} | {p['b']}" for p in pairs]
        rows = range(len(pairs))
        ax.barh([r + 0.2 for r in rows], [p["nats_before"] for p in pairs], 0.4, color="0.7", label="now")
        ax.barh([r - 0.2 for r in rows], [p["nats_after"] for p in pairs], 0.4, color="#0072b2", label="after the insertion")
        ax.set_yticks(list(rows), names)
        ax.set_xscale("symlog", linthresh=1.0)
        ax.set_xlabel("expected gap of the log-likelihoods (nats)")
        ax.legend(frameon=False, fontsize="small")
        return ax

    def _repr_html_(self) -> str:
        return _data.embedded(self.html())

    def __repr__(self) -> str:
        r = self.result
        return (
            f"Plan({r['duration_s']:.3g} s to {1e3 * r['depth_m']:.3g} mm, decided with probability "
            f"{r['probability_decided']:.2f}, now {r['probability_now']:.2f})"
        )


def plan(assumed, measured=(), *, limits, columns=None, repair: bool = False, simulated: bool = True, progress=None) -> Plan:
    """Plans the next insertion: after the recordings `measured` (as for `diagnose`), or, without any, before the first.

    `limits`: dict, RON text or path: `depth_m`, `speed_mps`, `acceleration_mps2`, `duration_s`, `force_n`. `simulated`: the best
    motions are simulated under the likeliest candidates and diagnosed (up to a minute). Gives the same plan as `stylet plan`."""
    given, _ = recordings(measured)
    bar = _data.Progress(True if progress is None else progress)
    try:
        inner = _stylet.plan(
            _data.scenario(assumed), given, _data.source(limits), (columns and os.fspath(columns), repair), simulated, bar
        )
    finally:
        bar.close()
    return Plan(inner)
