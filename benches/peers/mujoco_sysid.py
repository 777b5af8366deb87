"""MuJoCo's system identification toolbox and Stylet's diagnosis on the same recordings.

    python mujoco_sysid.py STYLET --cases 48 --seed 4701 --out DIR [--jobs 1]

A needle on a slide is driven through one layer along a known motion, and the force that drives it is recorded:

    g(t) = m a + F sgn(v) + K max(0, z) + b v max(0, z)         mass, dry friction of the drive, stiffness and friction of the layer
    f(t) = (1 + eps) g(t - tau) + F_0 + noise                   one of gain, delay and bias of the sensor per case

The recordings come from these two lines in NumPy (`measured_force`), with exact derivatives of a motion in closed form; neither tool
takes part. Three recordings of 20 s at 200 Hz per case; positions are exact; the noise is white in half of the cases and AR(1) with
a pole of 0.9 in the others, with the same standard deviation.

Only what both tools can express is drawn: the dry friction does not depend on depth (MuJoCo's `frictionloss`, Stylet's `drive_friction`), the
needle never stands still (MuJoCo's friction sticks there, Stylet's is zero), no layer ruptures, and the surface is known.

What each tool is given. Both get the recordings, the surface, and the same start: stiffness and friction wrong by up to a quarter,
otherwise the values at which Stylet's own search starts. A gain scales all forces, so neither tool can find it without a known force: in
cases with a gain both are given stiffness and friction (MuJoCo: frozen; Stylet: a tolerance of 0.1 %).

- MuJoCo is given the list of parameters, and fits those and no others. It does not search for a structure, and nobody claims that it does.
  A delay makes the sum of squares rough (the step of the dry friction passes from sample to sample), so that a fit from a start that is
  off can end in a local minimum. MuJoCo therefore also stands as "MuJoCo x3", the best of three starts of the delay.
- Stylet is given the layer alone. That there are a mass, a dry friction and a delay, gain or bias, it has to find out. What it does not
  name counts as an estimate of nothing (zero; for a gain one) without an interval, and as an interval that misses.

MuJoCo is used as its README says: `Parameter` with modifiers of the spec, `ModelSequences`, `SignalTransform` for delay, gain and bias,
`custom_rollout` for a simulation other than a forward one (here the inverse dynamics at the recorded motion, as the drive is a motion and
the measurement a force), `optimize` with its default optimizer, `calculate_intervals`. Residuals of the recordings are not scaled by the RMS of each
(`normalize=False`), as the noise is the same in all. The toolbox has no noise model but white noise.
"""

import argparse
import contextlib
import io
import json
import math
import multiprocessing
import os
import pathlib
import resource
import subprocess
import sys
import time

# One thread for each tool, set before NumPy starts its own: times are compared.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[variable] = "1"

import mujoco  # noqa: E402
import numpy as np  # noqa: E402
from mujoco import sysid  # noqa: E402
from scipy.interpolate import CubicSpline  # noqa: E402

HZ, SECONDS, RECORDINGS, POLE, THICKNESS = 200, 20.0, 3, 0.9, 0.06
TIMES = np.arange(int(HZ * SECONDS)) / HZ
PARAMETERS = {"stiffness": "N/m", "friction": "N s/m²", "mass": "kg", "dry friction": "N", "delay": "s", "gain": "", "bias": "N"}
ABSENT = {name: 1.0 if name == "gain" else 0.0 for name in PARAMETERS}
START = {"mass": 0.1, "dry friction": 0.2, "delay": 0.03, "gain": 1.05, "bias": 0.05}
BOUNDS = {
    "stiffness": (1.0, 2000.0),
    "friction": (0.0, 3e4),
    "mass": (1e-3, 5.0),
    "dry friction": (0.0, 5.0),
    "delay": (0.0, 0.2),
    "gain": (0.5, 2.0),
    "bias": (-2.0, 2.0),
}
IN_STYLET = {
    "tool_inertia": ("mass", "mass_kg"),
    "drive_friction": ("dry friction", "force_n"),
    "time_delay": ("delay", "delay_s"),
    "force_gain": ("gain", "eps"),
    "force_bias": ("bias", "force_n"),
}
TOOLS = {"mujoco": "MuJoCo", "mujoco_starts": "MuJoCo x3", "stylet": "Stylet"}
OTHER_DELAYS = (0.01, 0.06)
NOISES = {"white": "white", "ar1": f"AR(1) {POLE}"}


