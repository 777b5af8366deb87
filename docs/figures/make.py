#!/usr/bin/env python3
"""Makes the figures of the documentation with the command `stylet`.

    python3 docs/figures/make.py STYLET            # SVG figures: standard library only
    python3 docs/figures/make.py STYLET --reports  # also the pictures of reports (needs playwright and pillow)
    STYLET_MEASURED=/folder python3 docs/figures/make.py STYLET --measured  # also measured.svg (minutes; an absolute path)

Writes into the folder of this file: one picture per effect (effects/NAME.svg), the moving first picture (needle.svg), the figures of runs and
diagnoses with fewer points, and with --reports the pictures in report/. Figures that take minutes are made by the commands named on their pages.
"""

import csv
import html
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True
HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
INK, SOFT, LINE, BLUE, GREY, ORANGE = "#1b1f24", "#5a636d", "#d9dde2", "#0072b2", "#9aa3ad", "#d55e00"
FONT = "system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif"
LAYERS = ["#56b4e9", "#e69f00", "#009e73"]

PHANTOM = """Scenario(
    name: "two gels",
    tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 3000.0, puncture_n: 0.8),
        (thickness_m: 0.04, stiffness_n_per_m: 60.0, friction_ns_per_m2: 4000.0, puncture_n: 1.8),
    ]),
    EFFECTS
    motion: Program(start_m: -0.005, segments: [
        Move(velocity_mps: 0.004, duration_s: 7.5), Hold(duration_s: 3.0),
        Ripple(velocity_mps: 0.004, amplitude_mps: 0.002, frequency_hz: 0.5, duration_s: 5.0), Move(velocity_mps: 0.006, duration_s: 2.0),
        Move(velocity_mps: -0.006, duration_s: 10.0),
    ]),
    robot: Replay,
    sensor: ForceTorque(noise_n: 0.0),
)
"""


class Stylet:
    """The command, run in a temporary folder."""

    def __init__(self, binary, folder):
        self.binary, self.folder = Path(binary).resolve(), Path(folder)
        (self.folder / "scenarios").symlink_to(ROOT / "scenarios")

    def __call__(self, *words):
        done = subprocess.run([self.binary, *words], cwd=self.folder, capture_output=True, text=True)
        if done.returncode not in (0, 1):
            sys.exit(f"stylet {' '.join(words)}: {done.stderr}")
        return done.stdout

    def run(self, name, text, *words):
        """Columns of the simulated recording of a scenario."""
        (self.folder / f"{name}.ron").write_text(text)
        self("run", f"{name}.ron", "--out", name, *words)
        with open(self.folder / name / "recording.csv") as file:
            rows = list(csv.DictReader(file))
        return {key: [float(r[key]) if r[key] else 0.0 for r in rows] for key in rows[0]}


