#!/usr/bin/env bash
# A sweep killed with -9 at twenty times and resumed ends with the bytes of one that ran through.
set -euo pipefail
cd "$(dirname "$0")/.."
STYLET_KILLS=20 cargo test --release --test promises a_sweep_killed -- --nocapture
