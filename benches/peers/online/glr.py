"""Generalised likelihood ratio for a fall of the force from its straight line.

As in Basseville, Nikiforov, "Detection of Abrupt Changes", 1993, chapter 2: within a moving window, every change time of a set is tried.
Before it the force is a straight line fitted to `reference` seconds; the size of the step after it is unknown. The
statistic is the step over its standard error, the square root of twice the log-likelihood ratio, at its best change time, for falls only.

Options: `window` is the longest time since the change in s, `reference` the length of the fitted line in s, `threshold` that of the
statistic. Samples faster than 1 kHz are averaged to about 1 kHz first. After an event, the window fills again.
"""

from math import sqrt

from entrant import Peak, serve

CANDIDATES = 5  # change times tried per sample


class Glr:
    def __init__(self, rate, window, reference, threshold):
        self.block = max(1, int(rate / 1000))
        rate /= self.block
        longest = max(2, round(window * rate))
        self.reference = max(12, round(reference * rate))
        self.size = longest + self.reference + 1
        ages = sorted({max(1, round(longest ** (i / (CANDIDATES - 1)))) for i in range(CANDIDATES)})
        self.longest = ages[-1]
        r = self.reference
        self.spread = r * (r * r - 1) / 12
        # samples since the change, distance of their middle from the line's middle, precision of the step
        self.ages = [(m, (m + r) / 2, 1 / sqrt(1 / m + 1 / r + ((m + r) / 2) ** 2 / self.spread)) for m in ages]
        self.sum, self.count = 0.0, 0
        self.peak = Peak(rate, threshold)
        self.restart(None)

    def restart(self, offset):
        self.offset, self.n = offset, 0
        # running sums of the force, the force times its number and the force squared, in a ring
        self.forces, self.moments, self.squares = [0.0] * self.size, [0.0] * self.size, [0.0] * self.size

    def sample(self, force):
        if self.block > 1:
            self.sum += force
            self.count += 1
            if self.count < self.block:
                return None
            force = self.sum / self.block
            self.sum, self.count = 0.0, 0
        if self.offset is None:
            self.offset = force
        y = force - self.offset
        forces, moments, squares, size, r = self.forces, self.moments, self.squares, self.size, self.reference
        last = self.n % size
        self.n = n = self.n + 1
        now = n % size
        total = forces[now] = forces[last] + y
        moments[now] = moments[last] + n * y
        squares[now] = squares[last] + y * y
        if n < r + self.longest:
            return None
        best = fall = 0.0
        for m, distance, precision in self.ages:
            end, begin = (n - m) % size, (n - m - r) % size
            mean = (forces[end] - forces[begin]) / r
            step = mean - (total - forces[end]) / m  # fall before the slope is allowed for
            cross = moments[end] - moments[begin] - (n - m - (r - 1) / 2) * mean * r
            slope = cross / self.spread
            step += slope * distance
            if step > 0:
                noise = max((squares[end] - squares[begin] - r * mean * mean - slope * cross) / (r - 2), 1e-8)
                statistic = step * precision / sqrt(noise)
                if statistic > best:
                    best, fall = statistic, step
        peak = self.peak(best)
        if peak is None:
            return None
        self.restart(force)
        return fall or None, peak


if __name__ == "__main__":
    serve(Glr, window=0.015, reference=0.2, threshold=5.0)
