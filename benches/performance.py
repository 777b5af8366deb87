#!/usr/bin/env python3
"""Measures what the operations of Stylet cost, and remakes the table and the picture of docs/explanation/performance.md.

    python3 benches/performance.py STYLET                       # prints the rows as Markdown
    python3 benches/performance.py STYLET --write               # also replaces them in the page, and docs/figures/cost.svg
    python3 benches/performance.py STYLET --only core growth    # only these parts

STYLET is a release build of the command. The parts `core`, `arm`, `sweep`, `diagnose` and `build` call cargo, which builds what is not
built yet; the peers of `arm` and `sweep` need the Python of benches/peers/setup.sh, or STYLET_PEERS_PYTHON. The parts `languages`, `large`,
`plan` and `checks` take minutes to half an hour each and run only when named. `growth` needs 4 GB of disk under TMPDIR (0.4 GB with
--quick). Times mean something on an otherwise idle machine only.

A ratio is the time divided by that of the peer. A part that fails names the command and its last lines; its rows stay as they are, the
other parts go on, and the exit status is 1. Standard library only, on Linux or macOS.
"""

import argparse
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections import namedtuple
from math import log10
from pathlib import Path

sys.dont_write_bytecode = True
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs/figures"))
from drawing import BLUE, BOTTOM, GREY, HEIGHT, LINE, TOP, picture, text  # noqa: E402

PAGE, FIGURE = ROOT / "docs/explanation/performance.md", ROOT / "docs/figures/cost.svg"
HEAD = "| operation | time | limit | peer | ratio | command |"
SWEEP = "scenarios/sweeps/noise.ron"
# A sweep of this file has insertions of 50 s at 200 Hz.
SAMPLES, TRIALS = 10_000, 10_000

Done = namedtuple("Done", "output wall_s processor_s megabytes")


class Failed(Exception):
    pass


def call(*words, **environment):
    """Runs a command to its end in the root of the repository: its output, wall and processor time, and the most memory of one of its processes."""
    words = [str(w) for w in words]
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        begin = time.monotonic()
        try:
            child = subprocess.Popen(words, cwd=ROOT, stdout=out, stderr=err, env={**os.environ, **environment})
        except OSError as why:
            raise Failed(f"{shlex.join(words)}: {why}") from why
        _, status, usage = os.wait4(child.pid, 0)
        wall_s = time.monotonic() - begin
        child.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        output = out.read()
        if child.returncode:
            last = (output + err.read()).rstrip().splitlines()[-8:]
            raise Failed("\n    ".join([f"exit status {child.returncode}: {shlex.join(words)}", *last]))
    unit = 1 if sys.platform == "darwin" else 1024
    return Done(output, wall_s, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * unit / 1e6)


def find(pattern, output, words):
    """The groups of `pattern` in the output of a command, as numbers."""
    found = re.search(pattern, output)
    if not found:
        raise Failed("\n    ".join([f"no {pattern!r} in the output of {words}", *output.rstrip().splitlines()[-8:]]))
    return [float(g) for g in found.groups()]


def short(value, digits=2):
    """With so many significant digits, and no exponent."""
    return spaced(float(f"{value:.{digits}g}"))


def spaced(value):
    return f"{value:,.10g}".replace(",", " ")


def note(words):
    print(f"performance: {words}", file=sys.stderr, flush=True)


def within(what, value_s, limit_s):
    if value_s > limit_s:
        note(f"{what}: {short(value_s, 3)} s is above the limit of {short(limit_s)} s")


def row(operation, took, command, limit="", peer="", ratio=""):
    return f"| {operation} | {took} | {limit} | {peer} | {ratio} | `{command}` |"


# Parts: each gives rows one by one, so that those before a failure count.


def core(_):
    command = "cargo run --release -p stylet-core --example speed"
    output = call(*command.split()).output
    for name in ("Stylet", "Paper"):
        ns, late_ns = find(rf"{name}: (\d+) ns per sample.*p99\.9 (\d+) ns", output, command)
        yield row(f"one sample, `{name}`", f"{short(ns)} ns; 99.9 % below {short(late_ns / 1e3)} µs", command)


