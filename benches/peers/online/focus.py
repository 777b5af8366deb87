"""FOCuS (Romano, Eckley, Fearnhead, Rigaill 2023, J. Mach. Learn. Res. 24) by its authors' package changepoint-online.

FOCuS is Page's CUSUM for all sizes of the change at once. It looks for a fall of the mean in the residual of the force from its extrapolated
straight line (see entrant.py).

Options: `trend` is the time constant of that line in s, `allowance` what a fall must exceed in noise standard deviations, so that the slow
falls of a line that does not quite fit count for nothing, and `threshold` that of the log-likelihood ratio.
"""

from changepoint_online import Focus, Gaussian

from entrant import OnResidual, serve


class FocusDetector(OnResidual):
    def __init__(self, rate, trend, allowance, threshold):
        self.allowance = allowance
        self.longest = 2000  # samples between new starts, so that the sums do not grow for ever
        super().__init__(rate, trend, threshold)

    def reset(self):
        self.focus, self.seen = Focus(Gaussian(loc=0.0), side="left"), 0

    def update(self, residual):
        self.seen += 1
        focus = self.focus
        focus.update(residual + self.allowance)
        statistic = focus.ql.opt
        if statistic > 2:
            # With a known mean before the change, the package's statistic counts rises too, whatever the side.
            pieces = focus.ql.ps[:-1]
            statistic = max((p.get_max(focus.cs) for p in pieces if p.argmax(focus.cs) < 0), default=0.0)
            if statistic == 0:
                self.reset()
        elif self.seen > self.longest:
            self.reset()
        return statistic


if __name__ == "__main__":
    serve(FocusDetector, trend=0.15, allowance=0.5, threshold=30.0)
