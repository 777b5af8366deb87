"""Two adjacent windows and their standard deviations.

`--statistic mean` (the entrant difference_over_sd): the fall of the mean from the older window to the newer one, in standard errors
from the standard deviation of the older window.

`--statistic sd` (the entrant difference_of_sd): the standard deviation of the newer window less that of the older one, in N, after the
description in R. L'Orsa, K. Zareinia, G. R. Sutherland, D. Westwick, K. J. Kuchenbecker, "Comparing Puncture-Detection Approaches for Manual
Needle Insertions Through the Parietal Pleura", IEEE Trans. Med. Robot. Bionics 7(2), 455-468, 2025 (an equation that compares
standard deviations between adjacent sliding windows). Only while the force falls, since an upward step raises it too.

Options: `window` and `reference` are the lengths of the newer and the older window in s, `threshold` that of the statistic.
"""

from collections import deque
from math import sqrt

from entrant import Peak, serve


class DifferenceSd:
    def __init__(self, rate, statistic, window, reference, threshold):
        self.of_sd = statistic == "sd"
        self.n = max(3, round(window * rate))
        self.m = max(8, round(reference * rate))
        self.factor = sqrt(1 / (1 / self.n + 1 / self.m))
        self.peak = Peak(rate, threshold)
        self.offset = None
        self.restart()

    def restart(self):
        self.newer, self.older = deque(), deque()
        self.sum_newer = self.sum_older = self.squares_newer = self.squares_older = 0.0

    def sample(self, force):
        if self.offset is None:
            self.offset = force
        force -= self.offset
        n, m, newer, older = self.n, self.m, self.newer, self.older
        newer.append(force)
        self.sum_newer += force
        self.squares_newer += force * force
        if len(newer) <= n:
            return None
        moved = newer.popleft()
        square = moved * moved
        self.sum_newer -= moved
        self.squares_newer -= square
        older.append(moved)
        self.sum_older += moved
        self.squares_older += square
        if len(older) <= m:
            return None
        left = older.popleft()
        self.sum_older -= left
        self.squares_older -= left * left
        mean_newer, mean_older = self.sum_newer / n, self.sum_older / m
        fall = mean_older - mean_newer
        sd_older = sqrt(max(self.squares_older / m - mean_older * mean_older, 1e-8))
        if self.of_sd:
            sd_newer = sqrt(max(self.squares_newer / n - mean_newer * mean_newer, 1e-8))
            statistic = sd_newer - sd_older if newer[-1] < newer[0] else 0.0
        else:
            statistic = fall / sd_older * self.factor
        peak = self.peak(statistic)
        if peak is None:
            return None
        self.restart()
        return (fall if fall > 0 else None), peak


if __name__ == "__main__":
    serve(DifferenceSd, statistic="mean", window=0.02, reference=0.1, threshold=10.0)
