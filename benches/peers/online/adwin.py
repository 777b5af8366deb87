"""ADWIN (Bifet, Gavalda 2007) of the package river, on the residual of the force from its extrapolated straight line (see entrant.py).

ADWIN keeps a window that it cuts where two of its parts differ in their means. A cut after which the mean is lower is an event. It is asked
after every sample rather than every 32nd. Its confidence is the fall of the mean in its own standard errors.

Options: `trend` is the time constant of that line in s, `delta` ADWIN's significance, and `threshold` the smallest
confidence.
"""

from river.drift import ADWIN

from entrant import OnResidual, serve


class AdwinDetector(OnResidual):
    def __init__(self, rate, trend, delta, threshold):
        self.delta = delta
        super().__init__(rate, trend, threshold)

    def reset(self):
        self.adwin = ADWIN(delta=self.delta, clock=1, min_window_length=2, grace_period=4)

    def update(self, residual):
        residual = max(-20.0, min(20.0, residual))
        before, width = self.adwin.estimation, self.adwin.width
        self.adwin.update(residual)
        if not self.adwin.drift_detected:
            return 0.0
        fall = before - self.adwin.estimation
        return fall * self.adwin.width**0.5 if width else 0.0


if __name__ == "__main__":
    serve(AdwinDetector, trend=0.02, delta=0.0002, threshold=2.0)
