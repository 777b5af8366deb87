"""Effects that the library does not have."""

from __future__ import annotations

import json


class Effect:
    """An effect given by a formula, for `Scenario.with_effects`.

    `parameters` maps names to dicts with `start`, `unit`, `inactive` (of strengths), `value` and `prior`, for example
    `{"LogNormal": {"median": 0.002, "factor": 2.0}}`; `state` maps names to equations `"dx/dt = ..."`. Places, variables and
    functions: docs/how-to/custom_effects.md.

    >>> drag = Effect("quadratic_drag", force="q * v * abs(v) * inserted",
    ...               parameters={"q": {"start": 1e6, "unit": "N s^2/m^3", "inactive": 0.0}})
    """

    def __init__(self, name: str, force: str, parameters: dict, place: str = "Friction", state: dict | None = None, source: str = ""):
        self.name = name
        self._json = json.dumps({"Custom": {"name": name, "place": place, "force": force, "parameters": parameters,
                                            "state": state or {}, "source": source}})

    def json(self) -> str:
        """The effect as an entry of `effects` or `candidates` of a scenario in JSON."""
        return self._json

    def __repr__(self) -> str:
        return f"Effect({self.name!r})"
