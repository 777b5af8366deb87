#!/usr/bin/env bash
# Memory and time of `stylet enhance` on a log of N samples (default 1e7): peak memory, samples per second, and the cost of reading compared with
# a plain loop over the same columns with the csv crate. Takes about 34 bytes of disk per sample for the log and 300 for the work,
# in a temporary folder under TMPDIR, which is removed. Needs an otherwise idle machine to say anything about time.
set -euo pipefail
cd "$(dirname "$0")/.."
samples=${1:-1e7}
cargo build --quiet --release
cargo build --quiet --release -p stylet-record --examples
built="$(cd "${CARGO_TARGET_DIR:-target}" && pwd)/release"
there=$(mktemp -d)
trap 'rm -rf "$there"' EXIT
"$built/examples/long_log" "$samples" >"$there/log.csv"
"$built/examples/bare_csv" "$there/log.csv" "$there"
/usr/bin/time -v "$built/stylet" enhance "$there/log.csv" --out "$there/out" --quiet 2>"$there/time"
awk -v n="$samples" -F': ' '
    /Maximum resident/ { printf "stylet enhance: %.1f MB at most", $2 * 1024 / 1e6 }
    /Elapsed/ { k = split($2, part, ":"); for (i = 1; i <= k; i++) s = s * 60 + part[i] }
    /User time|System time/ { cpu += $2 }
    END { printf ", %.0f s (%.0f s on the processor): %.2f million samples/s\n", s, cpu, n / s / 1e6 }' \
    <(sed 's/Elapsed (wall clock) time (h:mm:ss or m:ss)/Elapsed/' "$there/time")
