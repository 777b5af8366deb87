#!/usr/bin/env bash
# Stylet's diagnosis and sparse regressions on the same cases with hidden effects, in one run, on one thread.
#
#   bash benches/peers/diagnose.sh [CASES] [SEED]
#
# Draws 40 cases of the public seed 701 to tune the peers on, and CASES (80) cases of SEED (702) to judge all on, lets Stylet
# diagnose them, and prints the table. Drawing goes on where it was interrupted. TUNING_CASES changes the 40.
# The picture goes to docs/diagnosis_peers.svg, or to $FIGURE. Needs `bash benches/peers/setup.sh` once before.
set -euo pipefail
cd "$(dirname "$0")/../.."
cases=${1:-80}
seed=${2:-702}
tuning=${TUNING_CASES:-40}
export RAYON_NUM_THREADS=1 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
python=${STYLET_PEERS_PYTHON:-target/peers/bin/python}
"$python" -c 'import pysindy, sklearn, sysidentpy' || { echo "no peers: run bash benches/peers/setup.sh first" >&2; exit 2; }
cargo build --release --quiet -p stylet-diagnose --features own_world --example peers_cases
draw=target/release/examples/peers_cases
"$draw" target/peers_cases "$tuning" 701 >&2
"$draw" target/peers_cases "$cases" "$seed" >&2
"$python" benches/peers/diagnose.py target/peers_cases "$tuning" 701 "$cases" "$seed" "${FIGURE:-docs/diagnosis_peers.svg}"
