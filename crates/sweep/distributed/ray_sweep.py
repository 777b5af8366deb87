#!/usr/bin/env python3
"""Run a sweep's shards on a Ray cluster, then merge them.

    python crates/sweep/distributed/ray_sweep.py SWEEP.ron --shards 64 --out DIR [--trials N] [--seed S] [--stylet PATH] [--address auto]

Every shard is run by `stylet sweep run-shard I/N`; DIR must be a folder that all nodes can access. A shard is a function of its
inputs and is written to a temporary file, synced and renamed. After an interruption, starting this script again runs the missing
shards; the merged files have the same bytes as those of `stylet sweep` on one machine. Ray retries a task whose worker dies.
"""

import argparse
import os
import subprocess
import sys
import time

import ray


def arguments():
    parser = argparse.ArgumentParser(description="a sweep on a Ray cluster")
    parser.add_argument("sweep")
    parser.add_argument("--shards", type=int, required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--trials", type=int)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--stylet", default="stylet", help="the binary, the same on all nodes")
    parser.add_argument("--address", help="a running cluster, such as `auto`; a local one is started without it")
    parser.add_argument("--cpus", type=int, default=1, help="CPUs and threads per shard")
    return parser.parse_args()


def main():
    args = arguments()
    sweep_arguments = [os.path.abspath(args.sweep)]
    for name in ("trials", "seed"):
        value = getattr(args, name)
        if value is not None:
            sweep_arguments += [f"--{name}", str(value)]
    out, stylet, cpus = os.path.abspath(args.out), args.stylet, args.cpus

    ray.init(address=args.address, include_dashboard=False, log_to_driver=False)

    @ray.remote(num_cpus=cpus, max_retries=20)
    def run_shard(shard):
        command = [stylet, "sweep", "run-shard", shard, *sweep_arguments, "--out", out, "--threads", str(cpus), "--resume"]
        done = subprocess.run(command, capture_output=True, text=True)
        return shard, done.returncode, done.stderr

    begin = time.monotonic()
    waiting = [run_shard.remote(f"{i}/{args.shards}") for i in range(1, args.shards + 1)]
    finished = 0
    while waiting:
        ready, waiting = ray.wait(waiting)
        for shard, code, stderr in ray.get(ready):
            if code != 0:
                sys.exit(f"shard {shard}: exit code {code}:\n{stderr}")
            finished += 1
            print(f"{finished}/{args.shards} shards, {time.monotonic() - begin:.1f} s", flush=True)
    sys.exit(subprocess.run([stylet, "sweep", "merge", *sweep_arguments, "--out", out]).returncode)


if __name__ == "__main__":
    main()