# Cases


def draw(seed, number):
    """A case: what is true, what both tools start from, and the recordings (time, position, force)."""
    rng = np.random.default_rng([seed, number])
    sensor = ("delay", "gain", "bias")[number % 3]
    noise = ("white", "ar1")[number // 3 % 2]

    def between(low, high):
        return math.exp(rng.uniform(math.log(low), math.log(high)))

    truth = {"stiffness": between(40, 200), "friction": between(500, 3000), "mass": between(0.05, 0.3), "dry friction": between(0.1, 0.4)}
    sign = rng.choice([-1.0, 1.0])
    truth[sensor] = {"delay": between(0.01, 0.05), "gain": 1.0 + sign * between(0.04, 0.15), "bias": sign * between(0.04, 0.2)}[sensor]
    known = ["stiffness", "friction"] if sensor == "gain" else []
    start = {name: START.get(name, value) for name, value in truth.items()}
    for name in ("stiffness", "friction"):
        factor = between(0.8, 1.25)
        start[name] *= 1.0 if name in known else factor
    noise_n = between(0.01, 0.025)
    recordings = []
    for _ in range(RECORDINGS):
        waves = [(between(0.012, 0.016), between(0.05, 0.1), -math.pi / 2)]  # there and back, from its upper turning point
        waves += [(between(0.002, 0.004), between(0.4, 0.9), rng.uniform(0, 2 * math.pi))]
        waves += [(between(0.0005, 0.001), between(1.5, 3.0), rng.uniform(0, 2 * math.pi))]
        centre = waves[0][0] - 0.008
        force = measured_force(truth, centre, waves) + coloured(rng, noise_n, POLE if noise == "ar1" else 0.0)
        recordings.append(np.column_stack([TIMES, motion(TIMES, centre, waves)[0], force]))
    return {"number": number, "sensor": sensor, "noise": noise, "noise_n": noise_n, "truth": truth, "known": known, "start": start}, recordings


def motion(t, centre, waves):
    """Position, velocity and acceleration; the recording is a window of a motion that goes on before it."""
    z, v, a = np.full_like(t, centre), np.zeros_like(t), np.zeros_like(t)
    for amplitude, hz, phase in waves:
        w = 2 * math.pi * hz
        z += amplitude * np.sin(w * t + phase)
        v += amplitude * w * np.cos(w * t + phase)
        a -= amplitude * w * w * np.sin(w * t + phase)
    return z, v, a


def measured_force(truth, centre, waves):
    """The force without noise."""
    z, v, a = motion(TIMES - truth.get("delay", 0.0), centre, waves)
    inside = np.maximum(0.0, z)
    force = truth["mass"] * a + truth["dry friction"] * np.sign(v) + (truth["stiffness"] + truth["friction"] * v) * inside
    return truth.get("gain", 1.0) * force + truth.get("bias", 0.0)


def coloured(rng, sd, pole):
    noise = rng.standard_normal(len(TIMES)) * sd
    noise[1:] *= math.sqrt(1.0 - pole * pole)
    for k in range(1, len(noise)):
        noise[k] += pole * noise[k - 1]
    return noise


# MuJoCo

# The tissue is a spring that pushes beyond the surface only. The dry friction is made hard: with MuJoCo's default constants, or with time
# constants bound to the time step (refsafe), it changes its sign some milliseconds away from a reversal. The friction of the shaft is the
# damping of the joint, set at every sample from the length inside.
MODEL = """
<mujoco>
  <option gravity="0 0 0"><flag refsafe="disable"/></option>
  <worldbody>
    <body name="needle">
      <inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
      <joint name="slide" type="slide" axis="1 0 0" frictionloss="0.2" solreffriction="1e-6 1" solimpfriction="0.9999 0.9999 0.001"/>
    </body>
  </worldbody>
  <tendon>
    <fixed name="tissue" stiffness="100" springlength="-1 0"><joint joint="slide" coef="1"/></fixed>
  </tendon>
  <custom><numeric name="friction" data="1000"/></custom>
  <actuator><motor name="drive" joint="slide"/></actuator>
  <sensor><actuatorfrc name="force" actuator="drive"/></sensor>
</mujoco>
"""


def set_stiffness(spec, parameter):
    spec.tendon("tissue").stiffness = np.array([[parameter.value[0]], [0.0], [0.0]])


def set_friction(spec, parameter):
    spec.numeric("friction").data = [parameter.value[0]]


def set_mass(spec, parameter):
    spec.body("needle").mass = parameter.value[0]


def set_dry_friction(spec, parameter):
    spec.joint("slide").frictionloss = parameter.value[0]


MODIFIERS = {"stiffness": set_stiffness, "friction": set_friction, "mass": set_mass, "dry friction": set_dry_friction}


def inverse_rollout(models, control_signal, initial_states, rollout_signal_mapping, rollout_state_mapping, **_):
    """The force of the drive at the recorded motion, for every model: what replaces the forward simulation of the toolbox."""
    out = []
    for model, control, initial in zip(models, control_signal, initial_states):
        spline = CubicSpline(control.times, control.data[:, 0])
        z, v, a = (spline(control.times, order) for order in range(3))
        damping = model.numeric_data[model.numeric("friction").adr[0]] * np.maximum(0.0, z)
        data = mujoco.MjData(model)
        position, velocity, acceleration, result = data.qpos, data.qvel, data.qacc, data.qfrc_inverse
        force = np.empty((len(z), 1))
        for k in range(len(z)):
            position[0], velocity[0], acceleration[0], model.dof_damping[0] = z[k], v[k], a[k], damping[k]
            mujoco.mj_inverse(model, data)
            force[k, 0] = result[0]
        sensor = sysid.TimeSeries(control.times, force, rollout_signal_mapping)
        state = sysid.TimeSeries(control.times, np.column_stack([control.times, z, v]), rollout_state_mapping)
        out.append(sysid.SystemTrajectory(model=model, control=control, sensordata=sensor, initial_state=initial, state=state))
    return out


def by_mujoco(case, recordings, delay=None):
    """The fit; with `delay`, from this start of the delay."""
    spec = mujoco.MjSpec.from_string(MODEL)
    parameters = sysid.ParameterDict()
    for name, start in case["start"].items():
        if name == "delay" and delay is not None:
            start = delay
        parameter = sysid.Parameter(name, start, *BOUNDS[name], modifier=MODIFIERS.get(name))
        if name in case["known"]:
            parameter.apply_modifier(spec)  # a frozen parameter keeps what the spec says
            parameter.frozen = True
        parameters.add(parameter)
    model = spec.compile()
    transform = sysid.SignalTransform(normalize=False)
    sensor = case["sensor"]
    if sensor == "delay":
        transform.delay("force", parameters["delay"])
    else:
        {"gain": transform.gain, "bias": transform.bias}[sensor]("force", parameters[sensor], target="predicted")
    sequences = sysid.ModelSequences(
        "needle",
        spec,
        [f"recording {k}" for k in range(len(recordings))],
        [sysid.create_initial_state(model, r[:1, 1]) for r in recordings],
        [sysid.TimeSeries.from_control_names(r[:, 0], r[:, 1:2], model) for r in recordings],
        [sysid.TimeSeries.from_names(r[:, 0], r[:, 2:3], model) for r in recordings],
    )
    residual = sysid.build_residual_fn(
        models_sequences=[sequences], modify_residual=transform.apply, custom_rollout=inverse_rollout, resample_true=False
    )
    with contextlib.redirect_stdout(io.StringIO()):  # the optimizer prints every iteration
        # Parameters of 0.02 s and 2000 N s/m² stand side by side, for which the toolbox offers `x_scale`.
        fitted, result = sysid.optimize(parameters, residual, verbose=False, x_scale="jac")
    residuals, _, _ = residual(result.x, fitted)
    residuals = [np.ravel(r) for r in residuals]
    _, half = sysid.calculate_intervals(residuals, result.jac)
    names = fitted.get_non_frozen_parameter_names()
    estimates = {n: [float(x), float(x - h), float(x + h)] for n, x, h in zip(names, result.x, half)}
    return {"estimates": estimates, "rms_n": float(np.sqrt(np.mean(np.concatenate(residuals) ** 2)))}


def by_mujoco_starts(case, recordings, _folder, _stylet):
    """The best of three starts of the delay; one fit where there is no delay."""
    if case["sensor"] != "delay":
        return dict(case["mujoco"])
    others = [by_mujoco(case, recordings, delay) for delay in OTHER_DELAYS]
    return min([f for f in (case["mujoco"], *others) if "rms_n" in f], key=lambda f: f["rms_n"])


# Stylet

SCENARIO = """Scenario(
    name: "needle on a slide",
    tissue: (layers: [(thickness_m: {thickness}, stiffness_n_per_m: {stiffness:.9g}, friction_ns_per_m2: {friction:.9g})]),
    motion: Recorded,
    sensor: ForceTorque(noise_n: 0.02),
    tolerance: {tolerance},
    thickness_tolerance: 0.0,
    surface_tolerance_m: 0.0,
)
"""


def by_stylet(case, recordings, folder, stylet):
    files = []
    for k, recording in enumerate(recordings):
        files.append(folder / f"recording_{k}.csv")
        np.savetxt(files[-1], recording, fmt="%.12g", delimiter=",", header="time_s,position_m,force_n", comments="")
    scenario = folder / "assumed.ron"
    tolerance = 0.001 if case["known"] else 0.3
    scenario.write_text(SCENARIO.format(thickness=THICKNESS, tolerance=tolerance, **{n: case["start"][n] for n in ("stiffness", "friction")}))
    command = [stylet, "diagnose", scenario, "--data", *files, "--out", folder / "out"]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip())
    said = json.loads((folder / "out/diagnosis.json").read_text())
    estimates, others = {}, []
    for cause in said["causes"]:
        name, path = IN_STYLET.get(cause["effect"], (None, None))
        if name not in case["truth"]:
            others.append(cause["effect"])
            continue
        found = cause["parameters"][path]
        shift = ABSENT[name]
        estimates[name] = [found[end] + shift for end in ("value", "low", "high")]
    fields = {"stiffness_n_per_m": "stiffness", "friction_ns_per_m2": "friction"}
    for found in said["base_parameters"]:
        name = fields.get(found["name"])
        if name and name not in case["known"]:
            estimates[name] = [found[end] for end in ("value", "low", "high")]
    return {"estimates": estimates, "others": others, "verdict": said["verdict"]}


