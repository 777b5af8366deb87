"""RLS of padasip (Python, NumPy) over the samples of a CSV file: the peer of the online core.

Columns: depth in the layer (m), velocity (m/s), force (N). Prints seconds per sample, the median of
five passes. Only the recursive least squares is run: no detection, no compensation.
"""

import sys
import time

import numpy as np
import padasip as pa

data = np.loadtxt(sys.argv[1], delimiter=",")
phi = np.column_stack([data[:, 0], data[:, 0] * data[:, 1]])
force = data[:, 2]
passes = []
for _ in range(5):
    rls = pa.filters.FilterRLS(n=2, mu=1.0, eps=1e-6, w="zeros")
    start = time.perf_counter()
    for x, y in zip(phi, force):
        rls.adapt(y, x)
    passes.append((time.perf_counter() - start) / len(force))
print(sorted(passes)[2])
