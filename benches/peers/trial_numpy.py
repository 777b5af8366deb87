"""One trial of a sweep in Python and NumPy: the peer of `stylet_sweep::trial::run`.

Three layers, 50 s at 200 Hz. Law, noise and scores are array expressions over all samples; recursive least squares,
CUSUM and the states are a loop over the samples with 2x2 arrays, as the recursion demands; the re-run of a layer is a loop too.
Prints seconds per trial, the median of three.
"""

import time

import numpy as np

FRONT = np.array([0.0, 0.0282, 0.0659])
THICK = np.array([0.0282, 0.0377, 0.0322])
K = np.array([40.0, 60.0, 80.0])
B = np.array([9000.0, 12000.0, 16000.0])
PUNCTURE = np.array([np.inf, 2.2, np.inf])
HZ, SPEED, START, COUNT = 200.0, 0.0023, -0.005, 10_000
PRIOR = np.diag([1e6, 1e6])


def simulate(rng):
    t = np.arange(COUNT) / HZ
    z = START + SPEED * t
    inside = np.clip(z[:, None] - FRONT, 0.0, THICK)
    ends = np.minimum(FRONT + THICK, FRONT + PUNCTURE / K)
    active = np.searchsorted(ends, z, side="right")
    elastic = np.zeros(COUNT)
    for i in range(3):
        here = active == i
        elastic[here] = K[i] * np.maximum(0.0, z[here] - FRONT[i])
    behind = (np.arange(3) < active[:, None]) * inside * B
    friction = SPEED * (inside @ B)
    total = elastic + friction
    return z, total + 0.02 * rng.standard_normal(COUNT), total - behind.sum(axis=1) * SPEED, ends


def update(theta, p, phi, y):
    error = y - phi @ theta
    gain = p @ phi
    scale = 1.0 / (1.0 + phi @ gain)
    return theta + gain * (error * scale), p - np.outer(gain, gain) * scale, error


def rerun(z, f, start, first, end, kappa, cumulative):
    prior = np.diag([1e6, 1e6 * (1.0 - kappa) / (kappa * SPEED**2)])
    theta, p = np.zeros(2), prior.copy()
    for k in range(first, end):
        if (k - first) % 5 == 0:
            p = prior.copy()
        depth = z[k] - start
        theta, p, _ = update(theta, p, np.array([depth, depth * SPEED]), f[k] - cumulative * SPEED)
    return theta


def enhance(z, f):
    drift, limit = (0.15**2 + 0.01**2) / 2, (0.15**2 - 0.01**2) / 2
    theta, p = np.zeros(2), PRIOR.copy()
    start, first, cumulative, cusum, blind_until, due = 0.0, int(-START / SPEED * HZ), 0.0, 0.0, 0.0, None
    enhanced, errors, found = np.empty(COUNT), np.zeros(COUNT), []
    lp, derivative = f[0], 0.0
    for k in range(COUNT):
        step = 0.01 * (f[k] - lp)
        lp += step
        derivative += 0.1 * (step * HZ - derivative)
        depth = z[k] - start
        if depth > 0.0:
            if k % 5 == 0:
                p = PRIOR.copy()
            theta, p, error = update(theta, p, np.array([depth, depth * SPEED]), f[k] - cumulative * SPEED)
            errors[k] = error
            if due is None and z[k] > blind_until and depth > 0.002:
                before, cusum = cusum, max(0.0, cusum + error * error - drift)
                if cusum > limit >= before:
                    window = slice(max(0, k - 80), k)
                    drop = f[window].max() - f[k]
                    kappa = np.clip(drop / (f[window].max() - cumulative * SPEED), 0.01, 0.99)
                    due = (z[k] + 0.005, start, first, k, kappa)
                    found.append(k)
                    start, first, cusum = z[k], k, 0.0
                    theta, p = np.zeros(2), PRIOR.copy()
            if due is not None and z[k] >= due[0]:
                estimate = rerun(z, f, due[1], due[2], due[3], due[4], cumulative)
                cumulative += max(0.0, estimate[1]) * (z[due[3]] - due[1])
                blind_until, due = z[k] + 0.0025, None
        enhanced[k] = f[k] - cumulative * SPEED
    return enhanced, errors, found


def trial(seed):
    z, f, tip, ends = simulate(np.random.default_rng(seed))
    enhanced, errors, found = enhance(z, f)
    inside = z > 0.0
    off = np.sqrt(np.mean((enhanced - tip)[inside] ** 2) / np.mean(tip[inside] ** 2))
    delays = [(z[k] - e) / SPEED for k, e in zip(found, ends)]
    return off, np.sqrt(np.mean(errors[inside] ** 2)), delays


seconds = []
for seed in range(3):
    begin = time.perf_counter()
    off, _, delays = trial(seed)
    seconds.append(time.perf_counter() - begin)
    assert len(delays) == 3 and max(delays) < 0.1 and off < 0.5, (off, delays)
print(sorted(seconds)[1])
