#!/usr/bin/env bash
# Tests the Python package: type stubs, pytest, notebooks, in an environment of its own (cached in target/python). Uses the
# profile and the target folder of `cargo test`, so that little is compiled twice; `--release` for speeds worth reading.
# STYLET_BUILD names packages and features for cargo, which should be those of the tests, and STYLET_COMMAND a command that is
# built already (`.ci/run` has both). Ends with 77 where there is no Python
# to test with or its packages cannot be had.
set -euo pipefail
cd "$(dirname "$0")/../.."
target="${CARGO_TARGET_DIR:-$PWD/target}"
venv="$target/python"
no_python() {
    echo "SKIPPED: the Python package is not tested: $1" >&2
    exit 77
}
command -v python3 >/dev/null 2>&1 || no_python "there is no python3"
if [ ! -x "$venv/bin/python" ]; then
    python3 -m venv "$venv" 2>/dev/null || {
        [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1 && apt-get update -qq &&
            DEBIAN_FRONTEND=noninteractive apt-get install -y -qq python3-venv python3-dev >/dev/null
        python3 -m venv "$venv" || no_python "no environment can be made (python3-venv)"
    }
fi
stamp="$venv/requirements.stamp"
if ! cmp -s crates/python/requirements-test.txt "$stamp"; then
    "$venv/bin/pip" install --quiet --disable-pip-version-check -r crates/python/requirements-test.txt ||
        no_python "its test packages cannot be installed"
    cp crates/python/requirements-test.txt "$stamp"
fi
export MPLBACKEND=agg PYTHONPATH="$target/python-module"
profile=debug
read -ra build <<<"${STYLET_BUILD:--p stylet -p stylet-python --features stylet-python/extension-module}"
[ "${1:-}" = --release ] && { profile=release; build+=(--release); shift; }
# Built together with the command, with which the tests compare it, so that both share every dependency; maturin would choose other
# features for them.
if [ -z "${STYLET_COMMAND:-}" ]; then
    cargo build "${build[@]}"
    export STYLET_COMMAND="$target/$profile/stylet"
fi
PYO3_PYTHON="$venv/bin/python" cargo build "${build[@]}" --lib
rm -rf "$target/python-module"
mkdir -p "$target/python-module"
cp -r crates/python/python/stylet "$target/python-module/stylet"
cp "$target/$profile/lib_stylet.so" "$target/python-module/stylet/_stylet.abi3.so"
"$venv/bin/python" -m pytest -q -p no:cacheprovider crates/python/tests "$@"
