#!/usr/bin/env python3
"""Drives `stylet studio` in headless Chromium: open, correct a unit, look, drag a face, diagnose, plan, predict, save, reopen.

usage: studio_in_browser.py STYLET_BINARY [--pictures DIR] [--picture-for-docs FILE.png] [--long]

Needs a browser (CHROME, or chromium on the path) and the Python packages playwright and, for the accessibility checks, axe-playwright-python
(pip install playwright axe-playwright-python). Exit code 0: passed, 77: something is missing.
"""
import argparse
import math
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

try:
    from playwright.sync_api import sync_playwright
except ImportError:
    print("skipped: the Python package playwright is missing (pip install playwright)")
    sys.exit(77)

try:
    import axe_playwright_python

    AXE = next(pathlib.Path(axe_playwright_python.__file__).parent.glob("axe*.js"), None)
except ImportError:
    AXE = None

PHANTOM = """Scenario(
    name: "two gels",
    tissue: (layers: [
        (thickness_m: 0.02, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.8),
        (thickness_m: 0.04, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0),
    ]),
    effects: [CoulombFriction(c_n_per_m: 3.0)],
    motion: Program(start_m: -0.005, segments: [
        Move(velocity_mps: 0.002, duration_s: 15.0), Hold(duration_s: 3.0),
        Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 15.0),
        Move(velocity_mps: -0.004, duration_s: 5.0),
    ]),
    sensor: ForceTorque(noise_n: 0.01, ar1: 0.5),
)
"""
ATTACK = "<img src=x onerror=document.title='attacked'>"


def check(condition, what):
    if not condition:
        raise SystemExit(f"FAILED: {what}")
    print(f"  {what}")


def recordings(stylet, folder):
    """Two simulated recordings in SI units, and copies in other units and under other names."""
    (folder / "real.ron").write_text(PHANTOM)
    made = []
    for seed in (1, 2):
        out = folder / f"run{seed}"
        subprocess.run([stylet, "run", folder / "real.ron", "--seed", str(seed), "-q", "--out", out], check=True)
        rows = [line.split(",")[:3] for line in (out / "recording.csv").read_text().splitlines()]
        names = rows[0]
        order = [names.index(n) for n in ("time_s", "position_m", "force_n")]
        table = [[float(row[k]) for k in order] for row in rows[1:]]
        made.append(table)
    def write(name, table, header="time_s,position_m,force_n", scale=(1, 1, 1), separator=","):
        lines = [header.replace(",", separator)] + [separator.join(repr(v * s) for v, s in zip(row, scale)) for row in table]
        (folder / name).write_text("\n".join(lines) + "\n")
        return folder / name
    long = [[k * 1e-3, 2e-3 * k * 1e-3 - 0.005, max(0.0, 50 * (2e-6 * k - 0.005)) + 0.01 * math.sin(k)] for k in range(45_000)]
    return {
        "a": write("a.csv", made[0]),
        "b": write("b.csv", made[1]),
        "mm": write("in_mm.csv", made[0], "time_s,depth,force_n", (1, 1e3, 1)),
        "attack": write(f"{ATTACK.replace('/', '_')}.csv", made[0][:400], f"time_s,position_m,force_n"),
        "attack_column": write("column.csv", [row + [0.0] for row in made[0][:400]], f"time_s,position_m,force_n,{ATTACK.replace(',', ' ')}", (1, 1, 1, 1)),
        "long": write("long.csv", long),
        "table": made[0],
    }


