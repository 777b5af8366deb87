#!/usr/bin/env python3
"""Runs enhance and diagnose on recordings with a faulty zero, and inspect and enhance on files as instruments write them.

usage: rough_recordings.py STYLET FOLDER

FOLDER holds phantom.ron (two gels: surface at 0, ruptures at 16 and 60 mm, K 50 and 90 N/m) and recordings of it named after what is wrong,
such as air_step_1.csv, drift_-26_mn_per_s.csv, bias_20.csv, begins_loaded.csv; every other file counts as one of an instrument. Prints one line per
file and the number of files that are not as expected. Exit code 1 when there is any.
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile

STYLET, FOLDER = sys.argv[1], pathlib.Path(sys.argv[2])
CLOCKS = {"periodic_interference", "respiration"}


def run(*args, out):
    done = subprocess.run([STYLET, *map(str, args), "-q", "--out", out], capture_output=True, text=True)
    return done.returncode, done.stderr


def enhance(path, out, *more):
    code, message = run("enhance", path, *more, out=out)
    file = pathlib.Path(out, "enhance.json")
    return (json.loads(file.read_text())["found"][0] if code == 0 and file.exists() else None), message


def diagnose(path, out):
    code, message = run("diagnose", FOLDER / "phantom.ron", "--data", path, out=out)
    return (json.loads(pathlib.Path(out, "diagnosis.json").read_text()) if code == 0 else None), message


def is_phantom(found, near_m=0.3e-3, contact=True):
    """Contact at 0, two ruptures at 16 and 60 mm, K of both layers within 10 %."""
    if found is None:
        return False
    places = [r["located_m"] for r in found["ruptures"]]
    stiffness = [layer["stiffness_n_per_m"] for layer in found["layers"]]
    return (
        (not contact or (found["contact_m"] is not None and abs(found["contact_m"]) < near_m))
        and len(places) == 2 and abs(places[0] - 0.016) < 5e-4 and abs(places[1] - 0.06) < 5e-4
        and abs(stiffness[0] / 50 - 1) < 0.1 and abs(stiffness[1] / 90 - 1) < 0.1
    )


def names(diagnosis):
    return [] if diagnosis is None else [c["effect"] for c in diagnosis["causes"]]


def value(diagnosis, parameter):
    return diagnosis["causes"][0]["parameters"][parameter]["value"]


def zero_fault(name, path, out):
    found, message = enhance(path, f"{out}/e")
    diagnosis, why = diagnose(path, f"{out}/d")
    hypothesis = found["contact"]["hypothesis"] if found else message.strip()
    said = f"{hypothesis}; {diagnosis['verdict'] if diagnosis else why.strip()} {' + '.join(names(diagnosis))}"
    number = float((re.findall(r"m?-?\d+\.?\d*", name) or ["0"])[0].replace("m", "-"))
    if name.startswith("air_step"):
        good = is_phantom(found) and hypothesis == "zero_step" and names(diagnosis) == ["zero_step"]
        good = good and abs(value(diagnosis, "step_n") + number) < 0.02
    elif name.startswith("tissue_step"):
        steps = found["contact"]["zero_steps"] if found else []
        good = is_phantom(found) and len(steps) == 1 and names(diagnosis) == ["zero_step"]
    elif name.startswith("drift"):
        good = is_phantom(found) and "drift" in hypothesis and names(diagnosis) == ["force_drift"]
        good = good and abs(1e3 * value(diagnosis, "rate_n_per_s") - number) < 0.5
    elif name.startswith("tilt"):
        good = is_phantom(found, 0.5e-3) and "line" in hypothesis and names(diagnosis) == ["position_dependent_force"]
        good = good and abs(value(diagnosis, "stiffness_n_per_m") - number) < 0.2
    elif name.startswith("bias"):
        good = is_phantom(found) and names(diagnosis) == ["force_bias"] and abs(value(diagnosis, "force_n") - number) < 0.02
    elif name.startswith("begins_loaded"):
        good = is_phantom(found, contact=False) and hypothesis == "begins_loaded" and diagnosis is not None and diagnosis["verdict"] == "none"
    elif name.startswith("zero_jumps"):
        good = diagnosis is not None and not diagnosis["agrees"] and "zero_step" in names(diagnosis)
    else:  # cyclic motion
        good = diagnosis is not None and not CLOCKS & set(names(diagnosis))
    return good, said


def of_an_instrument(path, out):
    found, message = enhance(path, out)
    if found is None and "--repair" in message:
        found, message = enhance(path, out, "--repair")
    if found is not None and is_phantom(found):
        return True, "read"
    if found is not None:
        # Read with a doubtful unit: the first proposal has to be the right one.
        done = subprocess.run([STYLET, "inspect", path], capture_output=True, text=True)
        remark = next((line.strip() for line in done.stdout.splitlines() if "may be in" in line), "")
        return path.stem in {"grams", "inches"} and re.search(r"may be in (gram-force|inch)", remark) is not None, f"read; {remark}"
    # Refused with the place or the field, and with the command that helps.
    message = " ".join(message.replace("│", " ").split())
    return "stylet inspect" in message, "refused: " + message[message.find(path.name):]


def main():
    faults = re.compile(r"(air_step|tissue_step|drift|tilt|bias|begins_loaded|zero_jumps|cyclic)")
    others = {"phantom.ron", "cases.json"}
    wrong = 0
    for path in sorted(p for p in FOLDER.iterdir() if p.is_file() and p.name not in others):
        with tempfile.TemporaryDirectory() as out:
            good, said = (zero_fault(path.stem, path, out) if faults.match(path.name) else of_an_instrument(path, f"{out}/e"))
        wrong += not good
        print(f"{'ok   ' if good else 'WRONG'} {path.name}: {said[:230]}", flush=True)
    print(f"{wrong} not as expected")
    return wrong > 0


if __name__ == "__main__":
    sys.exit(main())
