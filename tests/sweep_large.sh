#!/usr/bin/env bash
# Memory and time of `stylet sweep` on a tenth of N and on N short insertions (default 1e5). Takes about 1.2 kB of disk per trial under TMPDIR and gives it back.
set -euo pipefail
cd "$(dirname "$0")/.."
trials=$(printf '%.0f' "${1:-1e5}")
cargo build --quiet --release
stylet="$(cd "${CARGO_TARGET_DIR:-target}" && pwd)/release/stylet"
there=$(mktemp -d)
trap 'rm -rf "$there"' EXIT
cat >"$there/short.ron" <<'RON'
Scenario(
    name: "thin gel, fast",
    tissue: (layers: [(name: "gel", thickness_m: 0.008, stiffness_n_per_m: 60.0, friction_ns_per_m2: 4000.0)]),
    motion: Constant(start_m: -0.003, velocity_mps: 0.02, duration_s: 0.8),
    sensor: ForceTorque(noise_n: 0.01),
    enhance: (algorithm: Paper),
)
RON
cat >"$there/sweep.ron" <<'RON'
Sweep(
    scenario: "short.ron",
    trials: 1000,
    vary: [
        (path: "sensor.noise_n", with: LogUniform(0.005, 0.1)),
        (path: "tissue.layers[0].stiffness_n_per_m", with: Uniform(20.0, 100.0)),
        (path: "tissue.layers[0].thickness_m", with: Uniform(0.006, 0.01)),
    ],
)
RON
for n in $((trials / 10)) "$trials"; do
    /usr/bin/time -f '%M %e %U %S' -o "$there/time" "$stylet" sweep "$there/sweep.ron" --trials "$n" --out "$there/$n" --quiet \
        --limit-memory 100GB
    awk -v n="$n" '{ printf "%d trials: %.1f MB at most, %.1f s (%.1f s on the processors): %.0f trials/s\n",
        n, $1 * 1024 / 1e6, $2, $3 + $4, n / $2 }' "$there/time"
done
