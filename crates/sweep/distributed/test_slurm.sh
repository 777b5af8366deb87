#!/usr/bin/env bash
# A real one-node Slurm (Debian's slurm-wlm and munge; needs root): the array and its merge give the bytes of the sequential
# run, also when a task is killed with -9 and the array is submitted again. Not part of the default CI.
set -euo pipefail
cd "$(dirname "$0")/../../.."
command -v slurmctld >/dev/null || { apt-get update -qq; DEBIAN_FRONTEND=noninteractive apt-get install -y -qq slurm-wlm munge; }
[ -x target/release/stylet ] || cargo build --release --bin stylet
scratch=$(mktemp -d)
chmod 755 "$scratch"
host=$(hostname -s)
export SLURM_CONF="$scratch/slurm.conf"
mkdir -p "$scratch"/{state,spool,log}
cat >"$SLURM_CONF" <<CONF
ClusterName=stylet
SlurmctldHost=$host
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
StateSaveLocation=$scratch/state
SlurmdSpoolDir=$scratch/spool
SlurmctldPidFile=$scratch/slurmctld.pid
SlurmdPidFile=$scratch/slurmd.pid
SlurmctldLogFile=$scratch/log/slurmctld.log
SlurmdLogFile=$scratch/log/slurmd.log
NodeName=$host CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
[ -f /etc/munge/munge.key ] || /usr/sbin/mungekey -c
started_munge=
if ! munge -n >/dev/null 2>&1; then
    mkdir -p /run/munge && chown munge: /run/munge /etc/munge/munge.key
    runuser -u munge -- /usr/sbin/munged
    started_munge=$(cat /run/munge/munged.pid)
fi
slurmctld
slurmd
finish() {
    for pid in "$scratch/slurmd.pid" "$scratch/slurmctld.pid"; do [ -f "$pid" ] && kill "$(cat "$pid")" || true; done
    [ -z "$started_munge" ] || kill "$started_munge" || true
    sleep 1
    rm -rf "$scratch"
}
trap finish EXIT
for _ in $(seq 60); do sinfo -h -o %T 2>/dev/null | grep -q idle && break; sleep 0.5; done
sinfo

export STYLET="$PWD/target/release/stylet" SWEEP="$PWD/scenarios/sweeps/noise.ron" OUT="$scratch/slurm" SHARDS=6 TRIALS=6000
"$STYLET" sweep "$SWEEP" --trials "$TRIALS" --out "$scratch/sequential" --threads 1 --quiet
cd "$scratch"
sbatch_dir=$OLDPWD
merge=$(bash "$sbatch_dir/crates/sweep/distributed/sweep.sbatch" submit | tail -1)
# Kill a running shard: its task fails, so the merge does not start.
for _ in $(seq 200); do
    step=$(pgrep -f "$STYLET sweep run-shard .*$scratch/slurm" | head -1 || true)
    [ -n "$step" ] && break
    sleep 0.05
done
[ -n "$step" ] && kill -9 "$step" && echo "killed a shard in flight"
for _ in $(seq 240); do squeue -h -t R,PD -o '%i %r' | grep -qv DependencyNeverSatisfied || break; sleep 0.5; done
scancel "$merge" || true
[ ! -f "$OUT/trials.csv" ] || { echo "the merge ran without the killed shard" >&2; exit 1; }
echo "$(find "$OUT/shards" -name '*.shard' | wc -l) of $SHARDS shards are there; submitting again"
bash "$sbatch_dir/crates/sweep/distributed/sweep.sbatch" submit >/dev/null
for _ in $(seq 240); do [ -f "$OUT/trials.csv" ] && [ ! -d "$OUT/shards" ] && break; sleep 0.5; done
for file in trials.csv summary.json report.html sweep.ron scenario.ron; do cmp "$scratch/sequential/$file" "$OUT/$file"; done
echo "slurm: the same bytes as the sequential run, after a task was killed"