def foreign(table):
    """The same recording as ten other programs write it."""
    def text(header, separator=",", scale=(1, 1, 1), units=None, before="", decimal=".", index=False):
        rows = [header] if header else []
        rows += [units] if units else []
        for k, row in enumerate(table):
            values = [repr(round(v * s, 9)).replace(".", decimal) for v, s in zip(row, scale)]
            rows.append(separator.join(([str(k)] if index else []) + values))
        return before + "\n".join(rows) + "\n"
    return {
        "semicolons.csv": text("time_s;position_m;force_n", ";"),
        "decimal_comma.csv": text("time_s;position_m;force_n", ";", decimal=","),
        "tabs.txt": text("time_s\tposition_m\tforce_n", "\t"),
        "blanks.txt": text("time_s position_m force_n", " "),
        "milliseconds.csv": text("time (ms),position (mm),force (N)", scale=(1e3, 1e3, 1)),
        "unit_row.csv": text("time,position,force", units="s,mm,N", scale=(1, 1e3, 1)),
        "german.csv": text("Zeit;Weg;Kraft", ";", units="s;mm;N", scale=(1, 1e3, 1), decimal=","),
        "preamble.csv": text("time_s,position_m,force_n", before="Machine 7\nOperator: somebody\n\n"),
        "comments.csv": text("time_s,position_m,force_n", before="# logged by a robot\n"),
        "millinewton.csv": text("time [s],displacement [mm],force [mN]", scale=(1, 1e3, 1e3)),
    }


class Studio:
    """`stylet studio` with its address."""

    def __init__(self, stylet, out, *files):
        self.process = subprocess.Popen([stylet, "studio", "--no-open", "--out", out, *files], stdout=subprocess.PIPE, text=True)
        self.address = re.search(r"http\S+", self.process.stdout.readline()).group()

    def memory_mb(self):
        status = pathlib.Path(f"/proc/{self.process.pid}/status")
        return int(re.search(r"VmRSS:\s+(\d+)", status.read_text()).group(1)) / 1024 if status.exists() else 0.0

    def end(self):
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(10)


def drop(page, path):
    """Drops a file on the page, as a mouse would."""
    page.set_input_files("#chooser", str(path))


def find_browser():
    return os.environ.get("CHROME") or shutil.which("chromium") or shutil.which("google-chrome")


def launch(playwright):
    return playwright.chromium.launch(executable_path=find_browser(), args=["--no-sandbox", "--disable-gpu"])


def wait_drawn(page, view, timeout=20_000):
    page.wait_for_function("v => document.getElementById('view-' + v).dataset.drawn", arg=view, timeout=timeout)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("stylet")
    parser.add_argument("--pictures", type=pathlib.Path)
    parser.add_argument("--picture-for-docs", type=pathlib.Path)
    parser.add_argument("--long", action="store_true", help="20 diagnoses, and their memory")
    options = parser.parse_args()
    if not find_browser():
        print("skipped: no browser")
        return 77
    stylet = str(pathlib.Path(options.stylet).resolve())
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="stylet-studio-test-"))
    workspace = scratch / "workspace"
    files = recordings(stylet, scratch)
    studio = Studio(stylet, workspace)
    faults = []
    try:
        with sync_playwright() as playwright:
            browser = launch(playwright)
            context = browser.new_context(viewport={"width": 1600, "height": 1000})
            page = context.new_page()
            watch(page, studio.address, faults)
            walk(page, studio, files, workspace, options)
            studio.end()
            check(not list(pathlib.Path(tempfile.gettempdir()).glob(f"stylet-studio-{studio.process.pid}*")), "the temporary folder is gone")
            studio = Studio(stylet, workspace)
            page = context.new_page()
            watch(page, studio.address, faults)
            reopen(page, studio)
            views(page, options)
            if options.long:
                many_diagnoses(page, studio)
            browser.close()
        check(not faults, f"no console error, nothing requested from another host: {faults[:5]}")
    finally:
        studio.process.kill()
        shutil.rmtree(scratch, ignore_errors=True)
    print("studio_in_browser: all passed")
    return 0


def watch(page, address, faults):
    host = address.split("/")[2]
    page.on("console", lambda m: faults.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda e: faults.append(str(e)))
    page.on("request", lambda r: None if r.url.startswith((f"http://{host}/", "data:", "blob:", "about:")) else faults.append(r.url))


