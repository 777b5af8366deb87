"""A Python callable as the equation of an effect: the same forces and the same diagnosis as its formula, exceptions with their text, and
definitions that objects keep."""

import pickle

import numpy as np
import pytest

import stylet

GEL = (
    'Scenario(name: "one gel", tissue: (layers: [(thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0)]), '
    "motion: Constant(start_m: -0.004, velocity_mps: 0.008, duration_s: 2.0), robot: Replay)"
)
# Three speeds, few samples: a fit calls hundreds of thousands of times.
SPEEDS = (
    'Scenario(name: "one gel", tissue: (layers: [(thickness_m: 0.04, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0)]), '
    "motion: Program(start_m: -0.005, segments: [Move(velocity_mps: 0.008, duration_s: 2.0), Move(velocity_mps: 0.003, duration_s: 1.5), "
    "Move(velocity_mps: -0.006, duration_s: 2.0)]), robot: Replay, sample_hz: 50.0, sensor: ForceTorque(noise_n: 0.01))"
)
DRAG = {"q": {"start": 1e6, "unit": "N s^2/m^3", "inactive": 0.0}}
RELAXING = {"g": {"start": 0.3, "inactive": 0.0}, "tau": {"start": 0.5, "unit": "s"}}


def drag(force="q * v * abs(v) * inserted", name="drag", **fields):
    return stylet.Effect(name, **({"force": force, "parameters": DRAG} | fields))


def dragging(sample, parameters, state):
    return parameters.q * sample.v * abs(sample.v) * sample.inserted


def simulated(effect, scenario=GEL, seed=1):
    return stylet.simulate(stylet.Scenario(scenario).with_effects([effect]), seed=seed)


@pytest.mark.parametrize(
    ("formula", "code", "tolerance_n"),
    [
        (drag(name="formula"), drag(dragging, name="code"), 1e-12),
        (
            drag("force + q * v * abs(v) * b", name="formula", place="Sensor", parameters=DRAG | {"b": {"start": 0.01, "unit": "m"}}),
            drag(
                lambda s, p, _: s.force + p.q * s.v * abs(s.v) * p.b,
                name="code",
                place="Sensor",
                parameters=DRAG | {"b": {"start": 0.01, "unit": "m"}},
            ),
            1e-12,
        ),
        (
            drag("-x", name="formula", place="Elastic", parameters=RELAXING, state={"x": "dx/dt = (g*elastic - x)/tau"}),
            drag(
                lambda _, __, state: -state.x,
                name="code",
                place="Elastic",
                parameters=RELAXING,
                state={"x": lambda sample, p, state: (p.g * sample.elastic - state.x) / p.tau},
            ),
            # The derivative of a rate by its state is a difference quotient, with errors of 1e-10.
            1e-9,
        ),
    ],
    ids=["friction", "sensor", "state"],
)
def test_a_callable_gives_the_forces_of_its_formula(formula, code, tolerance_n):
    plain = stylet.simulate(GEL, seed=1).arrays()["force_n"]
    expected, found = (simulated(effect).arrays()["force_n"] for effect in (formula, code))
    assert np.abs(expected - plain).max() > 0.1
    assert np.abs(found - expected).max() < tolerance_n


def test_a_callable_gives_the_diagnosis_of_its_formula():
    code, formula = drag(dragging, name="twin"), drag(name="twin")
    recordings = []
    for seed in (1, 2):
        arrays = simulated(formula, SPEEDS, seed).arrays()
        recordings.append({name: arrays[name] for name in ("time_s", "position_m", "force_n", "velocity_mps")})
    expected, found = (
        stylet.diagnose(stylet.Scenario(SPEEDS).with_effects(candidates=[effect]), recordings, progress=False) for effect in (formula, code)
    )
    assert [cause["effect"] for cause in expected.result["causes"]] == ["twin"]
    assert found.result == expected.result
    assert "force:" not in found.extended_ron().split('name: "twin"')[1].split("parameters")[0]
    assert np.array_equal(found.predict(recordings[0]), expected.predict(recordings[0]))
    lights = [stylet.check(stylet.Scenario(SPEEDS).with_effects(candidates=[e]), recordings).result for e in (formula, code)]
    assert lights[0] == lights[1]


