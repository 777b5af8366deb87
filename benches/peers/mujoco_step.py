"""Time of MuJoCo's mj_step on the arm of benches/arm.rs, for comparison with ours.

    python mujoco_step.py MODEL.xml Q1,...,Q7 STEPS ROUNDS

Steps the model under constant torques that hold its weight at the given joint angles, in MuJoCo's own loop (no Python between
steps), from the same state in every round. Prints microseconds per step, one round per line. Needs the package `mujoco`.
"""

import sys
import time

import mujoco

model = mujoco.MjModel.from_xml_path(sys.argv[1])
start = [float(q) for q in sys.argv[2].split(",")]
steps, rounds = int(sys.argv[3]), int(sys.argv[4])

data = mujoco.MjData(model)
data.qpos[:] = start
mujoco.mj_forward(model, data)
weight = data.qfrc_bias.copy()
for _ in range(rounds):
    mujoco.mj_resetData(model, data)
    data.qpos[:] = start
    data.qfrc_applied[:] = weight
    begin = time.perf_counter()
    mujoco.mj_step(model, data, nstep=steps)
    print(f"{(time.perf_counter() - begin) / steps * 1e6:.3f}")
    assert abs(data.qpos - start).max() < 0.1, "the arm must not have fallen"