def thin(points, tolerance):
    """Douglas-Peucker: the polyline with fewer points, each within `tolerance` of it."""
    if len(points) < 3:
        return points
    keep, stack = {0, len(points) - 1}, [(0, len(points) - 1)]
    while stack:
        a, b = stack.pop()
        (x0, y0), (x1, y1) = points[a], points[b]
        length = ((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5
        worst, at = 0.0, None
        for k in range(a + 1, b):
            x, y = points[k]
            d = abs((x1 - x0) * (y0 - y) - (x0 - x) * (y1 - y0)) / length if length else ((x - x0) ** 2 + (y - y0) ** 2) ** 0.5
            if d > worst:
                worst, at = d, k
        if at is not None and worst > tolerance:
            keep.add(at)
            stack += [(a, at), (at, b)]
    return [points[k] for k in sorted(keep)]


def path(points, tolerance=0.25):
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in thin(points, tolerance))


def ticks(low, high, wanted=4):
    step = next(s for e in range(-6, 6) for s in (1 * 10.0**e, 2 * 10.0**e, 5 * 10.0**e) if (high - low) / s <= wanted)
    first = int(low / step) - 1
    return [k * step for k in range(first, first + wanted + 4) if low - 1e-9 <= k * step <= high + 1e-9]


def panel(series, x_label, y_label, left, width, height):
    """Curves (colour, x, y) over common axes."""
    top, bottom, right = 34, 36, left + width
    xs, ys = [v for s in series for v in s[1]], [v for s in series for v in s[2]]
    x0, x1, y0, y1 = min(xs), max(xs), min(ys), max(ys)
    pad = max(0.05 * (y1 - y0), 0.01)
    y0, y1 = y0 - pad, y1 + pad
    px = lambda x: left + (x - x0) / (x1 - x0) * width
    py = lambda y: height - bottom - (y - y0) / (y1 - y0) * (height - top - bottom)
    out = []
    for x in ticks(x0, x1, 8):
        out.append(f'<path d="M{px(x):.1f} {top}V{height - bottom}" stroke="{LINE}"/><text x="{px(x):.1f}" y="{height - bottom + 14}" text-anchor="middle">{x:g}</text>')
    for y in ticks(y0, y1):
        out.append(f'<path d="M{left} {py(y):.1f}H{right}" stroke="{LINE}"/><text x="{left - 6}" y="{py(y) + 4:.1f}" text-anchor="end">{y:g}</text>')
    out.append(f'<text x="{left + width / 2}" y="{height - 6}" text-anchor="middle">{x_label}</text>')
    out.append(f'<text transform="translate({left - 38} {(top + height - bottom) / 2}) rotate(-90)" text-anchor="middle">{y_label}</text>')
    for colour, x, y in series:
        out.append(f'<path d="{path([(px(a), py(b)) for a, b in zip(x, y)])}" stroke="{colour}" stroke-width="1.6"/>')
    return out


def effect_figure(title, base, effect, over_depth):
    """Force with and without the effect, and their difference."""
    width, height = 760, 200
    name = "depth (mm)" if over_depth else "time (s)"
    curves = []
    for data in (base, effect):
        x, y = data["time_s"], data["force_n"]
        if over_depth:
            end = data["position_m"].index(max(data["position_m"])) + 1
            x, y = [1e3 * z for z in data["position_m"][:end]], y[:end]
        curves.append((x, y))
    (x0, y0), (x1, y1) = curves
    k, gap = 0, []
    for x, y in zip(x1, y1):
        while k + 1 < len(x0) and x0[k + 1] <= x:
            k += 1
        gap.append(y - y0[k])
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" role="img" aria-label="{html.escape(title)}">',
        f'<style>text{{font:11.5px {FONT};fill:{SOFT}}}.h{{font-size:13px;font-weight:600;fill:{INK}}}path{{fill:none;stroke-linejoin:round}}</style>',
        f'<rect width="{width}" height="{height}" fill="#fff"/><text class="h" x="50" y="20">{html.escape(title)}</text>',
        f'<path d="M560 16h14" stroke="{GREY}" stroke-width="2.5"/><text x="578" y="20">base law</text><path d="M645 16h14" stroke="{BLUE}" stroke-width="2.5"/><text x="663" y="20">with the effect</text>',
        *panel([(GREY, x0, y0), (BLUE, x1, y1)], name, "force (N)", 50, 340, height),
        *panel([(BLUE, x1, gap)], name, "difference (N)", 450, 300, height),
    ]
    return "\n".join(out) + "\n</svg>\n"


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
    "loading_hysteresis": ("fraction", "0.6"),
    "respiration": ("amplitude_m", "0.001"),
    "needle_compliance": ("stiffness_n_per_m", "300.0"),
    "rate_dependent_puncture": ("alpha", "0.3"),
    "position_dependent_force": ("stiffness_n_per_m", "10.0"),
}


# Effects that need another phantom or motion to act.
CHANGED = {
    "deep_indentation": [("puncture_n: 0.8", "puncture_n: 1.3")],
    "loading_hysteresis": [("Move(velocity_mps: 0.004, duration_s: 7.5)", "Move(velocity_mps: 0.004, duration_s: 4.0), Move(velocity_mps: -0.004, duration_s: 1.0), Move(velocity_mps: 0.004, duration_s: 4.5)")],
}


def effects(stylet):
    folder = HERE / "effects"
    folder.mkdir(exist_ok=True)
    base = stylet.run("base", PHANTOM.replace("EFFECTS", ""))
    page = (ROOT / "docs/reference/effects.md").read_text()
    for name, block in re.findall(r"^### (\w+)\n(.*?)(?=^##|\Z)", page, re.S | re.M):
        line = re.search(r"```ron\n(.*?),\n```", block, re.S).group(1)
        if name in VISIBLE:
            field, value = VISIBLE[name]
            line, changed = re.subn(rf"\b{field}: [-0-9.e]+", f"{field}: {value}", line)
            assert changed, (name, line)
        phantom = PHANTOM
        for old, new in CHANGED.get(name, []):
            assert old in phantom
            phantom = phantom.replace(old, new)
        without = stylet.run(f"{name}-without", phantom.replace("EFFECTS", "")) if name in CHANGED else base
        with_effect = stylet.run(name, phantom.replace("EFFECTS", f"effects: [{line}],"))
        title = line if len(line) < 62 else name
        (folder / f"{name}.svg").write_text(effect_figure(title, without, with_effect, name in OVER_DEPTH))


