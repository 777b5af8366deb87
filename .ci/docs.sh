#!/usr/bin/env bash
# Checks the documentation with the given binary (default: the one that `cargo test` built): see docs_check.py. At most four minutes.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
exec python3 "$root/.ci/docs_check.py" "$(realpath "${1:-${CARGO_TARGET_DIR:-$root/target}/debug/stylet}")"
