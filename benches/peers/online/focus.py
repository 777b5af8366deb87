"""FOCuS (Romano, Eckley, Fearnhead, Rigaill 2023, J. Mach. Learn. Res. 24) by its authors' package changepoint-online.

FOCuS is Page's CUSUM for all sizes of the change at once. It looks for a fall of the mean from zero in the residual of the force from its
extrapolated straight line (see entrant.py).

Options: `trend` is the time constant of that line in s, `threshold` that of the log-likelihood ratio.
"""

from changepoint_online import Focus, Gaussian

from entrant import OnResidual, serve


class FocusDetector(OnResidual):
    def __init__(self, rate, trend, threshold):
        self.longest = 2000  # samples, so that the package's sums do not grow for ever
        super().__init__(rate, trend, threshold)

    def reset(self):
        self.focus, self.seen = Focus(Gaussian(loc=0.0), side="left"), 0

    def update(self, residual):
        self.seen += 1
        self.focus.update(residual)
        statistic = self.focus.ql.opt
        if self.seen > self.longest and statistic < 1:
            self.reset()
        return statistic


if __name__ == "__main__":
    serve(FocusDetector, trend=0.1, threshold=15.0)