def arm(_):
    command = "cargo bench --bench arm"
    # The loops of the bench that need no statistics run after this test of the others.
    output = call(*command.split(), "--", "--test").output
    whole = "arm with control and virtual sensor"
    (ours,) = find(rf"{whole}: ([\d.]+) us per step", output, command)
    if "SKIPPED" in output:
        raise Failed(f"{command}: MuJoCo is missing: bash benches/peers/setup.sh")
    (peer,) = find(r"MuJoCo mj_step of the same arm: ([\d.]+) us", output, command)
    (ratio,) = find(rf"{whole}: ([\d.]+) times mj_step", output, command)
    yield row("one step of the arm, with control and virtual sensor", f"{short(ours)} µs", command,
              peer=f"MuJoCo, `mj_step` of the arm alone: {short(peer)} µs", ratio=short(ratio))


def sweep(stylet):
    command = "cargo bench --bench sweep"
    bench = call(*command.split(), STYLET_BENCH_TRIALS="100").output
    (whole,) = find(r"whole trial +([\d.]+) ns", bench, command)
    loops_ns = sum(find(rf"  {part} +([\d.]+) ns", bench, command)[0] for part in ("law and motion", "noise", "core"))
    runs = {}
    for threads in (2, 1):
        with tempfile.TemporaryDirectory() as folder:
            runs[threads] = call(stylet, "sweep", SWEEP, "--trials", TRIALS, "--threads", threads, "--out", folder, "--quiet")
    took = {n: f"{short(r.wall_s)} s; {short(r.processor_s)} s of processor time; {short(r.megabytes)} MB" for n, r in runs.items()}
    loops_s = loops_ns * 1e-9 * SAMPLES * TRIALS / 2
    yield row(f"sweep of {spaced(TRIALS)} insertions, two threads", took[2], f"stylet sweep {SWEEP} --threads 2",
              peer=f"loops of law, noise and core alone: {short(loops_s)} s", ratio=short(runs[2].wall_s / loops_s))
    yield row("the same sweep, one thread", took[1], f"stylet sweep {SWEEP} --threads 1",
              peer=f"two threads: {short(runs[2].wall_s)} s", ratio=short(runs[1].wall_s / runs[2].wall_s))
    if "SKIPPED" in bench:
        raise Failed(f"{command}: NumPy is missing: bash benches/peers/setup.sh")
    numpy_ns, times = find(r"pure NumPy trial: (\d+) ns per sample, (\d+) times ours", bench, command)
    yield row("one insertion of 50 s at 200 Hz in a sweep", f"{short(whole * SAMPLES / 1e6)} ms on one thread", command,
              peer=f"NumPy: {short(numpy_ns * SAMPLES / 1e6)} ms", ratio=short(1 / times))


def build(_):
    """A first build; the sources of other crates are downloaded before."""
    command = "cargo build --release"
    call("cargo", "fetch")
    with tempfile.TemporaryDirectory() as folder:
        done = call(*command.split(), CARGO_TARGET_DIR=folder)
    within("first build", done.wall_s, 150)
    within("first build, processor time", done.processor_s, 240)
    yield row("first build", f"{short(done.wall_s, 3)} s; {short(done.processor_s, 3)} s of processor time", command, limit="150 s; 240 s")


def diagnose(_):
    command, cases = "cargo bench --bench diagnose_command", 24
    pattern = r"stylet diagnose: ([\d.]+) s .*nine of ten within ([\d.]+),.*slowest ([\d.]+)\), at most (\d+) MB"
    median, most, slowest, megabytes = find(pattern, call(*command.split(), STYLET_BENCH_CASES=str(cases)).output, command)
    for what, value, limit in (("median", median, 0.5), ("nine of ten", most, 1.5), ("slowest", slowest, 8)):
        within(f"diagnose, {what}", value, limit)
    yield row(f"`diagnose`, {cases} cases", f"median {median:g} s, nine of ten within {most:g} s, slowest {slowest:g} s; {megabytes:g} MB",
              command, limit="0.5 s; 1.5 s; 8 s")


def reproduce(stylet):
    with tempfile.TemporaryDirectory() as folder:
        done = call(stylet, "reproduce", "--out", folder, "--quiet")
    within("reproduce, processor time", done.processor_s, 40)
    yield row("`reproduce`", f"{short(done.processor_s)} s of processor time", "stylet reproduce", limit="40 s")


