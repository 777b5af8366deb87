#!/usr/bin/env bash
# Mutated inputs for a given time (seconds, default 600), with a new seed every round. What makes a parser panic or linger is kept in
# target/mutated and the round's seed is printed: put it into the corpus of tests/mutated_inputs.rs when it is mended.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-600}
rounds=0
seed=${STYLET_MUTATION_SEED:-1000}
cargo test --release --test mutated_inputs --no-run
until [ "$SECONDS" -ge "$seconds" ]; do
    STYLET_MUTATION_SEED=$seed STYLET_MUTATIONS=${STYLET_MUTATIONS:-1000} cargo test --quiet --release --test mutated_inputs >/dev/null ||
        { echo "seed $seed: see target/mutated" >&2; exit 1; }
    rounds=$((rounds + 1))
    seed=$((seed + 1))
done
echo "mutated inputs: $rounds rounds of $((1040 * ${STYLET_MUTATIONS:-1000})) inputs, nothing found"
