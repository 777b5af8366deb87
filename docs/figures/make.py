#!/usr/bin/env python3
"""Makes the figures of the documentation with the command `stylet`.

    python3 docs/figures/make.py STYLET            # SVG figures: standard library only
    python3 docs/figures/make.py STYLET --reports  # also the pictures of reports (needs playwright and pillow)
    STYLET_MEASURED=/folder python3 docs/figures/make.py STYLET --measured  # also measured.svg (minutes; an absolute path)

Writes into the folder of this file: one picture per effect (effects/NAME.svg) and failure (failures/NAME.svg), the moving first picture (needle.svg), the figures of runs and
diagnoses with fewer points, and with --reports the pictures in report/. Figures that take minutes are made by the commands named on their pages.
"""

import csv
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True
from drawing import BLUE, FONT, GREY, INK, LINE, ORANGE, SOFT, path  # noqa: E402
import gallery  # noqa: E402

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
LAYERS = ["#56b4e9", "#e69f00", "#009e73"]


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
        gallery.effects(command)
        gallery.failures(command)
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
