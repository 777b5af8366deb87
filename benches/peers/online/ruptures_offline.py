"""Whole streams at once, not causal: what a detector may hope for that knows the future. By the package ruptures (Truong, Oudre, Vayatis 2020, Signal Processing 167).

    python ruptures_offline.py DIR OUT [--step M] [--penalty P] [--threshold T]

Reads the streams DIR/streams/NNNN.csv (time_s,position_m,force_n) and writes OUT/events.csv (stream,time_s,drop_n,confidence). PELT (Killick,
Fearnhead, Eckley 2012) cuts the force, averaged over about `step` of the needle's way (50 to 500 Hz), into straight lines that need not meet. Where one line begins below the
end of the line before, with the needle advancing at no less than a quarter of the mean speed of the 0.3 s before, that is an event at the
likeliest of the stream's own samples. Its confidence is the drop over the standard deviation of the residuals. `penalty` is that of PELT in
variances of the noise.
"""

import argparse
import csv
import pathlib

import numpy as np
import ruptures


class Line(ruptures.base.BaseCost):
    """Sum of squared residuals of a straight line, from running sums."""

    model = "line"
    min_size = 3

    def fit(self, signal):
        y = signal.ravel() - signal.mean()
        x = np.arange(len(y), dtype=float)
        self.signal = signal
        self.sums = [np.concatenate(([0.0], np.cumsum(v))).tolist() for v in (y, x * y, y * y)]
        return self

    def error(self, start, end):
        y, xy, yy = (s[end] - s[start] for s in self.sums)
        n = end - start
        middle = (start + end - 1) / 2
        cross = xy - middle * y
        return max(yy - y * y / n - cross * cross / (n * (n * n - 1) / 12), 0.0)


def line_end(y, first):
    """The value of the straight line through y at its first or its last sample."""
    x = np.arange(len(y)) - (len(y) - 1) / 2
    slope = (x @ y) / (x @ x) if len(y) > 2 else 0.0
    return y.mean() + slope * (x[0] if first else x[-1])


def noise_of(y):
    """Standard deviation of the noise from second differences over three samples."""
    return max(np.median(np.abs(y[6:] - 2 * y[3:-3] + y[:-6])) / 0.6745 / np.sqrt(6), 1e-4)


def events(time, position, force, step, penalty, threshold):
    seconds = time[-1] - time[0]
    rate = np.clip((position.max() - position.min()) / seconds / step, 50, 500)
    block = max(1, round((len(time) - 1) / seconds / rate))
    count = len(force) // block
    y = force[: count * block].reshape(count, block).mean(axis=1)
    if count < 12:
        return
    noise = noise_of(y)
    cuts = ruptures.Pelt(custom_cost=Line(), min_size=3, jump=1).fit(y).predict(pen=penalty * noise**2)
    edges = [0, *cuts]
    for begin, cut, end in zip(edges, edges[1:], edges[2:]):
        reach = min(cut - begin, end - cut, max(3, round(0.1 * rate)))
        drop = line_end(y[cut - reach : cut], first=False) - line_end(y[cut : cut + reach], first=True)
        at = cut * block
        if block > 1:  # the likeliest sample of the blocks on both sides: where the largest fall is
            low, high = at - block, at + block
            middle = force[low:high].mean()
            at = low + int(np.argmax(np.cumsum(force[low:high] - middle))) + 1
        at = min(at, len(time) - 1)
        now, before = np.searchsorted(time, [time[at] - 0.02, time[at] - 0.3])
        now, before = min(now, at - 1), min(before, at - 1)
        speed = (position[at] - position[now]) / (time[at] - time[now])
        usual = (position[at] - position[before]) / (time[at] - time[before])
        confidence = drop / noise * np.sqrt(min(reach, 10) / 4)
        if drop > 0 and confidence > threshold and speed > max(1e-4, usual / 4):
            yield time[at], drop, confidence


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--step", type=float, default=1e-4)
    parser.add_argument("--penalty", type=float, default=100.0)
    parser.add_argument("--threshold", type=float, default=2.0)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    with open(options.out / "events.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["stream", "time_s", "drop_n", "confidence"])
        for path in sorted((options.folder / "streams").glob("*.csv")):
            time, position, force = np.genfromtxt(path, delimiter=",", skip_header=1, unpack=True)
            good = np.isfinite(force)
            found = events(time[good], position[good], force[good], options.step, options.penalty, options.threshold)
            for at, drop, confidence in found:
                writer.writerow([path.stem, f"{at:.6f}", f"{drop:.4f}", f"{confidence:.3f}"])


if __name__ == "__main__":
    main()