def languages(_):
    command = "cargo test --release -p stylet-capi --test c_loop -- --nocapture"
    (ns,) = find(r"p50_ns (\d+)", call(*command.split(), STYLET_C_STEPS="10000000").output, command)
    yield row("one sample from C", f"{short(ns)} ns in the median", f"STYLET_C_STEPS=10000000 {command}")
    call("crates/python/test.sh", "--release", "--collect-only")
    command = "crates/python/speed.py"
    output = call(ROOT / "target/python/bin/python", command, PYTHONPATH=str(ROOT / "target/python-module")).output
    run, rust, ratio = find(r"run\(arrays\) +(\d+) ns a sample, in Rust (\d+): ratio ([\d.]+)", output, command)
    (step,) = find(r"enhanced\(\.\.\.\) +(\d+) ns", output, command)
    yield row("one sample from Python", f"{short(step)} ns; {short(run)} ns in `run(arrays)`", command,
              peer=f"`run` in Rust: {short(rust)} ns", ratio=f"{short(ratio)} for `run`")


def large(_):
    command = "tests/sweep_large.sh 1e6"
    megabytes, wall, processor = find(r"1000000 trials: ([\d.]+) MB at most, ([\d.]+) s \(([\d.]+) s", call(*command.split()).output, command)
    yield row("sweep of a million insertions of 0.8 s", f"{short(wall)} s; {short(processor)} s of processor time; {short(megabytes)} MB", command)
    command = "tests/enhance_long.sh 1e8"
    megabytes, processor = find(r"stylet enhance: ([\d.]+) MB at most, \d+ s \((\d+) s", call(*command.split()).output, command)
    yield row("`enhance` on 10^8 samples (3.6 GB)", f"{short(processor, 3)} s of processor time; {short(megabytes)} MB", command)


def plan(stylet):
    command = "benchmark plan --cases 60 --seed 132 --threads 1"
    with tempfile.TemporaryDirectory() as folder:
        call(stylet, *command.split(), "--out", folder)
        output = Path(folder, "table.txt").read_text()
    median, longest = find(r"seconds of planning: median ([\d.]+), .*?longest ([\d.]+);", output, f"stylet {command}")
    yield row("`plan --quick`", f"median {median:.1f} s, longest {longest:.1f} s", f"stylet {command}")
    command = "tests/plan_times.sh"
    seconds = sorted(float(s) for s in re.findall(r"([\d.]+) s with it", call(command).output))
    if not seconds:
        raise Failed(f"no times in the output of {command}")
    yield row("`plan` with simulated check", f"{short(seconds[0])} to {short(seconds[-1])} s", command)


def checks(_):
    for operation, command in (("tests, from clean", "cargo test --workspace --all-features"), ("all checks, from clean", ".ci/run")):
        with tempfile.TemporaryDirectory() as folder:
            done = call(*command.split(), CARGO_TARGET_DIR=folder)
        yield row(operation, f"{short(done.wall_s / 60)} min; {short(done.processor_s / 60)} min of processor time", command)


# Growth of the cost.


def scenario(motion, layers=2, stiffness=60.0):
    """Layers with a common depth of 64 mm, of which every second one is softer."""
    layer = "(thickness_m: {}, stiffness_n_per_m: {}, friction_ns_per_m2: 9000.0)"
    each = ", ".join(layer.format(0.064 / layers, stiffness * (1 - 0.3 * (k % 2))) for k in range(layers))
    return f'Scenario(name: "growth", tissue: (layers: [{each}]), motion: {motion}, sensor: ForceTorque(noise_n: 0.02))\n'


def program(*segments):
    return f"Program(start_m: -0.01, segments: [{', '.join(segments)}])"


# All motions take 50 s, which are 10 000 samples. This one ends where it begins, so that its recording can be repeated.
RETURN = program(
    "Move(velocity_mps: 0.003, duration_s: 28.0)", "Hold(duration_s: 3.0)", "Move(velocity_mps: -0.006, duration_s: 14.0)", "Hold(duration_s: 5.0)"
)
# Through all layers.
MOTIONS = [
    "Constant(start_m: -0.01, velocity_mps: 0.0016, duration_s: 50.0)",
    program("Ripple(velocity_mps: 0.0016, amplitude_mps: 0.001, frequency_hz: 0.2, duration_s: 50.0)"),
    program("Move(velocity_mps: 0.004, duration_s: 10.0)", "Hold(duration_s: 5.0)", "Move(velocity_mps: 0.001, duration_s: 35.0)"),
    program("Move(velocity_mps: 0.0025, duration_s: 30.0)", "Hold(duration_s: 5.0)", "Move(velocity_mps: -0.004, duration_s: 15.0)"),
]