def walk(page, studio, files, workspace, options):
    start = time.time()
    page.goto(studio.address)
    wait_drawn(page, "phantom")
    first = time.time() - start
    check(first < 3.0, f"the three-layer phantom is drawn {first:.2f} s after the page was asked for")
    check(page.locator("#view-phantom .face").count() == 4, "four faces can be dragged")
    # Text from outside stays text.
    page.get_by_label("name of layer 1").fill(ATTACK)
    page.get_by_label("name of layer 1").press("Enter")
    page.get_by_label("name of the phantom").fill(ATTACK)
    page.get_by_label("name of the phantom").press("Enter")
    page.wait_for_function("() => document.querySelector('textarea').value.includes('<img')")
    drop(page, files["attack"])
    wait_drawn(page, "look")
    drop(page, files["attack_column"])
    page.wait_for_function("() => document.getElementById('view-look').dataset.drawn?.startsWith('column.csv')")
    page.keyboard.press("1")
    page.get_by_role("region", name="columns").wait_for()
    check(page.title() == "Stylet Studio" and page.locator("main img").count() == 0, "script in file, column, layer and scenario names is shown as text")
    for name in page.get_by_role("button", name=re.compile("^Remove ")).all_text_contents():
        page.get_by_role("button", name=re.compile("^Remove ")).first.click()
        page.wait_for_timeout(200)
    # A unit is corrected by clicking.
    drop(page, files["mm"])
    page.get_by_text("at 200 Hz").first.wait_for()
    page.keyboard.press("1")
    page.get_by_label("unit of depth").select_option("cm")
    page.wait_for_timeout(500)
    page.get_by_label("unit of depth").select_option("mm")
    page.wait_for_timeout(500)
    check((workspace / "columns.ron").read_text().count("0.001") == 1, "the corrected unit is in columns.ron")
    page.get_by_role("button", name="Forget the map").click()
    page.get_by_role("button", name=re.compile("^Remove in_mm")).click()
    for name, text in foreign(files["table"]).items():
        path = files["a"].parent / name
        path.write_text(text, encoding="utf-8")
        drop(page, path)
        page.wait_for_function("n => document.getElementById('view-look').dataset.drawn?.startsWith(n)", arg=name)
        page.keyboard.press("1")
        page.get_by_text("samples over 37.99 s").first.wait_for()
        page.get_by_role("button", name=f"Remove {name}").click()
        forget = page.get_by_role("button", name="Forget the map")
        if forget.count():
            forget.click()
        page.get_by_role("button", name=f"Remove {name}").wait_for(state="hidden")
    check(True, "ten files of other programs are read without a click")
    # A file without time needs its sampling rate.
    (files["a"].parent / "no_time.csv").write_text("\n".join(["position_m,force_n"] + [f"{row[1]},{row[2]}" for row in files["table"]]))
    drop(page, files["a"].parent / "no_time.csv")
    page.get_by_label("samples per second").fill("200")
    page.get_by_role("button", name="Use it").click()
    page.get_by_text("text table, 7600 samples over 37.99 s at 200 Hz").wait_for()
    page.get_by_role("button", name="Look at it").click()
    page.wait_for_function("() => document.getElementById('view-look').dataset.drawn?.startsWith('no_time.csv')")
    check("rate_hz: 200" in (workspace / "columns.ron").read_text(), "a file without time is read with the sampling rate that the user gives")
    page.keyboard.press("1")
    page.get_by_role("button", name="Forget the map").click()
    page.get_by_role("button", name="Remove no_time.csv").click()
    # A scenario is a phantom.
    (files["a"].parent / "assumed.ron").write_text(PHANTOM.replace("two gels", "dropped phantom"))
    drop(page, files["a"].parent / "assumed.ron")
    page.wait_for_function("() => document.querySelector('#view-phantom .name')?.value === 'dropped phantom'")
    check(True, "a scenario that is dropped becomes the phantom")
    # A long recording is drawn at once.
    begin = time.time()
    drop(page, files["long"])
    page.wait_for_function("() => document.getElementById('view-look').dataset.drawn?.startsWith('long.csv')")
    check(time.time() - begin < 3.0, f"45 000 samples are enhanced and drawn {time.time() - begin:.2f} s after the drop")
    page.keyboard.press("1")
    page.get_by_role("button", name=re.compile("^Remove long")).click()
    # Two recordings, layers from the online algorithm, a dragged face.
    drop(page, files["a"])
    page.wait_for_function("() => document.getElementById('view-look').dataset.drawn?.startsWith('a.csv')")
    drop(page, files["b"])
    page.wait_for_function("() => document.getElementById('view-look').dataset.drawn?.startsWith('b.csv')")
    page.get_by_label("Paper", exact=True).check()
    page.get_by_role("heading", name="Paper").wait_for()
    page.get_by_role("button", name="Write results").first.click()
    page.get_by_text("written to").wait_for()
    check((workspace / "enhanced-b" / "enhance.json").exists(), "stylet enhance's files are written")
    moved = move_rupture(page)
    page.get_by_role("button", name=re.compile("Start a phantom")).first.click()
    page.wait_for_function("() => !document.getElementById('view-phantom').hidden && document.querySelector('.summary').textContent.includes('along')")
    face = page.locator("#view-phantom .face").nth(1).get_attribute("aria-valuenow")
    check(abs(float(face) - moved) < 0.02, f"the phantom's face is where the rupture was dragged: {face} mm")
    drag(page)
    # The phantom of the diagnosis: the two gels without their dry friction.
    text = PHANTOM.replace("    effects: [CoulombFriction(c_n_per_m: 3.0)],\n", "")
    page.get_by_text("As text (phantom.ron)").click()
    page.get_by_label("scenario as RON").fill(text)
    page.get_by_role("button", name="Apply").click()
    page.wait_for_function("() => document.querySelector('.name').value === 'two gels'")
    page.get_by_role("button", name="Simulate and score").click()
    page.get_by_text("ruptures found").wait_for(timeout=60_000)
    page.get_by_role("tab", name="Explain").click()
    page.get_by_role("button", name="Diagnose").click()
    page.get_by_role("heading", name=re.compile("The simulation lacks")).wait_for(timeout=120_000)
    check("coulomb" in page.locator(".hero h2").text_content(), "the diagnosis names the hidden dry friction")
    page.locator(".cause input").first.uncheck()
    page.wait_for_timeout(300)
    page.get_by_role("button", name="Plan the next insertion").click()
    page.get_by_role("button", name="See it on the phantom").wait_for(timeout=120_000)
    check((workspace / "plan" / "plan.ron").exists(), "the planned motion is in plan.ron")
    page.get_by_role("button", name="Predict b.csv").click()
    page.get_by_role("region", name="prediction").wait_for(timeout=60_000)
    page.keyboard.press("c")
    drawer = page.locator("#drawer").text_content()
    check(all(f"stylet {c}" in drawer for c in ("run", "enhance", "diagnose", "plan", "predict")), "the drawer shows every command")
    page.keyboard.press("c")
    page.keyboard.press("3")
    page.get_by_role("button", name="Save").click()
    page.get_by_text("Saved as phantom.ron").wait_for()
    same_bytes(studio, workspace)


