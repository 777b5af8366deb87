"""Hash of the enhanced force through the Python package: python python_hash.py SCENARIO."""

import sys

import stylet
from enhanced_hash import enhanced_hash

run = stylet.simulate(sys.argv[1])
recording = {name: column for name, column in run.arrays().items() if name in ("time_s", "position_m", "velocity_mps", "force_n")}
print(enhanced_hash(stylet.enhance(recording).arrays()["enhanced_n"]))