# Comparison


def one(job):
    seed, number, out, stylet = job
    case, recordings = draw(seed, number)
    folder = out / f"case_{number:03}"
    folder.mkdir(parents=True, exist_ok=True)
    fits = {"mujoco": lambda case, recordings, *_: by_mujoco(case, recordings), "mujoco_starts": by_mujoco_starts, "stylet": by_stylet}
    for tool, fit in fits.items():
        begin, used = time.perf_counter(), processor_seconds()
        try:
            case[tool] = dict(fit(case, recordings, folder, stylet))
        except Exception as error:  # a tool that fails has failed, and the table says so
            case[tool] = {"estimates": {}, "failed": str(error) or repr(error)}
        case[tool]["seconds"] = time.perf_counter() - begin
        case[tool]["processor_seconds"] = processor_seconds() - used
    for key in ("seconds", "processor_seconds"):  # the first of the three starts
        case["mujoco_starts"][key] += case["mujoco"][key]
    (folder / "case.json").write_text(json.dumps(case, indent=1))
    return case


def processor_seconds():
    of = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in of)


def wilson(k, n):
    if n == 0:
        return [math.nan, math.nan]
    z, p = 1.959964, k / n
    middle, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return [(middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)]


def row(cases, tool, name):
    """Errors and coverage of one parameter over the cases in which it is unknown."""
    errors, holds, missing = [], 0, 0
    for case in cases:
        truth = case["truth"][name]
        found = case[tool]["estimates"].get(name)
        value, low, high = found or (ABSENT[name], math.nan, math.nan)
        missing += found is None
        errors.append(abs(value - truth) / abs(truth))
        holds += low <= truth <= high
    median, high = np.quantile(errors, [0.5, 0.9])
    return {"n": len(cases), "missing": missing, "median": median, "p90": high, "holds": int(holds), "wilson": wilson(holds, len(cases))}


