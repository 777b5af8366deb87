"""Scenarios and the command."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]

TWO_GELS = """Scenario(
    name: "two gels",
    tissue: (layers: [
        (thickness_m: 0.01, stiffness_n_per_m: 50.0, friction_ns_per_m2: 9000.0, puncture_n: 0.4),
        (thickness_m: 0.02, stiffness_n_per_m: 90.0, friction_ns_per_m2: 14000.0),
    ]),
    motion: Program(start_m: -0.005, segments: [
        Move(velocity_mps: 0.003, duration_s: 5.0),
        Hold(duration_s: 1.0),
        Ripple(velocity_mps: 0.003, amplitude_mps: 0.001, frequency_hz: 0.5, duration_s: 4.0),
        Move(velocity_mps: -0.004, duration_s: 3.0),
    ]),
    robot: Replay,
    sensor: ForceTorque(noise_n: 0.01, ar1: 0.3),
)"""


@pytest.fixture
def two_gels():
    return TWO_GELS


@pytest.fixture
def scenarios():
    return ROOT / "scenarios"


@pytest.fixture(scope="session")
def command():
    """The `stylet` command that `test.sh` built together with this module."""
    found = os.environ.get("STYLET_COMMAND")
    if not found or not Path(found).exists():
        pytest.skip("SKIPPED: STYLET_COMMAND names no command; crates/python/test.sh builds it")
    return lambda *args, cwd: subprocess.run([found, *map(str, args)], cwd=cwd, check=True, capture_output=True)
