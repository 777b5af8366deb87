#!/usr/bin/env bash
# Packs every published crate and builds it from its package alone (minutes: a clean build). With --list, only packs (seconds).
set -euo pipefail
cd "$(dirname "$0")/.."
if [ "${1:-}" = --list ]; then
    cargo package --workspace --exclude stylet-python --exclude stylet-capi --no-verify --allow-dirty
else
    cargo package --workspace --exclude stylet-python --exclude stylet-capi "$@"
fi
