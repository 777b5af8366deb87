#!/usr/bin/env bash
# Tests the Python package: type stubs, pytest, notebooks, in an environment of its own (cached in target/python). Uses the
# profile and the target folder of `cargo test`, so that little is compiled twice; `--release` for speeds worth reading.
set -euo pipefail
cd "$(dirname "$0")/../.."
target="${CARGO_TARGET_DIR:-$PWD/target}"
venv="$target/python"
if [ ! -x "$venv/bin/python" ]; then
    python3 -m venv "$venv" 2>/dev/null || {
        [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1 && apt-get update -qq &&
            DEBIAN_FRONTEND=noninteractive apt-get install -y -qq python3-venv python3-dev >/dev/null
        python3 -m venv "$venv"
    }
fi
stamp="$venv/requirements.stamp"
if ! cmp -s crates/python/requirements-test.txt "$stamp"; then
    "$venv/bin/pip" install --quiet --disable-pip-version-check -r crates/python/requirements-test.txt
    cp crates/python/requirements-test.txt "$stamp"
fi
export MPLBACKEND=agg PYTHONPATH="$target/python-module"
profile=debug
release=()
[ "${1:-}" = --release ] && { profile=release; release=(--release); shift; }
# Built beside the command, so that both share every dependency; maturin would choose other features for them.
PYO3_PYTHON="$venv/bin/python" cargo build "${release[@]}" -p stylet -p stylet-python --lib --features stylet-python/extension-module
rm -rf "$target/python-module"
mkdir -p "$target/python-module"
cp -r crates/python/python/stylet "$target/python-module/stylet"
cp "$target/$profile/lib_stylet.so" "$target/python-module/stylet/_stylet.abi3.so"
"$venv/bin/python" -m pytest -q -p no:cacheprovider crates/python/tests "$@"