def moving_needle(stylet):
    """The first page's picture: a needle goes through three layers while the curves are drawn (SMIL)."""
    stylet("run", "scenarios/three_layers.ron", "--out", "three")
    with open(stylet.folder / "three/recording.csv") as file:
        rows = list(csv.DictReader(file))
    t, z = [float(r["time_s"]) for r in rows], [float(r["position_m"]) for r in rows]
    force, enhanced = [float(r["force_n"]) for r in rows], [float(r["enhanced_n"] or 0) for r in rows]
    score = json.loads((stylet.folder / "three/score.json").read_text())
    width, height, left, top, bottom, seconds = 760, 380, 52, 120, 340, 10
    px = lambda x: left + (x + 0.005) / 0.115 * (width - left - 16)
    py = lambda f: bottom - (f + 0.3) / 6.3 * (bottom - top)
    end = px(z[-1])
    faces = [0.0, 0.0282, 0.0659, 0.0981]
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" role="img" aria-label="A needle goes through three gel layers; measured and enhanced force over depth">',
        f"<style>text{{font:12px {FONT};fill:{SOFT}}}.h{{font-size:13px;font-weight:600;fill:{INK}}}path{{fill:none;stroke-linejoin:round}}</style>",
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
        f'<defs><clipPath id="c"><rect x="{left}" y="0" height="{height}" width="{end - left:.1f}"><animate attributeName="width" from="0" to="{end - left:.1f}" dur="{seconds}s" repeatCount="indefinite"/></rect></clipPath></defs>',
    ]
    for k, name in enumerate(["gel 25 %", "gel 50 % in latex", "gel 70 %"]):
        x, w = px(faces[k]), px(faces[k + 1]) - px(faces[k])
        out.append(f'<rect x="{x:.1f}" y="30" width="{w:.1f}" height="{bottom - 30}" fill="{LAYERS[k]}" fill-opacity=".13"/><text class="h" x="{x + w / 2:.1f}" y="24" text-anchor="middle">{name}</text>')
    for x in range(0, 111, 20):
        out.append(f'<text x="{px(x / 1e3):.1f}" y="{bottom + 16}" text-anchor="middle">{x}</text>')
    for y in range(0, 7, 2):
        out.append(f'<path d="M{left} {py(y):.1f}H{width - 16}" stroke="{LINE}"/><text x="{left - 8}" y="{py(y) + 4:.1f}" text-anchor="end">{y}</text>')
    out.append(f'<text x="{(left + width) / 2}" y="{height - 8}" text-anchor="middle">depth of the tip (mm)</text><text transform="translate(14 {(top + bottom) / 2}) rotate(-90)" text-anchor="middle">force (N)</text>')
    out.append(f'<g clip-path="url(#c)"><path d="{path([(px(a), py(b)) for a, b in zip(z, force)], 0.8)}" stroke="{GREY}" stroke-width="2"/><path d="{path([(px(a), py(b)) for a, b in zip(z, enhanced)], 0.8)}" stroke="{BLUE}" stroke-width="2"/>')
    for r in score["ruptures"]:
        x = px(-0.005 + 0.0023 * r["detected_s"])
        out.append(f'<path d="M{x:.1f} 30V{bottom}" stroke="{ORANGE}" stroke-width="1.5" stroke-dasharray="5 3"/>')
    out.append("</g>")
    out.append(
        f'<g><animateTransform attributeName="transform" type="translate" from="{left - end:.1f} 0" to="0 0" dur="{seconds}s" repeatCount="indefinite"/>'
        f'<path d="M{left - 700} 70H{end - 14:.1f}L{end:.1f} 73L{end - 14:.1f} 76H{left - 700}Z" style="fill:{SOFT};stroke:none"/></g>'
    )
    for k, (name, colour) in enumerate([("measured", GREY), ("enhanced", BLUE), ("rupture detected", ORANGE)]):
        out.append(f'<path d="M{left + 8 + 95 * k} 104h14" stroke="{colour}" stroke-width="3"/><text x="{left + 27 + 95 * k}" y="108">{name}</text>')
    (HERE / "needle.svg").write_text("\n".join(out) + "\n</svg>\n")


