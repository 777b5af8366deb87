#!/usr/bin/env bash
# How much of a crate its own tests hold fast: mutates it line by line and counts the mutants that they notice.
#     tests/mutants.sh CRATE [SHARD] [-- OPTION...]      e.g.  tests/mutants.sh stats;  tests/mutants.sh tissue 2/5;  tests/mutants.sh core 0/7 -- --file rls.rs
# CRATE is a folder of crates/ or a package; SHARD k/n takes every n-th mutant from the k-th on (n odd: operators come in pairs); what follows
# `--` goes to `cargo mutants` (all features are on unless it names some). Prints tried, killed (a timeout is noticed, too), survived, unviable (do not compile), the share killed
# with its Wilson 95 % interval, and the survivors. Nothing is left out: a mutant that changes no behaviour counts as a survivor.
# Everything is written to target/mutants. Needs cargo-mutants (cargo install --locked cargo-mutants); seconds per mutant, minutes to hours in all.
set -euo pipefail
cd "$(dirname "$0")/.."
case "${1:---help}" in -h | --help) sed -n '2,/^set -/{/^set -/d;s/^# \{0,1\}//;p}' "$0"; exit ;; esac
package=stylet-${1#stylet-}
shift
[ -f "crates/${package#stylet-}/Cargo.toml" ] || { echo "no crate $package in crates/" >&2; exit 2; }
shard=()
whole="all mutants"
if [ $# -gt 0 ] && [ "$1" != -- ]; then
    [[ $1 =~ ^[0-9]+/[0-9]+$ ]] || { echo "a shard is k/n, such as 0/5, not '$1'" >&2; exit 2; }
    shard=(--shard "$1" --sharding round-robin)
    whole="shard $1"
    shift
fi
[ "${1:-}" != -- ] || shift
# Every feature, so that no module stands aside; other ones may be asked for. As an extension, Python's crate links no tests.
features=(--all-features)
[ "$package" != stylet-python ] || features=()
for option in "$@"; do
    case $option in --all-features | --features | --features=* | --no-default-features) features=() ;; esac
done
cargo mutants --version >/dev/null 2>&1 || { echo "needs cargo-mutants: cargo install --locked cargo-mutants" >&2; exit 1; }

# Built a thousand times and run once each: neither line numbers nor more optimisation than the tests' own work needs.
export CARGO_PROFILE_DEV_DEBUG=0 CARGO_PROFILE_DEV_OPT_LEVEL=${STYLET_MUTANTS_OPT_LEVEL:-1} CARGO_INCREMENTAL=1
built=${CARGO_TARGET_DIR:-target}
mkdir -p "$built/mutants/$package"
there=$(cd "$built/mutants/$package" && pwd)
export CARGO_TARGET_DIR=$there/target
rm -rf "$there/mutants.out" "$there/mutants.out.old"
started=$SECONDS
# 0: all noticed; 2: some survived; 3: some timed out. Anything else did not run.
cargo mutants --package "$package" --test-package "$package" "${features[@]}" --jobs 1 --minimum-test-timeout 60 --timeout-multiplier 5 \
    --no-shuffle --colors never --output "$there" "${shard[@]}" "$@" >"$there/log" 2>&1 ||
    case $? in 2 | 3) ;; *) tail -n 20 "$there/log" >&2; exit 1 ;; esac
took=$((SECONDS - started))

count() { wc -l <"$there/mutants.out/$1.txt"; }
awk -v package="$package" -v whole="$whole" -v caught="$(count caught)" -v timeout="$(count timeout)" -v missed="$(count missed)" \
    -v unviable="$(count unviable)" -v took="$took" 'BEGIN {
    killed = caught + timeout; n = killed + missed; tried = n + unviable
    printf "%s, %s: tried %d, killed %d (%d by timeout), survived %d, unviable %d", package, whole, tried, killed, timeout, missed, unviable
    if (n) {
        p = killed / n; z2 = 1.959963984540054 ^ 2
        middle = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = sqrt(z2 * (p * (1 - p) / n + z2 / (4 * n * n))) / (1 + z2 / n)
        printf "; %.1f %% killed (95 %% interval %.1f to %.1f %%)", 100 * p, 100 * (middle - half), 100 * (middle + half)
    }
    printf "; %d s, %.1f s each\n", took, tried ? took / tried : 0
}'
sed 's/^/  survived: /' "$there/mutants.out/missed.txt"
