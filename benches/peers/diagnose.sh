#!/usr/bin/env bash
# Stylet's diagnosis and sparse regressions on cases of the independent simulator, in one run, on one thread.
#
#   bash benches/peers/diagnose.sh [CASES] [SEED] [WORLD...]
#
# Per world (plain and rich): exports TUNING_CASES (40) cases of the public seed 701 to tune the peers on and CASES (100) cases of SEED
# (702) to score all on, half of them without a wrong assumption and half with wrong thicknesses of the largest severity; two of five hide one effect,
# one two effects, one something that the library lacks, one nothing. Writes what regressions are given, lets Stylet diagnose, tunes the
# peers, lets them answer, and judges every answer by `stylet benchmark score`. What is there already is not made again (remove
# target/peers_cases to start over). Then draws target/peers_cases/diagnosis_peers.svg of the table. Needs `bash benches/peers/setup.sh` once before.
set -euo pipefail
cd "$(dirname "$0")/../.."
cases=${1:-100}
seed=${2:-702}
worlds=("${@:3}")
[ ${#worlds[@]} -gt 0 ] || worlds=(plain rich)
tuning=${TUNING_CASES:-40}
export RAYON_NUM_THREADS=1 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
python=${STYLET_PEERS_PYTHON:-target/peers/bin/python}
"$python" -c 'import pysindy, sklearn, sysidentpy' || { echo "no peers: run bash benches/peers/setup.sh first" >&2; exit 2; }
cargo build --release --quiet
cargo build --release --quiet -p stylet-diagnose --example regression_tables
cargo build --release --quiet -p stylet-examine --example truth
stylet=target/release/stylet

given() { # world, cases, seed -> the challenge, exported and with its terms
    local of=target/peers_cases/$1-$2-$3
    [ -d "$of" ] || "$stylet" benchmark export --world "$1" --wrong nothing,thickness --severity large \
        --hide one,one,two,outside,clean --cases "$((($2 + 1) / 2))" --seed "$3" --out "$of" >&2
    target/release/examples/regression_tables "$of" "$of.terms" >&2
    echo "$of"
}

mkdir -p target/peers_cases
table=target/peers_cases/table.txt
: >"$table"
for world in "${worlds[@]}"; do
    tune=$(given "$world" "$tuning" 701)
    test=$(given "$world" "$cases" "$seed")
    target/release/examples/truth "$tune" >"$tune.truth.json"
    echo "== world $world, $cases cases of seed $seed"
    "$python" benches/peers/diagnose.py "$tune.terms" "$tune.truth.json" "$test.terms" "$test.answers"
    for answers in stylet lassocv frols stlsq sr3; do
        echo "-- $answers"
        "$stylet" benchmark score "$test" "$test.answers/$answers.json" | sed -n '/^all rows together/,/^$/p'
    done | tee -a "$table"
    echo
done
"$python" benches/peers/diagnose_draw.py "$table" target/peers_cases/diagnosis_peers.svg
