"""Hash of the enhanced force: python3 enhanced_hash.py enhanced.csv. The first 32 digits of the SHA-256 of its 64-bit floats, little-endian."""

import csv
import hashlib
import struct
import sys


def enhanced_hash(forces):
    """Hash of a sequence of forces in N."""
    forces = list(forces)
    return hashlib.sha256(struct.pack(f"<{len(forces)}d", *forces)).hexdigest()[:32]


def recorded_samples(path):
    """Samples (time_s, position_m, velocity_mps, force_n) of a recording.csv."""
    with open(path, newline="") as file:
        return [tuple(float(row[name]) for name in ("time_s", "position_m", "velocity_mps", "force_n")) for row in csv.DictReader(file)]


if __name__ == "__main__":
    with open(sys.argv[1], newline="") as file:
        print(enhanced_hash(float(row["enhanced_n"]) for row in csv.DictReader(file)))
