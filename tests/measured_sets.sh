#!/usr/bin/env bash
# The promises on sets of insertions that take minutes; STYLET_MEASURED names the folder of recordings.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo test --release -p stylet-diagnose --test promises repeated_insertions_are_diagnosed:: -- --include-ignored
cargo test --release --test promises measured_repeats:: -- --include-ignored
