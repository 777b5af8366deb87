"""An effect defined in Python is simulated, and is a candidate of a diagnosis; a wrong formula says what is wrong."""

import numpy as np
import pytest

import stylet

GEL = (
    'Scenario(name: "one gel", tissue: (layers: [(thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0)]), '
    "motion: Constant(start_m: -0.004, velocity_mps: 0.008, duration_s: 2.0), robot: Replay)"
)


def drag(force="q * v * abs(v) * inserted", unit="N s^2/m^3"):
    return stylet.Effect("quadratic_drag", force=force, parameters={"q": {"start": 1e6, "unit": unit, "inactive": 0.0}})


def test_an_effect_changes_the_simulated_force():
    gel = stylet.Scenario(GEL)
    plain, dragged = (stylet.simulate(s, seed=1).arrays() for s in (gel, gel.with_effects([drag()])))
    assert np.abs(dragged["force_n"] - plain["force_n"]).max() > 0.1
    assert "quadratic_drag" in gel.with_effects(candidates=[drag()]).to_ron()


def test_units_that_do_not_fit_are_refused_at_their_place():
    with pytest.raises(stylet.StyletError, match="the formula has N m/s, and N is expected"):
        stylet.Scenario(GEL).with_effects([drag("q * v", "N")])
