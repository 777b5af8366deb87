#!/usr/bin/env bash
# Stylet's diagnosis and sparse regressions on the same cases with hidden effects, in one run, on one thread.
#
#   bash benches/peers/diagnose.sh [CASES] [SEED]
#
# Draws 80 cases of the public seed 701 to tune the peers on, and CASES (120) cases of SEED (702) to judge all on, lets Stylet
# diagnose them, and prints the table. Goes on where it was interrupted; a case takes about 6 s.
# The picture goes to docs/diagnosis_peers.svg, or to $FIGURE. Needs `bash benches/peers/setup.sh` once before.
set -euo pipefail
cd "$(dirname "$0")/../.."
cases=${1:-120}
seed=${2:-702}
export RAYON_NUM_THREADS=1 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
python=${STYLET_PEERS_PYTHON:-target/peers/bin/python}
"$python" -c 'import pysindy, sklearn, sysidentpy' || { echo "no peers: run bash benches/peers/setup.sh first" >&2; exit 2; }
cargo build --release --quiet -p stylet-diagnose --example peers_cases
draw=target/release/examples/peers_cases
"$draw" target/peers_cases 80 701 >&2
"$draw" target/peers_cases "$cases" "$seed" >&2
"$python" benches/peers/diagnose.py target/peers_cases 80 701 "$cases" "$seed" "${FIGURE:-docs/diagnosis_peers.svg}"
