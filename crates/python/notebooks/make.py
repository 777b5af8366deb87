"""Writes the two notebooks: python3 make.py. Cells are kept here, as text that a diff shows."""

import json
from pathlib import Path

HERE = Path(__file__).parent

FIRST = [
    ("md", "# Your first diagnosis\nThe assumed scenario has layers and their friction. The measured insertions contain one more effect. Which?"),
    ("py", "import stylet\n\nassumed = '''Scenario(\n    name: \"two gels\",\n    tissue: (layers: [\n        (thickness_m: 0.01, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.4),\n        (thickness_m: 0.02, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0),\n    ]),\n    motion: Program(start_m: -0.005, segments: [\n        Move(velocity_mps: 0.003, duration_s: 5.0), Hold(duration_s: 1.0),\n        Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 4.0),\n        Move(velocity_mps: -0.004, duration_s: 3.0)]),\n    robot: Replay,\n    sensor: ForceTorque(noise_n: 0.01, ar1: 0.3),\n)'''"),
    ("md", "Three \"measured\" insertions: here they are simulated with dry friction, which `assumed` lacks. Yours are data frames with `time_s`, `position_m`, `force_n`, or CSV files."),
    ("py", "truth = assumed.replace('robot: Replay', 'effects: [CoulombFriction(c_n_per_m: 12.0)], robot: Replay')\nmeasured = [stylet.simulate(truth, seed=s).to_pandas()[['time_s', 'position_m', 'force_n']] for s in (1, 2, 3)]\nmeasured[0].head()"),
    ("py", "found = stylet.diagnose(assumed, measured)\nfound"),
    ("md", "The cause and its parameters with 95 % intervals:"),
    ("py", "found.causes"),
    ("md", "Measured force, prediction of the extended scenario, and residual:"),
    ("py", "found.plot();"),
    ("md", "The extended scenario can be simulated like any other."),
    ("py", "stylet.simulate(found.extended).plot();\nassert found.verdict == 'named'"),
]

LOOP = [
    ("md", "# The online algorithm in your own loop\nOne call per sample of the force sensor: time, tip position, tip velocity, axial force in SI units."),
    ("py", "import numpy as np\nimport stylet\n\nrun = stylet.simulate('''Scenario(\n    name: \"three gels\",\n    tissue: (layers: [\n        (thickness_m: 0.0282, stiffness_n_per_m: 40.0, friction_ns_per_m2: 9000.0),\n        (thickness_m: 0.0377, stiffness_n_per_m: 60.0, friction_ns_per_m2: 12000.0, puncture_n: 2.2),\n    ]),\n    motion: Constant(start_m: -0.005, velocity_mps: 0.0023, duration_s: 32.0),\n    robot: Replay,\n)''')\ndata = run.arrays()"),
    ("py", "core = stylet.Enhancer()\nrendered = []\nfor t, z, v, f in zip(data['time_s'], data['position_m'], data['velocity_mps'], data['force_n']):\n    out = core.step(time_s=t, position_m=z, velocity_mps=v, force_n=f)\n    rendered.append(out.enhanced_n)          # what the haptic device would show\n    if out.ruptured:\n        print(f'{t:.2f} s: a layer ruptured at {1e3 * z:.1f} mm')\n    if out.estimate:\n        layer, thickness_m, stiffness, friction = out.estimate\n        print(f'{t:.2f} s: layer {layer}: {1e3 * thickness_m:.1f} mm, K = {stiffness:.1f} N/m, b = {friction:.0f} N s/m²')"),
    ("md", "The same for arrays:"),
    ("py", "columns = {c: data[c] for c in ('time_s', 'position_m', 'velocity_mps', 'force_n')}\nagain = stylet.Enhancer().run(**columns)\nassert np.array_equal(rendered, again['enhanced_n'])\nstylet.enhance(columns).plot();"),
    ("py", "import time\nstart = time.perf_counter()\nfor _ in range(20):\n    stylet.Enhancer().run(**columns)\nprint(f'{(time.perf_counter() - start) / 20 / len(data[\"time_s\"]) * 1e9:.0f} ns per sample')"),
]


def notebook(cells):
    made = []
    for k, (kind, text) in enumerate(cells):
        cell = {"cell_type": "code" if kind == "py" else "markdown", "id": f"cell-{k}", "metadata": {}, "source": text.splitlines(keepends=True)}
        made.append(cell | ({"execution_count": None, "outputs": []} if kind == "py" else {}))
    return {"cells": made, "metadata": {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}, "language_info": {"name": "python"}}, "nbformat": 4, "nbformat_minor": 5}


for name, cells in [("your_first_diagnosis", FIRST), ("the_core_in_your_own_loop", LOOP)]:
    (HERE / f"{name}.ipynb").write_text(json.dumps(notebook(cells), indent=1, ensure_ascii=False) + "\n")