def test_an_exception_is_the_error_of_a_simulation():
    def late(sample, parameters, state):
        return parameters.q / (sample.z - sample.z if sample.z > 0.005 else 1e9)

    with pytest.raises(stylet.StyletError, match="with late: .*effect `late` raised ZeroDivisionError: float division by zero") as raised:
        simulated(drag(late, name="late"))
    assert isinstance(raised.value.__cause__, ZeroDivisionError)

    with pytest.raises(stylet.StyletError, match="the result is 'much', where a number is expected"):
        simulated(drag(lambda sample, p, _: "much" if sample.z > 0.005 else 0.0, name="worded"))


def test_what_is_misspelt_shows_where_the_effect_is_defined():
    with pytest.raises(stylet.StyletError, match="effect `drag`: AttributeError: there is no `force` here, but t, z, v"):
        drag(lambda sample, p, _: p.q * sample.force)
    with pytest.raises(stylet.StyletError, match="the result is None"):
        drag(lambda sample, p, _: None)
    with pytest.raises(stylet.StyletError, match="state.x: is a formula, and the force is code"):
        drag(dragging, state={"x": "dx/dt = v"})
    with pytest.raises(stylet.StyletError, match="force: must be zero where every strength has its inactive value"):
        drag(lambda sample, p, _: 1.0)


def test_an_exception_in_a_fit_rejects_the_values_and_is_a_warning():
    def picky(sample, parameters, state):
        if abs(parameters.q) > 3e5:
            raise OverflowError("too fast")
        return dragging(sample, parameters, state)

    arrays = stylet.simulate(SPEEDS, seed=1).arrays()
    recording = {name: arrays[name] for name in ("time_s", "position_m", "force_n")}
    searched = stylet.Scenario(SPEEDS).with_effects(candidates=[drag(picky, name="picky")])
    with pytest.warns(RuntimeWarning, match=r"effect `picky` raised OverflowError: too fast \(\d+ calls\); the values"):
        found = stylet.diagnose(searched, [recording], progress=False)
    assert found.result["causes"] == []


def test_a_later_definition_replaces_the_name_and_not_the_objects():
    first = drag(dragging, name="again")
    before = stylet.Scenario(GEL).with_effects([first])
    forces = stylet.simulate(before, seed=1).arrays()["force_n"]
    second = drag(lambda s, p, _: 2.0 * dragging(s, p, _), name="again")
    assert np.array_equal(stylet.simulate(before, seed=1).arrays()["force_n"], forces)
    assert np.array_equal(simulated(first).arrays()["force_n"], forces)

    doubled = simulated(second).arrays()["force_n"]
    assert np.abs(doubled - forces).max() > 0.1
    assert 'name: "again"' in before.to_ron()
    assert np.array_equal(stylet.simulate(stylet.Scenario(before.to_ron()), seed=1).arrays()["force_n"], doubled)
    assert pickle.loads(pickle.dumps(before)).to_ron() == before.to_ron()


def test_a_text_that_names_an_effect_that_is_not_defined_says_what_to_do():
    text = stylet.Scenario(GEL).with_effects([drag(dragging, name="here")]).to_ron()
    with pytest.raises(stylet.StyletError, match=r"effects\[0\].force: is left out, and this program defines no effect `there`"):
        stylet.Scenario(text.replace('"here"', '"there"'))
    with pytest.raises(stylet.StyletError, match=r"effects\[0\].parameters.q.unit: differs from the definition of `here`"):
        stylet.Scenario(text.replace("N s^2/m^3", "N"))
