"""Time with an effect given by a Python callable, compared with the same effect as a formula, in the same run.

    crates/python/test.sh --release --collect-only >/dev/null      # builds the module in release
    PYTHONPATH=target/python-module target/python/bin/python crates/python/callable_speed.py
"""

import sys
import time

import stylet

SCENARIO = """Scenario(
    name: "two gels",
    tissue: (layers: [
        (thickness_m: 0.01, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.4),
        (thickness_m: 0.02, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0),
    ]),
    motion: Program(start_m: -0.005, segments: [
        Move(velocity_mps: 0.003, duration_s: 5.0), Hold(duration_s: 1.0),
        Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 4.0),
        Move(velocity_mps: -0.004, duration_s: 3.0),
    ]),
    robot: Replay,
    sensor: ForceTorque(noise_n: 0.01, ar1: 0.3),
)"""
PARAMETERS = {"q": {"start": 1e6, "unit": "N s^2/m^3", "inactive": 0.0}}
COLUMNS = ("time_s", "position_m", "force_n", "velocity_mps")


def force(sample, parameters, state):
    return parameters.q * sample.v * abs(sample.v) * sample.inserted


def seconds(repeats, work):
    """Seconds of the fastest of some repetitions, which other programs disturb least."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def main():
    plain = stylet.Scenario(SCENARIO)
    effects = {
        "formula": stylet.Effect("drag", force="q * v * abs(v) * inserted", parameters=PARAMETERS),
        "callable": stylet.Effect("drag", force=force, parameters=PARAMETERS),
    }
    recordings = []
    for seed in (1, 2):
        arrays = stylet.simulate(plain.with_effects([effects["formula"]]), seed=seed).arrays()
        recordings.append({column: arrays[column] for column in COLUMNS})
    print(f"{len(recordings[0]['time_s'])} samples a recording; Python {sys.version.split()[0]}")
    for what, repeats, work in (
        ("simulate", 5, lambda effect: stylet.simulate(plain.with_effects([effect]))),
        ("diagnose", 1, lambda effect: stylet.diagnose(plain.with_effects(candidates=[effect]), recordings, progress=False)),
    ):
        took = {name: seconds(repeats, lambda effect=effect: work(effect)) for name, effect in effects.items()}
        print(f"{what}: formula {took['formula']:.3f} s, callable {took['callable']:.3f} s, ratio {took['callable'] / took['formula']:.1f}")


if __name__ == "__main__":
    main()
