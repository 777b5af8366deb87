#!/usr/bin/env bash
# A real local Ray: a worker and then the driver are killed with -9 in the middle, the driver is started again, and the
# results are compared byte by byte with the sequential run. Makes its Python environment in target/ray.
set -euo pipefail
cd "$(dirname "$0")/../../.."
[ -x target/ray/bin/python ] || python3 -m venv target/ray
target/ray/bin/python -c "import ray" 2>/dev/null ||
    target/ray/bin/pip install --quiet --disable-pip-version-check -r crates/sweep/distributed/requirements.txt
[ -x target/release/stylet ] || cargo build --release --bin stylet
export RAY_AUTH_MODE=disabled RAY_USAGE_STATS_ENABLED=0
stylet="$PWD/target/release/stylet"
sweep=scenarios/sweeps/noise.ron
trials="${TRIALS:-12000}"
scratch=$(mktemp -d)
ray=target/ray/bin/ray
trap '"$ray" stop --force >/dev/null 2>&1 || true; rm -rf "$scratch"' EXIT

"$stylet" sweep "$sweep" --trials "$trials" --out "$scratch/sequential" --threads 1 --quiet

"$ray" start --head --port=6399 --num-cpus=2 --include-dashboard=false --disable-usage-stats >/dev/null
driver() {
    exec target/ray/bin/python crates/sweep/distributed/ray_sweep.py "$sweep" --trials "$trials" --shards 24 --out "$scratch/ray" \
        --stylet "$stylet" --address 127.0.0.1:6399
}
finished() { find "$scratch/ray/shards" -name '*.shard' 2>/dev/null | wc -l; }

(driver) >"$scratch/driver.log" 2>&1 &
pid=$!
for _ in $(seq 600); do [ "$(finished)" -ge 2 ] && break; sleep 0.1; done
# The Python process that runs a shard, and the shard itself: children of this cluster's raylet only.
raylet=$(pgrep -f "raylet.*6399" | head -1)
worker=$(pgrep -P "$raylet" -f 'ray::run_shard' | head -1 || true)
[ -n "$worker" ] || { echo "no worker was running a shard" >&2; exit 1; }
pkill -9 -P "$worker" || true
kill -9 "$worker"
echo "killed a worker with $(finished) of 24 shards finished"
for _ in $(seq 600); do [ "$(finished)" -ge 6 ] && break; sleep 0.1; done
kill -9 "$pid"
wait "$pid" 2>/dev/null || true
at=$(finished)
echo "killed the driver with $at of 24 shards finished"
[ "$at" -lt 24 ] || { echo "the driver was through before it could be killed" >&2; exit 1; }
(driver) >"$scratch/driver2.log" 2>&1 || { cat "$scratch/driver2.log" >&2; exit 1; }
for file in trials.csv summary.json report.html sweep.ron scenario.ron; do
    cmp "$scratch/sequential/$file" "$scratch/ray/$file"
done
echo "ray: the same bytes as the sequential run, after a worker and the driver were killed"
