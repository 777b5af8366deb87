"""The gallery: every effect hidden in simulated recordings and diagnosed, and recordings in which no cause can be named. Called by make.py."""

import csv
import json
import re
from pathlib import Path

from drawing import BLUE, GREY, heading, limits, panel, picture

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
EXAMPLES = "scenarios/effects/examples.ron"

PHANTOM = """Scenario(
    name: "two gels",
    tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 3000.0, puncture_n: 0.8),
        (thickness_m: 0.04, stiffness_n_per_m: 60.0, friction_ns_per_m2: 4000.0, puncture_n: 1.8),
    ]),
    EFFECTS
    motion: MOTION,
    robot: Replay,
    sensor: ForceTorque(NOISE),
)
"""
# The second motion crosses the layers at other speeds, and changes direction early: one motion alone leaves most causes ambiguous.
MOTIONS = [
    """Program(start_m: -0.005, segments: [
        Move(velocity_mps: 0.004, duration_s: 7.5), Hold(duration_s: 3.0),
        Ripple(velocity_mps: 0.004, amplitude_mps: 0.002, frequency_hz: 0.5, duration_s: 5.0), Move(velocity_mps: 0.006, duration_s: 2.0),
        Move(velocity_mps: -0.006, duration_s: 10.0),
    ])""",
    """Program(start_m: -0.005, segments: [
        Ripple(velocity_mps: 0.003, amplitude_mps: 0.0015, frequency_hz: 0.4, duration_s: 6.0), Move(velocity_mps: -0.003, duration_s: 1.0),
        Move(velocity_mps: 0.002, duration_s: 5.0), Move(velocity_mps: 0.008, duration_s: 5.0), Hold(duration_s: 3.0),
        Move(velocity_mps: -0.005, duration_s: 13.0),
    ])""",
]
NOISE_N = 0.01
QUIET, NOISY = "noise_n: 0.0", f"noise_n: {NOISE_N}, ar1: 0.5"

# Over depth where the effect moves a place, or acts on the recorded position.
OVER_DEPTH = {"boundary_shift", "position_scale"}
# Sizes other than the typical one, where that would hardly be visible in a small picture.
VISIBLE = {
    "quantisation": ("step_n", "0.25"),
    "tool_inertia": ("mass_kg", "3.0"),
    "time_delay": ("delay_s", "0.3"),
    "low_pass_lag": ("time_constant_s", "0.5"),
    "position_scale": ("eps", "0.1"),
    "force_bias": ("force_n", "0.3"),
    "force_drift": ("rate_n_per_s", "0.02"),
    "force_gain": ("eps", "0.2"),
    "periodic_interference": ("frequency_hz", "0.5"),
    "saturation": ("limit_n", "1.2"),
    "loading_hysteresis": ("fraction", "0.4"),
    "respiration": ("amplitude_m", "0.001"),
    "position_dependent_force": ("stiffness_n_per_m", "10.0"),
}
# Effects that need another phantom or motion to act.
CHANGED = {
    "deep_indentation": [("puncture_n: 0.8", "puncture_n: 1.3")],
    "loading_hysteresis": [("Move(velocity_mps: 0.004, duration_s: 7.5)", "Move(velocity_mps: 0.004, duration_s: 4.0), Move(velocity_mps: -0.004, duration_s: 1.0), Move(velocity_mps: 0.004, duration_s: 4.5)")],
}
# The recorded motion is the commanded one times this factor; the models are simulated along the recorded motion.
RECORDED_SCALE = {"position_scale": 1.1}


def scenario(effects="", motion=MOTIONS[0], noise=QUIET, changes=()):
    text = PHANTOM.replace("EFFECTS", f"effects: [{effects}]," if effects else "").replace("MOTION", motion).replace("NOISE", noise)
    for old, new in changes:
        text = text.replace(old, new)
    return text


def times(text, factor):
    """The scenario with its motion enlarged."""
    return re.sub(r"\b(start_m|velocity_mps|amplitude_mps): ([-\d.e]+)", lambda m: f"{m[1]}: {float(m[2]) * factor}", text)


def diagnose(stylet, name, assumed, truths, words=()):
    """Records the true scenarios with noise and diagnoses the assumed one from them: the recordings, the diagnosis, the extended scenario."""
    (stylet.folder / f"{name}-assumed.ron").write_text(assumed)
    recordings = [stylet.run(f"{name}-{k}", text, "--seed", str(k)) for k, text in enumerate(truths, 1)]
    files = [f"{name}-{k}/recording.csv" for k in range(1, len(truths) + 1)]
    stylet("diagnose", f"{name}-assumed.ron", "--data", *files, *words, "--out", f"{name}-found")
    found = stylet.folder / f"{name}-found"
    extended = re.sub(r"(noise_n|ar1): [\d.e-]+", r"\1: 0.0", (found / "extended.ron").read_text())
    return recordings, json.loads((found / "diagnosis.json").read_text()), extended


