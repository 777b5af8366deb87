#!/usr/bin/env bash
# Mutated inputs for a given time (seconds, default 600), with a new seed every round. What makes a parser panic or linger is kept in
# target/mutated and the round's seed is printed: put it into the corpus of tests/mutated_inputs.rs when it is mended.
# STYLET_MUTATIONS_EACH=10000000 gives every parser of text so many in a round (some hours), with
# STYLET_MUTATED="gates shard" those alone. Ends with the inputs per parser.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-600}
rounds=0
seed=${STYLET_MUTATION_SEED:-1000}
found=$(mktemp)
trap 'rm -f "$found"' EXIT
cargo test --release --test promises --no-run
until [ "$rounds" -gt 0 ] && [ "$SECONDS" -ge "$seconds" ]; do
    STYLET_MUTATION_SEED=$seed STYLET_MUTATIONS=${STYLET_MUTATIONS:-1000} \
        cargo test --quiet --release --test promises mutated_inputs:: -- --nocapture --test-threads 1 >>"$found" ||
        { tail -n 20 "$found"; echo "seed $seed: see target/mutated" >&2; exit 1; }
    rounds=$((rounds + 1))
    seed=$((seed + 1))
done
echo "mutated inputs, $rounds rounds, no panic and none over 5 s:"
grep -oE '[a-z][a-z.-]*: [0-9]+ inputs' "$found" | awk '{ sum[$1] += $2; all += $2 } END { for (name in sum) print "  " name, sum[name]; print "  all:", all }' | sort
