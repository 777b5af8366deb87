"""Page-Hinkley test of the package river, downwards, on the residual of the force from its extrapolated straight line (see entrant.py).

River says only that its threshold has been passed. The confidence of an event is the test's own sum: how far it has fallen below its
maximum.

Options: `trend` is the time constant of that line in s, `delta` what of each residual counts for nothing, and `threshold`
how large the sum must become, both in noise standard deviations.
"""

from river.drift import PageHinkley

from entrant import OnResidual, serve


class PageHinkleyDetector(OnResidual):
    def __init__(self, rate, trend, delta, threshold):
        self.delta = delta
        super().__init__(rate, trend, threshold)

    def reset(self):
        self.test = PageHinkley(min_instances=1, delta=self.delta, threshold=float("inf"), mode="down")

    def update(self, residual):
        self.test.update(residual)
        return self.test._max_decrease - self.test._sum_decrease


if __name__ == "__main__":
    serve(PageHinkleyDetector, trend=0.06, delta=2.0, threshold=15.0)
