#!/usr/bin/env bash
# Faults of a disk at every call of run, sweep, enhance, diagnose and reproduce, and a hundred kills at any instant (about a quarter of an hour).
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --release --test promises disk_faults:: -- --include-ignored --nocapture --test-threads 1