def smaller(text, tolerance=0.5):
    """An SVG figure of the command with fewer points."""

    def shorten(match):
        points = [tuple(map(float, p.split())) for p in match.group(1).split("L")]
        return f'd="{path(points, tolerance)}"' if len(points) > 20 else match.group(0)

    return re.sub(r'd="M((?:-?[\d.]+ -?[\d.]+L)+-?[\d.]+ -?[\d.]+)"', shorten, text)


def compact(text):
    """A figure without metadata, comments and digits of coordinates that no screen shows."""
    if text.startswith('<svg text-anchor="middle"') or 'class="k0"' in text:
        return text  # done before
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", text, flags=re.S)

    def coordinates(match):
        return re.sub(r"-?\d+\.\d{2,}", lambda m: f"{float(m.group()):.1f}".removesuffix(".0"), match.group())

    text = re.sub(r'\b(d|x|y|width|height)="[^"]*"', coordinates, text)
    text = re.sub(r' (class|style)=""', "", text)
    # Drawings of matplotlib: repeated styles become classes, names become short, groups lose theirs.
    styles = sorted({s for s in re.findall(r'style="([^"]*)"', text) if text.count(s) > 2})
    for k, style in enumerate(styles):
        text = text.replace(f'style="{style}"', f'class="k{k}"')
    if styles:
        rules = "".join(f".k{k}{{{s}}}" for k, s in enumerate(styles))
        text = text.replace("</style>", f"{rules}</style>", 1)
    text = text.replace("DejaVuSans-", "d").replace("xlink:href", "href")
    used = set(re.findall(r"[#(]#?([\w.-]+)", text))
    text = re.sub(r' id="([\w.-]+)"', lambda m: m.group() if m.group(1) in used else "", text)
    # Centred text is the default where most texts are.
    if 2 * text.count('text-anchor="middle"') > text.count("<text"):
        text = re.sub(r"<text(?![^>]*text-anchor)", '<text text-anchor="start"', text).replace(' text-anchor="middle"', "")
        text = text.replace("<svg ", '<svg text-anchor="middle" ', 1)
    return re.sub(r">\s+<", "><", re.sub(r"[ \n]+", " ", text))


def figures_of_commands(stylet):
    stylet("run", "scenarios/three_layers.ron", "--out", "three")
    readme = (ROOT / "README.md").read_text()
    assumed = re.search(r"```ron\n(.*?)```", readme, re.S).group(1)
    (stylet.folder / "assumed.ron").write_text(assumed)
    (stylet.folder / "real.ron").write_text(assumed.replace("    motion:", "    effects: [CoulombFriction(c_n_per_m: 3.0)],\n    motion:", 1))
    for seed in "123":
        stylet("run", "real.ron", "--seed", seed, "--out", f"r{seed}")
    stylet("diagnose", "assumed.ron", "--data", "r1/recording.csv", "r2/recording.csv", "--out", "out")
    stylet("enhance", "r1/recording.csv", "--out", "enhanced")
    for source, name in [("three", "three_layers"), ("out", "two_gels_diagnosis")]:
        text = (stylet.folder / source / "figure.svg").read_text()
        tolerance = 0.5
        while len(smaller(text, tolerance)) > 60_000 and tolerance < 4:
            tolerance *= 1.4
        (HERE / f"{name}.svg").write_text(smaller(text, tolerance))


def figure_of_measured_insertions(stylet):
    """The held-out errors of the measured insertions, without a measured curve."""
    stylet("diagnose", "scenarios/measured/skin_on_muscle.ron", "--out", "measured")
    (HERE / "measured.svg").write_text((stylet.folder / "measured/gain.svg").read_text())


def pictures_of_reports(stylet):
    import reports

    reports.make(stylet, HERE / "report")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as folder:
        command = Stylet(sys.argv[1], folder)
        effects(command)
        moving_needle(command)
        figures_of_commands(command)
        if "--measured" in sys.argv:
            figure_of_measured_insertions(command)
        if "--reports" in sys.argv:
            pictures_of_reports(command)
    for file in sorted(HERE.rglob("*.svg")):
        if file.stat().st_size > 60_000:
            file.write_text(compact(file.read_text()))
        if file.stat().st_size > 60_000:
            print(f"{file.name}: {file.stat().st_size} bytes, more than 60 kB")
