#!/usr/bin/env bash
# Every crate that is published packs, and builds from its package alone. Minutes: a clean build of everything. With --list,
# only what would be packed (seconds).
set -euo pipefail
cd "$(dirname "$0")/.."
if [ "${1:-}" = --list ]; then
    cargo package --workspace --exclude stylet-python --exclude stylet-capi --no-verify --allow-dirty
else
    cargo package --workspace --exclude stylet-python --exclude stylet-capi "$@"
fi
