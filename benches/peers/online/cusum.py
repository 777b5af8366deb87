"""CUSUM (Page 1954) for a fall of the mean, on the residual of the force from its extrapolated straight line (see entrant.py).

Options: `trend` is the time constant of that line in s, `allowance` what of each residual counts for nothing, and `threshold`
how large the sum must become, both in noise standard deviations.
"""

from entrant import OnResidual, serve


class Cusum(OnResidual):
    def __init__(self, rate, trend, allowance, threshold):
        self.allowance = allowance
        super().__init__(rate, trend, threshold)

    def reset(self):
        self.total = 0.0

    def update(self, residual):
        self.total = max(0.0, self.total - residual - self.allowance)
        return self.total


if __name__ == "__main__":
    serve(Cusum, trend=0.15, allowance=1.0, threshold=25.0)
