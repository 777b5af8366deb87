#!/usr/bin/env bash
# All accuracy tests of the diagnosis, those of some minutes included.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --release --all-features --test diagnosis_accuracy -- --include-ignored
