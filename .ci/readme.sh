#!/usr/bin/env bash
# Runs the commands in the README: every line of a ```sh block that begins with `stylet` (or `cargo run --release --`), with the given
# binary (default: the one that `cargo test` built), in a temporary folder. Files that a reader would bring (log.csv, assumed.ron,
# a.csv ...) are created first. Lines that are not run are printed with the reason.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
stylet=$(realpath "${1:-${CARGO_TARGET_DIR:-$root/target}/debug/stylet}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
ln -s "$root/scenarios" "$work/scenarios"
cd "$work"

cat >assumed.ron <<'RON'
Scenario(
    name: "one gel",
    tissue: (layers: [(thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0)]),
    motion: Program(start_m: -0.004, segments: [Move(velocity_mps: 0.004, duration_s: 4.0), Move(velocity_mps: -0.004, duration_s: 3.0)]),
    robot: Replay,
)
RON
for name in a b c d; do
    "$stylet" run assumed.ron --seed "$((1 + ${#name} * $(printf '%d' "'$name")))" --out "made-$name" --quiet
    cp "made-$name/recording.csv" "$name.csv"
done
printf 'Columns(time: (name: "time", scale: 1e-6), position: (name: "pz", scale: 1e-3), force: (name: "fz"))\n' >map.ron
awk -F, 'NR == 1 { print "time,pz,fz"; next } { printf "%.0f,%.9f,%.9f\n", $1 * 1e6, $2 * 1e3, $3 }' a.csv >log.csv
head -500 a.csv >samples.csv
printf 'Limits(depth_m: 0.022, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 60.0, force_n: 6.0)\n' >limits.ron

why_not() {
    case "$1" in
    "stylet reproduce"*) echo "minutes; tests/reproduced_claims.rs runs it" ;;
    "stylet diagnose scenarios/measured/"*) echo "needs measured data that is not part of the repository" ;;
    "stylet benchmark"* | "stylet sweep scenarios"*) echo "minutes; has tests of its own" ;;
    "stylet run scenarios/"*"virtual.ron") echo "a minute without optimisation; tests run it" ;;
    "stylet listen --udp"*) echo "waits for samples; tests/listen.rs runs it" ;;
    esac
}

ran=0
while IFS= read -r line; do
    case "$line" in
    "cargo run --release -- "*) line="stylet ${line#cargo run --release -- }" ;;
    "stylet "* | *"| stylet "*) ;;
    *) continue ;;
    esac
    reason=$(why_not "$line")
    if [ -n "$reason" ]; then
        echo "readme: not run: $line ($reason)"
        continue
    fi
    echo "readme: $line"
    PATH="$work/bin:$PATH"
    mkdir -p bin && ln -sf "$stylet" bin/stylet
    bash -euo pipefail -c "$line" >output.txt 2>&1 || {
        cat output.txt
        echo "readme: FAILED: $line" >&2
        exit 1
    }
    ran=$((ran + 1))
done < <(awk '/^```sh/ { on = 1; next } /^```/ { on = 0 } on' "$root/README.md" | sed 's/ *#.*//')
[ "$ran" -ge 3 ] || { echo "readme: only $ran commands found" >&2; exit 1; }
echo "readme: $ran commands ran"
