"""Effects that the library does not have."""

from __future__ import annotations

import json
from typing import Callable

from . import _stylet


class Effect:
    """An effect given by a formula or by Python code, for `Scenario.with_effects`.

    `parameters` maps names to dicts with `start`, `unit`, `inactive` (of strengths), `value` and `prior`, for example
    `{"LogNormal": {"median": 0.002, "factor": 2.0}}`; `state` maps names to equations `"dx/dt = ..."`. Places, variables and
    functions: docs/how-to/custom_effects.md.

    >>> drag = Effect("quadratic_drag", force="q * v * abs(v) * inserted",
    ...               parameters={"q": {"start": 1e6, "unit": "N s^2/m^3", "inactive": 0.0}})

    `force` can also be a callable `force(sample, parameters, state)` that returns a number, and the values of `state` then
    callables with the same arguments that return the rate of the state. The arguments have the variables, parameters and
    states as attributes:

    >>> drag = Effect("quadratic_drag", force=lambda sample, p, state: p.q * sample.v * abs(sample.v) * sample.inserted,
    ...               parameters={"q": {"start": 1e6, "unit": "N s^2/m^3", "inactive": 0.0}})

    A callable must be a pure function: the same arguments give the same result. It is called from several threads, from one
    at a time, and must not call `stylet`. Units are not checked. It is for exploration: the time of a formula is in
    `crates/python/speed.py`. An exception is the error of `simulate`; a fit rejects the parameter values, and a warning has the
    first exception. Text of a scenario only names the effect: it can be read after the effect was defined, and gets the
    definition that was the last then. Objects keep theirs.
    """

    def __init__(
        self,
        name: str,
        force: str | Callable,
        parameters: dict,
        place: str = "Friction",
        state: dict[str, str | Callable] | None = None,
        source: str = "",
    ):
        self.name = name
        rates = (state or {}).items()
        text = {"name": name, "place": place, "parameters": parameters, "source": source}
        text["state"] = {key: "" if callable(rate) else rate for key, rate in rates}
        code = force if callable(force) else None
        if code is None:
            text["force"] = force
        self._json = json.dumps({"Custom": text})
        self.checked = _stylet.define_effect(json.dumps(text), code, [rate for _, rate in rates if callable(rate)])
        """The effect as the compiled functions take it."""

    def json(self) -> str:
        """The effect as an entry of `effects` or `candidates` of a scenario in JSON."""
        return self._json

    def __repr__(self) -> str:
        return f"Effect({self.name!r})"
