#!/usr/bin/env bash
# How long planning takes on an otherwise idle machine: six drawn experiments of one insertion each, with the simulated check and without.
# Needs nothing but the command; three minutes on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --quiet --release
stylet="$(cd "${CARGO_TARGET_DIR:-target}" && pwd)/release/stylet"
there=$(mktemp -d)
trap 'rm -rf "$there"' EXIT
"$stylet" benchmark export --wrong nothing --severity large --hide one --cases 6 --seed "${1:-128}" --out "$there/cases" >/dev/null 2>&1
echo 'Limits(depth_m: 0.09, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 90.0, force_n: 6.0)' >"$there/limits.ron"
TIMEFORMAT=%R
for case in "$there"/cases/cases/*; do
    plan=("$stylet" plan "$case/assumed.ron" --data "$case/1.csv" --limits "$there/limits.ron" --out "$there/plan.ron")
    quick=$({ time "${plan[@]}" --quick >/dev/null 2>&1; } 2>&1)
    whole=$({ time "${plan[@]}" >/dev/null 2>&1; } 2>&1)
    echo "$(basename "$case"): $quick s without the check, $whole s with it"
done
