#!/usr/bin/env bash
# Makes the Python environment of the entrants of the benchmark of online puncture detection and builds those in Rust, both in the folder
# given (target/peers-online if none is). Safe to run again.
set -euo pipefail
cd "$(dirname "$0")/../../.."
folder=${1:-target/peers-online}
[ -x "$folder/bin/python" ] || "${PYTHON:-python3}" -m venv "$folder"
"$folder/bin/python" -m pip install --quiet --disable-pip-version-check -r benches/peers/online/requirements.txt
cargo build --quiet --release --locked --manifest-path benches/peers/online/rust/Cargo.toml --target-dir "$folder/rust"
echo "entrants ready: $folder/bin/python, $folder/rust/release/stylet-online-peers"
