#!/usr/bin/env bash
# Builds the Python package into an environment of its own (cached in target/python), checks the type stubs, runs pytest and
# the notebooks. Uses the profile and the target folder of `cargo test`, so that nothing is compiled twice: `--release` for
# speeds worth reading.
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
export VIRTUAL_ENV="$venv" PATH="$venv/bin:$PATH" MPLBACKEND=agg
profile=(--profile dev)
[ "${1:-}" = --release ] && { profile=(--release); shift; }
(cd crates/python && CARGO_TARGET_DIR="$target" maturin develop --quiet --skip-install "${profile[@]}") || exit 1
python -m pytest -q crates/python/tests "$@"
