"""Results in Python: data frames, plots, reports, dicts as scenarios, sweeps, Ctrl-C."""

import os
import signal
import threading
import time

import pytest
import stylet


def test_a_run_plots_and_shows_itself(two_gels):
    run = stylet.simulate(two_gels)
    assert run.score["missed"] == 0 and "ruptures found" in repr(run)
    frame = run.to_pandas()
    assert {"time_s", "force_n", "enhanced_n", "true_tip_force_n"} <= set(frame) and len(frame) == 2600
    axes = run.plot()
    assert axes.get_xlabel() == "time (s)" and len(axes.lines) >= 3
    assert "<iframe" in run._repr_html_() and "<html" in run.html().lower()


def test_an_enhanced_recording_has_intervals_and_a_report(two_gels):
    frame = stylet.simulate(two_gels).to_pandas()
    enhanced = stylet.enhance(frame[["time_s", "position_m", "force_n", "velocity_mps"]])
    low, high = enhanced.layers[0]["stiffness_interval"]
    assert low < enhanced.layers[0]["stiffness_n_per_m"] < high and low < 50.0 < high
    assert (enhanced.to_pandas()["low_n"] <= enhanced.to_pandas()["high_n"]).all()
    assert "<iframe" in enhanced._repr_html_() and "<html" in enhanced.html().lower()
    assert enhanced.plot().get_ylabel() == "force (N)"


def test_every_plot_returns_axes(two_gels):
    columns = ["time_s", "position_m", "force_n"]
    data = [stylet.simulate(two_gels, seed=seed).to_pandas()[columns] for seed in (1, 2)]
    found = stylet.diagnose(two_gels, data, progress=False)
    for recording in (0, 1):
        assert found.plot(recording).get_ylabel() == "force (N)"


def test_a_plan_separates_candidates_and_is_a_motion(two_gels):
    limits = {"depth_m": 0.02, "speed_mps": 0.008, "acceleration_mps2": 0.1, "duration_s": 30.0, "force_n": 6.0}
    planned = stylet.plan(two_gels, limits=limits, simulated=False, progress=False)
    assert 0.0 < planned.probability_decided <= 1.0 and planned.result["depth_m"] <= 0.02 + 1e-9
    assert (planned.pairs["nats_after"] >= planned.pairs["nats_before"] - 1e-6).all()
    begins, ends = two_gels.index("    motion:"), two_gels.index("    robot:")
    again = two_gels[:begins] + f"    motion: {planned.motion_ron()},\n" + two_gels[ends:]
    assert stylet.simulate(again).score["false"] == 0
    assert "<html" in planned.html().lower() and "Plan(" in repr(planned)
    assert planned.plot().get_xlabel().startswith("expected gap")
    with pytest.raises(stylet.StyletError, match="speed_mps"):
        stylet.plan(two_gels, limits=limits | {"speed_mps": -1.0}, simulated=False, progress=False)


def test_a_dict_is_a_scenario():
    scenario = {
        "name": "one gel",
        "tissue": {"layers": [{"thickness_m": 0.02, "stiffness_n_per_m": 50.0, "friction_ns_per_m2": 9000.0}]},
        "motion": {"Constant": {"start_m": -0.005, "velocity_mps": 0.005, "duration_s": 6.0}},
        "robot": "Replay",
    }
    whole = stylet.Scenario(scenario)
    assert stylet.simulate(whole).hash == stylet.simulate(scenario).hash
    scenario["tissue"]["layers"][0]["stiffness_n_per_m"] = -1.0
    with pytest.raises(stylet.StyletError, match=r"tissue.layers\[0\].stiffness_n_per_m"):
        stylet.Scenario(scenario)


def test_a_sweep_is_a_data_frame(two_gels):
    vary = [{"path": "sensor.noise_n", "with": {"Uniform": [0.0, 0.05]}}]
    swept = stylet.sweep({"trials": 20, "vary": vary}, two_gels, progress=False)
    frame = swept.to_pandas()
    assert len(frame) == 20 and frame["sensor.noise_n"].between(0, 0.05).all()
    assert swept.summary["trials"] == 20
    again = stylet.sweep({"trials": 20, "vary": vary}, two_gels, progress=False).to_pandas()
    assert frame.equals(again)
    with pytest.raises(stylet.StyletError, match="second argument"):
        stylet.sweep({"scenario": two_gels, "trials": 20, "vary": vary})


def test_ctrl_c_ends_a_sweep_and_progress_is_reported(two_gels):
    vary = [{"path": "sensor.noise_n", "with": {"Uniform": [0.0, 0.05]}}]
    reported = []
    timer = threading.Timer(1.0, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        stylet.sweep({"trials": 1_000_000, "vary": vary}, two_gels, progress=lambda what, done: reported.append(done))
    assert time.monotonic() - start < 20 and reported == sorted(reported) and reported


def test_the_interpreter_is_free_during_work(two_gels):
    ticks = []
    stop = threading.Event()

    def tick():
        while not stop.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.005)

    thread = threading.Thread(target=tick)
    thread.start()
    vary = [{"path": "sensor.noise_n", "with": {"Uniform": [0.0, 0.05]}}]
    stylet.sweep({"trials": 500, "vary": vary}, two_gels, progress=False)
    stop.set()
    thread.join()
    assert len(ticks) >= 3