def move_rupture(page):
    """Drags the first rupture 20 pixels deeper; its depth then, in mm."""
    rupture = page.locator("#view-look .face.rupture").first
    box, before = rupture.bounding_box(), float(rupture.get_attribute("aria-valuenow"))
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] - 20
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 20, y, steps=5)
    page.mouse.up()
    page.get_by_role("button", name="Back to what was detected").wait_for()
    page.wait_for_timeout(300)
    after = float(rupture.get_attribute("aria-valuenow"))
    check(after > before, f"a rupture is dragged from {before} to {after} mm")
    return after


# One movement of the pointer per frame for two seconds, as a mouse gives; Playwright's own mouse waits for the browser after each one.
FRAME_RATE = """async () => {
  const face = document.querySelectorAll('#view-phantom .face')[1], view = document.getElementById('view-phantom'), frames = () => Number(view.dataset.frames || 0);
  Object.assign(face, { setPointerCapture() {}, releasePointerCapture() {}, hasPointerCapture: () => true });
  const x = face.getBoundingClientRect().left, send = (kind, dx) => face.dispatchEvent(new PointerEvent(kind, { clientX: x + dx, pointerId: 1, bubbles: true }));
  send('pointerdown', 0);
  const before = frames(), begin = performance.now();
  for (let step = 0; performance.now() - begin < 2000; step++) {
    await new Promise(requestAnimationFrame);
    send('pointermove', step % 60);
  }
  const rate = (frames() - before) / (performance.now() - begin) * 1000;
  send('pointerup', 60);
  for (const name of ['setPointerCapture', 'releasePointerCapture', 'hasPointerCapture']) delete face[name];
  return rate;
}"""


