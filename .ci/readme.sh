#!/usr/bin/env bash
# Runs the commands in the README: every line of a ```sh block that begins with `stylet` (or `cargo run --release --`), with the given
# binary (default: the one that `cargo test` built), in a temporary folder. The scenarios that the reader
# saves (assumed.ron, real.ron) are taken from the README first. Lines that are not run are printed with the reason.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
stylet=$(realpath "${1:-${CARGO_TARGET_DIR:-$root/target}/debug/stylet}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
ln -s "$root/scenarios" "$work/scenarios"
cd "$work"

# The README's own phantom, and the same with the effect that the README hides in it.
awk '/^```ron/ { on = 1; next } /^```/ { if (on) exit } on' "$root/README.md" >assumed.ron
sed 's/^    motion:/    effects: [CoulombFriction(c_n_per_m: 3.0)],\n&/' assumed.ron >real.ron
grep -q CoulombFriction real.ron || { echo "readme: the README's first RON block is no scenario" >&2; exit 1; }

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