def residual(measured, model):
    """Time and measured less simulated force."""
    count = min(len(measured["time_s"]), len(model["time_s"]))
    return measured["time_s"][:count], [a - b for a, b in zip(measured["force_n"][:count], model["force_n"])]


def rms(values):
    return (sum(v * v for v in values) / len(values)) ** 0.5


# Longer captions do not fit under a picture; they leave out the values of the parameters.
CAPTION = 115


def grade(diagnosis):
    """The letter, and below A the reason for it."""
    letter = diagnosis["grade"]["letter"]
    reasons = [part["reason"] for part in diagnosis["grade"]["parts"] if part["letter"] == letter]
    return f"grade {letter}" + (f": {reasons[-1].split(',')[0]}" if letter != "A" else "")


def verdict(diagnosis, effect="", absorbed=False):
    """What a diagnosis answers, in a line."""
    causes = diagnosis["causes"]
    if not causes:
        moved = [f"{p['name']} of layer {p['layer']}: {p['value']:.3g}, not {p['assumed']:.3g}" for p in diagnosis["base_parameters"] if p["out_of_tolerance"]]
        absorbed = absorbed and diagnosis["verdict"] != "unknown"
        reasons = ["the parameters of the layers absorb it"] * absorbed + moved + [f"not identifiable: {effect}"] * (effect in diagnosis["not_identifiable"])
        return "; ".join([f"verdict: {diagnosis['verdict']}", *reasons, grade(diagnosis)])

    def line(with_values):
        parts = []
        for cause in causes:
            values = ", ".join(f"{key.removeprefix('terms.0.')} = {float(format(p['value'], '.3g')):g}" for key, p in cause["parameters"].items())
            names = (" or " if diagnosis["verdict"] == "ambiguous" else ", equivalent: ").join([cause["effect"], *cause["equivalent"]])
            parts.append(names + f" ({values})" * with_values + f", confidence {cause['confidence']:.2g}")
        return f"{diagnosis['verdict']}: {' + '.join(parts)}; {grade(diagnosis)}"

    return line(True) if len(line(True)) <= CAPTION else line(False)


def before_and_after(before, after, named):
    """The panels of the residuals, at the scale of the first."""
    y_range = limits([before[1], [0.0]])
    return [
        *heading(297, "residual of the assumed model", [(None, "measured less simulated; grey: noise")]),
        *panel([(BLUE, *before)], "time (s)", "residual (N)", 297, 195, y_range, 2 * NOISE_N),
        *heading(548, "after it was named" if named else "after the diagnosis", [(None, "the same for extended.ron")]),
        *panel([(BLUE, *after)], "time (s)", "residual (N)", 548, 195, y_range, 2 * NOISE_N),
    ]


def hidden(curves, x_label, left=50, width=195):
    """The panel of the force without and with an effect."""
    (x0, y0), (x1, y1) = curves
    return [
        *heading(left, "hidden in the data", [(GREY, "base law"), (BLUE, "with the effect")]),
        *panel([(GREY, x0, y0), (BLUE, x1, y1)], x_label, "force (N)", left, width),
    ]


def without_and_with(stylet, name, effects, changes=()):
    """The curves of the first motion, without noise, and the label of their abscissa."""
    curves = []
    for label, text in (("without", ""), ("with", effects)):
        data = stylet.run(f"{name}-{label}", scenario(text, changes=changes))
        x, y = data["time_s"], data["force_n"]
        if name in OVER_DEPTH:
            end = data["position_m"].index(max(data["position_m"])) + 1
            x, y = [1e3 * z for z in data["position_m"][:end]], y[:end]
        curves.append((x, y))
    return curves, "depth (mm)" if name in OVER_DEPTH else "time (s)"


def title_of(name, effects):
    """The effect as in a scenario if that fits; a custom one by its name and values."""
    if effects.startswith("Custom("):
        return f"{name}: " + ", ".join(f"{key} = {value}" for key, value in re.findall(r"(\w+): \(start: ([-\d.e]+)", effects))
    return effects if len(effects) < 100 else name


def diagnosed_effect(stylet, name, effects, words=()):
    """The picture of an effect: hidden, residual of the assumed model, residual after the diagnosis. And what that answered."""
    changes = CHANGED.get(name, [])
    truths = [scenario(effects, motion, NOISY, changes) for motion in MOTIONS]
    recordings, diagnosis, extended = diagnose(stylet, name, scenario(noise=NOISY, changes=changes), truths, words)
    scale = RECORDED_SCALE.get(name, 1.0)
    assumed = stylet.run(f"{name}-model", times(scenario(changes=changes), scale))
    fitted = stylet.run(f"{name}-fitted", times(extended, scale))
    before, after = residual(recordings[0], assumed), residual(recordings[0], fitted)
    named = name in [cause["effect"] for cause in diagnosis["causes"]]
    parts = hidden(*without_and_with(stylet, name, effects, changes)) + before_and_after(before, after, named)
    line = verdict(diagnosis, name, rms(after[1]) < 0.5 * rms(before[1]))
    print(f"{name}: {line}; residual {rms(before[1]):.4f} N before, {rms(after[1]):.4f} N after")
    return picture(title_of(name, effects), parts, line)