def drag(page):
    face = page.locator("#view-phantom .face").nth(1)
    box = face.bounding_box()
    before = face.get_attribute("aria-valuenow")
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    for step in range(60):
        page.mouse.move(box["x"] + box["width"] / 2 + step, box["y"] + box["height"] / 2)
    page.mouse.up()
    page.wait_for_timeout(300)
    check(face.get_attribute("aria-valuenow") != before, "a face is dragged")
    page.keyboard.press("Control+z")
    page.wait_for_function("([n, v]) => document.querySelectorAll('#view-phantom .face')[n].getAttribute('aria-valuenow') === v", arg=[1, before])
    check(True, "one undo takes the whole movement back")
    rate = page.evaluate(FRAME_RATE)
    page.wait_for_timeout(300)
    check(rate > 10, f"a dragged face redraws at {rate:.0f} frames per second")
    page.keyboard.press("Control+z")
    page.wait_for_function("([n, v]) => document.querySelectorAll('#view-phantom .face')[n].getAttribute('aria-valuenow') === v", arg=[1, before])


def same_bytes(studio, workspace):
    """The commands of the drawer give the bytes that the page wrote."""
    stylet = studio.process.args[0]
    with tempfile.TemporaryDirectory() as again:
        data = [workspace / "data" / name for name in ("a.csv", "b.csv")]
        subprocess.run([stylet, "diagnose", workspace / "phantom.ron", "--data", *data, "-q", "--out", f"{again}/d"], check=True)
        subprocess.run([stylet, "run", workspace / "phantom.ron", "-q", "--out", f"{again}/s"], check=True)
        for name, here in (("diagnosis.json", "d"), ("score.json", "s")):
            folder = {"d": "diagnosis", "s": "simulation"}[here]
            same = pathlib.Path(again, here, name).read_bytes() == (workspace / folder / name).read_bytes()
            check(same, f"{name} has the bytes of the command's")


def reopen(page, studio):
    page.goto(studio.address)
    page.get_by_role("heading", name=re.compile("The simulation lacks")).wait_for()
    page.keyboard.press("3")
    wait_drawn(page, "phantom")
    check(page.locator(".name").first.input_value() == "two gels", "the workspace opens again")


def views(page, options):
    """Every view at two widths, light and dark: pictures, and axe-core's verdict."""
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        for width in (900, 1600):
            page.set_viewport_size({"width": width, "height": 1000})
            for key, view in enumerate(("open", "look", "phantom", "explain"), 1):
                page.keyboard.press(str(key))
                page.wait_for_timeout(500)
                if view == "explain":
                    page.wait_for_timeout(300)
                if options.pictures:
                    options.pictures.mkdir(parents=True, exist_ok=True)
                    page.screenshot(path=str(options.pictures / f"{view}_{width}_{scheme}.png"))
                cut = page.evaluate("() => document.documentElement.scrollWidth - document.documentElement.clientWidth")
                check(cut <= 0, f"{view} at {width} px, {scheme}: nothing is cut at the right")
                if AXE:
                    page.evaluate(AXE.read_text())
                    found = page.evaluate("() => axe.run(document, { resultTypes: ['violations'] })")
                    grave = [f"{v['id']}: {v['nodes'][0]['html'][:120]}" for v in found["violations"] if v["impact"] in ("serious", "critical")]
                    check(not grave, f"{view} at {width} px, {scheme}: axe-core finds no serious fault {grave}")
    if options.picture_for_docs:
        page.emulate_media(color_scheme="light")
        page.set_viewport_size({"width": 1280, "height": 800})
        page.keyboard.press("4")
        page.wait_for_timeout(500)
        page.screenshot(path=str(options.picture_for_docs))


def many_diagnoses(page, studio):
    page.keyboard.press("4")
    for _ in range(20):
        page.get_by_role("button", name="Diagnose", exact=True).click()
        page.locator("#view-explain progress").wait_for()
        page.locator("#view-explain progress").wait_for(state="hidden", timeout=120_000)
    check(studio.memory_mb() <= 200, f"the server uses {studio.memory_mb():.0f} MB after 20 diagnoses")


if __name__ == "__main__":
    sys.exit(main())