class Growth:
    """Processor time of whole commands in a temporary folder."""

    def __init__(self, stylet, folder, quick):
        self.stylet, self.folder, self.quick = stylet, Path(folder), quick

    def recording(self, name, text, seed=1):
        """The simulated recording of a scenario."""
        (self.folder / f"{name}.ron").write_text(text)
        call(self.stylet, "run", self.folder / f"{name}.ron", "--seed", seed, "--out", self.folder / name, "--quiet")
        return self.folder / name / "recording.csv"

    def least_s(self, *words):
        """The least processor time of up to five runs, as long as they take less than five seconds together."""
        times = []
        while not times or (len(times) < (2 if self.quick else 5) and sum(times) < 5):
            with tempfile.TemporaryDirectory(dir=self.folder) as out:
                times.append(call(self.stylet, *words, "--out", out, "--quiet", "--limit-memory", "8GB").processor_s)
        return min(times)

    def samples(self):
        source = self.recording("return", scenario(RETURN))
        with open(source) as file:
            names = file.readline().strip().split(",")
            keep = [names.index(name) for name in ("time_s", "position_m", "velocity_mps", "force_n")]
            rows = [[line.strip().split(",")[k] for k in keep] for line in file]
        times, rest = [float(r[0]) for r in rows], [",".join(r[1:]) for r in rows]
        period = times[-1] + times[1] - times[0]
        for count in [10**4, 10**5, 10**6] + [10**7] * (not self.quick):
            log = self.folder / "log.csv"
            with open(log, "w") as file:
                file.write("time_s,position_m,velocity_mps,force_n\n")
                for again in range(-(-count // len(rows))):
                    file.writelines(f"{again * period + t:.4f},{r}\n" for t, r in zip(times, rest[: count - again * len(rows)]))
            yield count, self.least_s("enhance", log)

    def layers(self):
        for count in (1, 2, 4, 8):
            file = self.folder / "layers.ron"
            file.write_text(scenario(MOTIONS[0], count))
            yield count, self.least_s("run", file)

    def recordings(self):
        """Two layers, four motions, one after the other; the assumed stiffnesses are a tenth too high."""
        assumed = self.folder / "assumed.ron"
        assumed.write_text(scenario("Recorded", 2, 66.0))
        files = [self.recording(f"r{k}", scenario(MOTIONS[k % 4]), k + 1) for k in range(8)]
        for count in (1, 2, 4, 8):
            yield count, self.least_s("diagnose", assumed, "--data", *files[:count])

    def trials(self):
        for count in [10**2, 10**3, 10**4] + [10**5] * (not self.quick):
            yield count, self.least_s("sweep", SWEEP, "--trials", count)


def growth(stylet, quick):
    """The picture, and the points as lines."""
    panels = []
    with tempfile.TemporaryDirectory() as folder:
        todo = Growth(stylet, folder, quick)
        for command, points in (("enhance", todo.samples), ("run", todo.layers), ("diagnose", todo.recordings), ("sweep", todo.trials)):
            panels.append((command, points.__name__, list(points())))
            note(f"{command}: " + ", ".join(f"{short(s, 3)} s for {spaced(n)} {points.__name__}" for n, s in panels[-1][2]))
    return figure(panels)


def figure(panels):
    """A row of panels with both axes logarithmic; all have the same range of seconds."""
    seconds = [s for _, _, points in panels for _, s in points]
    low, high = 1.0, 1.0
    while low > min(seconds):
        low /= 10
    while high < max(seconds):
        high *= 10
    left, gap, width = 56, 26, 148
    parts = [f'<text transform="translate(14 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)" text-anchor="middle">processor time (s)</text>']
    for k, (command, x_label, points) in enumerate(panels):
        parts += log_panel(f"stylet {command}", x_label, points, left + k * (width + gap), width, (low, high), k == 0)
    return picture("Processor time of whole commands", parts, "Grey: time proportional to the number on the axis.")


def log_panel(title, x_label, points, left, width, y_range, with_numbers):
    floor, (x0, x1), (y0, y1) = HEIGHT - BOTTOM, (points[0][0], points[-1][0]), y_range
    px = lambda x: left + log10(x / x0) / log10(x1 / x0) * width
    py = lambda y: floor - log10(y / y0) / log10(y1 / y0) * (floor - TOP)
    out = [text(left, 50, title, style=' class="h"')]
    for x, _ in points:
        power = round(log10(x))
        name = f"{x:g}" if x < 10 else "10" + "".join("⁰¹²³⁴⁵⁶⁷⁸⁹"[int(d)] for d in str(power))
        out.append(f'<path d="M{px(x):.1f} {TOP}V{floor}" stroke="{LINE}"/>' + text(px(x), floor + 15, name, "middle"))
    for power in range(round(log10(y0)), round(log10(y1)) + 1):
        y = py(10.0**power)
        out.append(f'<path d="M{left} {y:.1f}H{left + width}" stroke="{LINE}"/>')
        if with_numbers:
            out.append(text(left - 6, y + 4, f"{10.0**power:g}", "end"))
    out.append(text(left + width / 2, floor + 32, x_label, "middle"))
    # Through the last point, from the lower edge on.
    slope = points[-1][1] / x1
    start = max(x0, y0 / slope)
    out.append(f'<path d="M{px(start):.1f} {py(slope * start):.1f}L{px(x1):.1f} {py(slope * x1):.1f}" stroke="{GREY}"/>')
    # The label stands below its upper end, where the line leaves most room.
    at = left + width - 46
    y = py(slope * x0 * (x1 / x0) ** ((at - left) / width))
    out.append(text(at, min(y + 16, floor - 4), "linear"))
    out.append(f'<path d="M{"L".join(f"{px(x):.1f} {py(y):.1f}" for x, y in points)}" stroke="{BLUE}" stroke-width="1.6"/>')
    out += [f'<circle cx="{px(x):.1f}" cy="{py(y):.1f}" r="3" fill="{BLUE}"/>' for x, y in points]
    return out


# The page.


def first_cell(line):
    return line.split("|")[1].strip()


def with_rows(page, rows):
    """The page with these rows in the table; a row that it lacks comes last."""
    lines = page.splitlines()
    if HEAD not in lines:
        raise Failed(f"{PAGE.relative_to(ROOT)} has no table {HEAD}")
    begin = lines.index(HEAD) + 2
    end = next((k for k in range(begin, len(lines)) if not lines[k].startswith("|")), len(lines))
    table, new = lines[begin:end], {first_cell(r): r for r in rows}
    table = [new.pop(first_cell(line), line) for line in table] + list(new.values())
    return "\n".join(lines[:begin] + table + lines[end:]) + "\n"


def replace(path, text):
    """All or nothing."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.write_text(text)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


DEFAULT = {"core": core, "arm": arm, "sweep": sweep, "build": build, "diagnose": diagnose, "reproduce": reproduce, "growth": growth}
WHEN_NAMED = {"languages": languages, "large": large, "plan": plan, "checks": checks}


def arguments():
    parser = argparse.ArgumentParser(
        description="Measures what the operations of Stylet cost, and remakes the table and the picture of docs/explanation/performance.md.",
        epilog="examples:\n  python3 benches/performance.py target/release/stylet --write\n"
        "  python3 benches/performance.py target/release/stylet --only growth --quick --write\n"
        f"\nparts: {', '.join(DEFAULT)}; only when named: {', '.join(WHEN_NAMED)}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("stylet", metavar="STYLET", type=Path, help="release build of the command")
    parser.add_argument("--only", metavar="PART", nargs="+", choices=[*DEFAULT, *WHEN_NAMED], default=list(DEFAULT), help="run these parts")
    parser.add_argument("--quick", action="store_true", help="growth to 10^6 samples and 10^4 trials, with fewer repetitions")
    parser.add_argument("--write", action="store_true", help="replace the rows in the page, and the picture")
    args = parser.parse_args()
    args.stylet = args.stylet.resolve()
    if not os.access(args.stylet, os.X_OK):
        parser.error(f"{args.stylet} is no program: cargo build --release")
    return args


def main():
    args = arguments()
    made = ROOT / "target/peers/bin/python"
    if made.exists():
        os.environ.setdefault("STYLET_PEERS_PYTHON", str(made))
    rows, drawn, failed = [], None, []
    for part in dict.fromkeys(args.only):
        note(part)
        try:
            if part == "growth":
                drawn = growth(args.stylet, args.quick)
            else:
                for line in {**DEFAULT, **WHEN_NAMED}[part](args.stylet):
                    rows.append(line)
        except (Failed, OSError) as why:
            failed.append(part)
            note(f"{part} failed: {why}")
    print("\n".join([HEAD, "|---" * 6 + "|", *rows]))
    if args.write:
        try:
            replace(PAGE, with_rows(PAGE.read_text(), rows))
            if drawn:
                replace(FIGURE, drawn)
        except (Failed, OSError) as why:
            failed.append("write")
            note(f"not written: {why}")
    if failed:
        sys.exit(f"performance: failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
