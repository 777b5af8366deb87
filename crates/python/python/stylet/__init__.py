"""Robot-assisted needle insertion into layered tissue: simulation, online estimation, diagnosis of measured data.

>>> import stylet
>>> run = stylet.simulate("three_layer_latex_constant.ron")   # doctest: +SKIP
>>> run.score["missed"], run.to_pandas(), run.plot()          # doctest: +SKIP

SI units everywhere; names carry their unit. Research software, not a medical device.
"""

from ._core import Enhanced, Enhancer, enhance
from ._data import read_csv
from ._diagnosis import Check, Diagnosis, check, diagnose, identify
from ._effect import Effect
from ._plan import Plan, plan
from ._run import Run, Scenario, simulate
from ._stylet import Output, StyletError, __version__
from ._sweep import Sweep, sweep

STATES = (
    "NoRupture",
    "ExpectedRupture",
    "DetectedRupture",
    "ForceDropMeasuring",
    "ForceCompensation",
    "FreeTip",
)
"""Names of the codes in a column `state`."""

__all__ = [
    "Check",
    "Diagnosis",
    "Effect",
    "Enhanced",
    "Enhancer",
    "Output",
    "Plan",
    "Run",
    "STATES",
    "Scenario",
    "StyletError",
    "Sweep",
    "__version__",
    "check",
    "diagnose",
    "enhance",
    "identify",
    "plan",
    "read_csv",
    "simulate",
    "sweep",
]