def compare(cases):
    rows = []
    for noise in NOISES:
        for name in PARAMETERS:
            here = [c for c in cases if c["noise"] == noise and name in c["truth"] and name not in c["known"]]
            if here:
                rows.append({"noise": noise, "parameter": name, **{tool: row(here, tool, name) for tool in TOOLS}})
    together = []
    for noise in NOISES:
        entry = {"noise": noise}
        for tool in TOOLS:
            mine = [r[tool] for r in rows if r["noise"] == noise]
            holds, n = sum(r["holds"] for r in mine), sum(r["n"] for r in mine)
            entry[tool] = {"holds": holds, "n": n, "wilson": wilson(holds, n)}
        together.append(entry)
    times = {}
    for tool in TOOLS:
        for kind in ("delay", "gain", "bias"):
            mine = [c[tool] for c in cases if c["sensor"] == kind]
            if mine:
                keys = ("seconds", "processor_seconds")
                times.setdefault(tool, {})[kind] = {k: np.quantile([m[k] for m in mine], [0.5, 0.9]).tolist() for k in keys}
    wanted = [(c["truth"].keys() & {n for n, _ in IN_STYLET.values()}, c["stylet"]) for c in cases]
    exact = sum(names <= said["estimates"].keys() and not said.get("others") for names, said in wanted)
    stray = sum(bool(said.get("others")) for _, said in wanted)
    failed = {tool: sum("failed" in c[tool] for c in cases) for tool in TOOLS}
    return {"rows": rows, "together": together, "times": times, "named": {"exact": exact, "stray": stray, "n": len(cases)}, "failed": failed}


