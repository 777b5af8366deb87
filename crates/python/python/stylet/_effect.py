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

    A callable is for exploration: it is slower than a formula (`crates/python/callable_speed.py`), and units are not checked. It must
    be a pure function: the same arguments give the same result. It is called by one thread at a time, not always the same, and
    must not call `stylet`. An exception is the error of `simulate`; a fit rejects the parameter values, and a warning has the
    first exception.

    The text of a scenario only names an effect in code, and gets the definition of this name that is the last when the text is
    read; so does a sweep, which writes and reads its scenario. `Effect`, `Scenario` and results keep their definition. Definitions
    stay in memory until the program ends.
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
        state = state or {}
        rates = [rate for rate in state.values() if callable(rate)]
        equations = {key: "" if callable(rate) else rate for key, rate in state.items()}
        code = force if callable(force) else None
        text: dict = {"name": name, "place": place, "parameters": parameters, "state": equations, "source": source}
        if not code:
            text["force"] = force
        self._json = json.dumps({"Custom": text})
        self.checked = _stylet.define_effect(json.dumps(text), code, rates)
        """The effect as the compiled functions take it."""

    def json(self) -> str:
        """The effect as an entry of `effects` or `candidates` of a scenario in JSON."""
        return self._json

    def __repr__(self) -> str:
        return f"Effect({self.name!r})"