def layer_effect(stylet, name, effects):
    """The picture of an effect of a single layer, which is not searched for in single insertions: force and difference."""
    curves, x_label = without_and_with(stylet, name, effects, CHANGED.get(name, []))
    (_, y0), (x1, y1) = curves
    difference = [b - a for a, b in zip(y0, y1)]
    parts = hidden(curves, x_label, 50, 320) + heading(430, "difference", []) + panel([(BLUE, x1, difference)], x_label, "force (N)", 430, 313)
    return picture(title_of(name, effects), parts)


def effects(stylet):
    """One picture per effect of the page, and per custom effect of the examples."""
    folder = HERE / "effects"
    folder.mkdir(exist_ok=True)
    page = (ROOT / "docs/reference/effects.md").read_text()
    for section in re.split(r"^## ", page, flags=re.M)[1:]:
        for name, block in re.findall(r"^### (\w+)\n(.*?)(?=^###|\Z)", section, re.S | re.M):
            line = re.search(r"```ron\n(.*?),\n```", block, re.S).group(1)
            if name in VISIBLE:
                field, value = VISIBLE[name]
                line, changed = re.subn(rf"\b{field}: [-0-9.e]+", f"{field}: {value}", line)
                assert changed, (name, line)
            if section.startswith("Effects of single layers"):
                svg = layer_effect(stylet, name, line)
            else:
                svg = diagnosed_effect(stylet, name, line, ("--effects", EXAMPLES) if line.startswith("Custom(") else ())
            (folder / f"{name}.svg").write_text(svg)


ONE_SPEED = "Program(start_m: -0.005, segments: [Move(velocity_mps: 0.004, duration_s: 12.0), Move(velocity_mps: -0.004, duration_s: 12.0)])"
NO_RETRACTION = "Program(start_m: -0.005, segments: [Move(velocity_mps: 0.004, duration_s: 14.0)])"
# Another specimen, with twice the friction.
OTHER_SPECIMEN = [("friction_ns_per_m2: 3000.0", "friction_ns_per_m2: 6000.0"), ("friction_ns_per_m2: 4000.0", "friction_ns_per_m2: 8000.0")]


def example(name):
    """A custom effect of the examples."""
    return re.search(rf'Custom\(\s*name: "{name}".*?\n    \)', (ROOT / EXAMPLES).read_text(), re.S).group(0)


# Recordings in which no cause can be named: name, what is wrong, true effects, motions, changes of the phantom of the first recording.
FAILURES = [
    ("unknown", "A sensor with a cubic error, which is not in the library", example("cubic_sensor"), MOTIONS, []),
    ("one_speed", "Dry friction, recorded at one speed", "CoulombFriction(c_n_per_m: 3.0)", [ONE_SPEED] * 2, []),
    ("no_retraction", "Dry friction of the drive, recorded at one speed without retraction", "DriveFriction(force_n: 0.2)", [NO_RETRACTION] * 2, []),
    ("two_specimens", "Two specimens, one with twice the friction", "", MOTIONS, OTHER_SPECIMEN),
]


def failures(stylet):
    """One picture per failure: the force, and the residual before and after the diagnosis."""
    folder = HERE / "failures"
    folder.mkdir(exist_ok=True)
    for name, title, effects, motions, changes in FAILURES:
        truths = [scenario(effects, motions[0], NOISY, changes), scenario(effects, motions[1], NOISY)]
        recordings, diagnosis, extended = diagnose(stylet, name, scenario(motion=motions[0], noise=NOISY), truths)
        assumed = stylet.run(f"{name}-model", scenario(motion=motions[0]))
        before, after = residual(recordings[0], assumed), residual(recordings[0], stylet.run(f"{name}-fitted", extended))
        measured, model = [(data["time_s"], data["force_n"]) for data in (recordings[0], assumed)]
        parts = [
            *heading(50, "first recording", [(GREY, "assumed"), (BLUE, "measured")]),
            *panel([(GREY, *model), (BLUE, *measured)], "time (s)", "force (N)", 50, 195),
            *before_and_after(before, after, False),
        ]
        line = verdict(diagnosis, absorbed=rms(after[1]) < 0.5 * rms(before[1]))
        print(f"{name}: {line}; not identifiable: {diagnosis['not_identifiable']}")
        (folder / f"{name}.svg").write_text(picture(title, parts, line))
