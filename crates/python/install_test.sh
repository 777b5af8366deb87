#!/usr/bin/env bash
# What the README promises to somebody who comes from Python, in an environment of its own: pip install, then its lines; says what both
# took. Minutes: everything is compiled in release. The folder that it builds in is Cargo's, so that a second time is quicker.
set -euo pipefail
cd "$(dirname "$0")/../.."
where=$(mktemp -d)
trap 'rm -rf "$where"' EXIT
python3 -m venv "$where/env"
"$where/env/bin/pip" install --quiet --disable-pip-version-check matplotlib
SECONDS=0
"$where/env/bin/pip" install --quiet --disable-pip-version-check "./crates/python[plot]"
echo "pip install './crates/python[plot]': $SECONDS s"
awk '/^```python$/ { inside = 1; next } /^```$/ { inside = 0 } inside' README.md >"$where/lines.py"
cp -r scenarios "$where"
cd "$where"
begun=$(date +%s.%N)
MPLBACKEND=agg "$where/env/bin/python" lines.py
echo "the README's $(grep -c . lines.py) lines: $(echo "$begun $(date +%s.%N)" | awk '{ printf "%.1f", $2 - $1 }') s"
[ -s insertion.png ] || { echo "insertion.png is missing or empty" >&2; exit 1; }
