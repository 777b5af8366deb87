#!/usr/bin/env bash
# All accuracy tests of the diagnosis and of planning, those of some minutes included.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --release --all-features --test diagnosis_accuracy --test custom_effects -- --include-ignored
cargo test --release --all-features -p stylet-diagnose --test rough_guess -- --include-ignored
cargo test --release --all-features -p stylet-plan --test planned_insertion -- --include-ignored
