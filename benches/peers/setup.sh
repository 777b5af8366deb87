#!/usr/bin/env bash
# Makes the Python environment with the peers that the benchmarks are compared with.
# The benchmarks look for it in target/peers, or in $STYLET_PEERS_PYTHON.
set -euo pipefail
cd "$(dirname "$0")/../.."
python3 -m venv target/peers
target/peers/bin/python -m pip install --quiet --disable-pip-version-check -r benches/peers/requirements.txt
echo "peers ready: target/peers/bin/python"