def table(result):
    def percent(x):
        return f"{100 * x:.2f}" if x < 0.1 else f"{100 * x:.0f}"

    def coverage(r):
        low, high = (100 * x for x in r["wilson"])
        return f"{r['holds']}/{r['n']} ({low:.0f} to {high:.0f})"

    def errors(r):
        return f"{percent(r['median'])}, {percent(r['p90'])}"

    about, named, lines = result["about"], result["named"], []
    lines.append(f"mujoco {about['mujoco']} (mujoco.sysid) and {about['stylet']}: {about['cases']} cases of seed {about['seed']}")
    lines.append("MuJoCo is given the list of parameters; Stylet is given the layer and finds the rest.")
    lines.append("MuJoCo x3: the best of three fits that start from delays of 30, 10 and 60 ms.")
    lines.append("")
    layout = "{:<11}{:<14}" + 3 * "{:>12}" + "   " + 3 * "{:<20}"
    lines.append(layout.format("", "", "", "error in %: median, 90 %", "", "95 % interval holds the truth", "", "").rstrip())
    lines.append(layout.format("noise", "parameter", *TOOLS.values(), *TOOLS.values()).rstrip())
    for r in result["rows"]:
        mine = [f(r[tool]) for f in (errors, coverage) for tool in TOOLS]
        lines.append(layout.format(NOISES[r["noise"]], r["parameter"], *mine).rstrip())
    for r in result["together"]:
        lines.append(layout.format(NOISES[r["noise"]], "all", "", "", "", *(coverage(r[tool]) for tool in TOOLS)).rstrip())
    lines.append("")
    low, high = (100 * x for x in wilson(named["exact"], named["n"]))
    lines.append(
        f"Stylet names all effects that are there and no other in {named['exact']}/{named['n']} ({low:.0f} to {high:.0f} %),"
        f" another one in {named['stray']}. MuJoCo does not search."
    )
    lines.append("failed: " + ", ".join(f"{TOOLS[tool]} {count}" for tool, count in result["failed"].items()))
    lines.append("")
    lines.append("processor seconds per case: median, 90 % (wall clock, each on one thread; depends on what else the machine does)")
    for tool, kinds in result["times"].items():
        for kind, t in kinds.items():
            cpu, wall = ("{:.1f}, {:.1f}".format(*t[key]) for key in ("processor_seconds", "seconds"))
            lines.append(f"    {TOOLS[tool]:<10}with a {kind:<7}{cpu:>12}  ({wall})")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("stylet", help="the program")
    parser.add_argument("--cases", type=int, default=48)
    parser.add_argument("--seed", type=int, default=4701)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for recordings, answers, table.txt and table.json")
    parser.add_argument("--jobs", type=int, default=1, help="cases at the same time; more than one disturbs the times")
    asked = parser.parse_args()
    version = subprocess.run([asked.stylet, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    asked.out.mkdir(parents=True, exist_ok=True)
    jobs = [(asked.seed, k, asked.out, asked.stylet) for k in range(asked.cases)]
    cases = []
    with multiprocessing.Pool(asked.jobs) as pool:
        for case in pool.imap(one, jobs):
            cases.append(case)
            print(f"{len(cases)} of {asked.cases}", file=sys.stderr, flush=True)
    about = {"mujoco": mujoco.__version__, "stylet": version, "cases": asked.cases, "seed": asked.seed, "jobs": asked.jobs}
    result = {"about": about, **compare(cases)}
    (asked.out / "table.json").write_text(json.dumps({**result, "cases": cases}, indent=1))
    (asked.out / "table.txt").write_text(table(result))
    print(table(result), end="")


if __name__ == "__main__":
    main()
