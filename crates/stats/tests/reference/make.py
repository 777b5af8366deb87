"""Reference numbers for stylet-stats from SciPy (run with SciPy 1.17, NumPy 2.4): python3 make.py > reference.csv

One line per number: function, value, arguments...; `repr` keeps every bit. Nothing here uses code of Stylet."""

import numpy as np
from scipy import stats


def line(name, value, *args):
    print(",".join([name, repr(float(value))] + [repr(float(a)) for a in args]))


for x in [-38.0, -8.3, -3.0, -1.0, -0.1, 0.0, 0.5, 1.96, 5.0, 9.0]:
    line("normal_cdf", stats.norm.cdf(x), x)
    line("normal_sf", stats.norm.sf(x), x)
    line("normal_ln_pdf", stats.norm.logpdf(x), x)
for p in [1e-300, 1e-20, 1e-6, 0.001, 0.02, 0.024, 0.025, 0.1, 0.3, 0.5, 0.77, 0.975, 0.98, 0.9999999]:
    line("normal_quantile", stats.norm.ppf(p), p)
for dof in [0.3, 1, 2, 3, 4, 7.5, 14, 30, 100, 1e4, 1e7]:
    for p in [1e-12, 1e-4, 0.025, 0.2, 0.5, 0.9, 0.975, 0.9995]:
        line("student_quantile", stats.t.ppf(p, dof), p, dof)
    for x in [-50.0, -2.0, 0.3, 1.0, 4.0, 20.0]:
        line("student_sf", stats.t.sf(x, dof), x, dof)
for dof in [0.5, 1, 2, 3, 8, 40, 300, 5000]:
    for f in [0.01, 0.5, 0.9, 1.1, 2.0, 5.0]:
        line("chi_square_sf", stats.chi2.sf(f * dof, dof), f * dof, dof)
for hits, of in [(0, 10), (1, 10), (5, 10), (10, 10), (81, 263), (3, 1000), (1, 1)]:
    for c in [0.5, 0.9, 0.95, 0.99]:
        i = stats.binomtest(hits, of).proportion_ci(c, method="wilson")
        line("wilson_low", i.low, hits, of, c)
        line("wilson_high", i.high, hits, of, c)
data = [3.1, -2.0, 7.7, 0.0, 1e3, -5.5, 3.1, 2.2, 0.4]
for n in [1, 2, 5, 8, 9]:
    for q in [0.0, 0.05, 0.25, 0.5, 0.9, 1.0]:
        line("quantile", np.quantile(data[:n], q), q, *data[:n])
for x, y in [((1, 2, 3, 4, 5, 6), (2, 1, 4, 3, 6, 5)), ((1, 1, 2, 3, 5, 8, 13), (3, 1, 4, 1, 5, 9, 2))]:
    line("spearman", stats.spearmanr(x, y).statistic, *x, *y)
