#!/usr/bin/env bash
# All accuracy tests of the diagnosis and of planning, those of some minutes included.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --release --all-features --test promises -- --include-ignored diagnosis_accuracy:: custom_effects::
cargo test --release --all-features -p stylet-diagnose --test promises rough_guess:: -- --include-ignored
cargo test --release --all-features -p stylet-diagnose --test promises recorded_answers:: -- --include-ignored
cargo test --release --all-features -p stylet-plan --test promises planned_insertion:: -- --include-ignored
