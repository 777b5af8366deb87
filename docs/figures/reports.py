"""Pictures of single parts of reports, cut out by a headless browser. Called by make.py with --reports; needs playwright and pillow."""

import io
import os
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SLIP = "effects: [ShaftSlip(layer: 1, push_n: 2.0, pull_n: 1.0, retained_share: 0.8, exponent: 10.0, wear_per_m: 50.0, rate: 0.0, curvature_n_per_m2: 30000.0, fractions: (0.2, 0.2), time_constants_s: (1.0, 10.0))]"
CONSTANT = "motion: Constant(start_m: -0.005, velocity_mps: 0.003, duration_s: 20.0),\n    sensor"


def prepare(stylet):
    """Runs every command whose report is shown; folders by name."""
    assumed = re.search(r"```ron\n(.*?)```", (ROOT / "README.md").read_text(), re.S).group(1)
    files = {
        "assumed": assumed,
        "real": assumed.replace("    motion:", "    effects: [CoulombFriction(c_n_per_m: 3.0)],\n    motion:", 1),
        "slip": assumed.replace("    motion:", f"    {SLIP},\n    motion:", 1),
        "once": re.sub(r"motion:.*sensor", CONSTANT, assumed, flags=re.S).replace("    motion:", "    effects: [CoulombFriction(c_n_per_m: 3.0)],\n    motion:", 1),
        "limits": "Limits(depth_m: 0.055, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 60.0, force_n: 6.0)\n",
        "noisy": (ROOT / "scenarios/three_layers.ron").read_text().replace("noise_n: 0.02)", "noise_n: 0.05),\n    enhance: (algorithm: Paper)"),
    }
    for name, text in files.items():
        (stylet.folder / f"{name}.ron").write_text(text)
    stylet("run", "scenarios/three_layers.ron", "--out", "good")
    stylet("run", "noisy.ron", "--out", "noisy")
    for name, seed in [("real", 1), ("real", 2), ("real", 3), ("slip", 1), ("slip", 2), ("once", 1)]:
        stylet("run", f"{name}.ron", "--seed", str(seed), "--out", f"{name}{seed}")
    stylet("enhance", "real1/recording.csv", "--out", "enhance")
    stylet("enhance", "slip1/recording.csv", "--out", "enhance-bad")
    stylet("check", "assumed.ron", "--data", "once1/recording.csv", "--out", "check")
    stylet("diagnose", "assumed.ron", "--data", "real1/recording.csv", "real2/recording.csv", "--out", "diagnose")
    stylet("diagnose", "assumed.ron", "--data", "slip1/recording.csv", "slip2/recording.csv", "--out", "unknown")
    stylet("diagnose", "assumed.ron", "--data", "once1/recording.csv", "--out", "first")
    stylet("predict", "diagnose/extended.ron", "--data", "real3/recording.csv", "--out", "predict")
    stylet("predict", "assumed.ron", "--data", "real3/recording.csv", "--out", "predict-bad")
    stylet("plan", "first", "--limits", "limits.ron", "--quick", "--out", "plan.ron")
    stylet("sweep", "scenarios/sweeps/noise.ron", "--trials", "2000", "--out", "sweep")


# Picture, page, and what is cut out: the chart or table whose heading is this, or a section.
PICTURES = [
    ("run_force", "good/report.html", "chart", "Force at the needle"),
    ("run_cusum", "good/report.html", "chart", "CUSUM, largest statistic divided by its threshold"),
    ("run_force_bad", "noisy/report.html", "chart", "Force at the needle"),
    ("run_score", "good/report.html", "section", "Score"),
    ("run_score_bad", "noisy/report.html", "section", "Score"),
    ("run_stiffness", "good/report.html", "chart", "Stiffness K"),
    ("enhance_force", "enhance/report.html", "chart", "Force at the needle"),
    ("enhance_force_bad", "enhance-bad/report.html", "chart", "Force at the needle"),
    ("check", "check/report.html", "section", "Before the fit"),
    ("diagnose_verdict", "diagnose/report.html", "section", "Verdict"),
    ("diagnose_misfit", "diagnose/report.html", "chart", "recording.csv: measured minus fitted"),
    ("diagnose_correlations", "first/report.html", "section", "Correlations of the estimates"),
    ("diagnose_remaining", "diagnose/report.html", "chart", "Residual of the extended model"),
    ("diagnose_remaining_bad", "unknown/report.html", "chart", "Residual of the extended model"),
    ("diagnose_velocity", "diagnose/report.html", "chart", "Residual against velocity"),
    ("diagnose_search", "diagnose/report.html", "section", "Search over the effect library"),
    ("diagnose_labels", "first/report.html", "section", "Base parameters"),
    ("predict", "predict/report.html", "chart", "measured minus predicted"),
    ("predict_bad", "predict-bad/report.html", "chart", "measured minus predicted"),
    ("plan_force", "plan.html", "chart", "Expected force under each candidate"),
    ("sweep_noise", "sweep/report.html", "chart", "Failed insertions by sensor.noise_n"),
]


def make(stylet, out):
    from PIL import Image
    from playwright.sync_api import sync_playwright

    prepare(stylet)
    out.mkdir(exist_ok=True)
    with sync_playwright() as play:
        chrome = "/usr/bin/chromium"
        browser = play.chromium.launch(executable_path=chrome if os.path.exists(chrome) else None, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 940, "height": 1000})
        for name, file, kind, heading in PICTURES:
            page.goto(f"file://{stylet.folder / file}")
            page.wait_for_timeout(700)
            if kind == "chart":
                part = page.locator("figure.chart").filter(has=page.locator("h3", has_text=heading)).first
            else:
                part = page.locator("section").filter(has=page.locator("h2", has_text=heading)).first
            part.scroll_into_view_if_needed()
            page.wait_for_timeout(300)
            image = Image.open(io.BytesIO(part.screenshot())).convert("RGB")
            image = image.crop((0, 0, image.width, min(image.height, 640)))
            image.quantize(32).save(out / f"{name}.png", optimize=True)
            print(name, image.size, (out / f"{name}.png").stat().st_size)
        browser.close()
