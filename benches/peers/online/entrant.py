"""What the Python entrants share: the protocol, a causal residual, and when an event is reported.

A detector is a class made again for every stream as `Detector(rate, **options)`. Its method `sample(force)` returns None or, when it
reports a puncture, (drop in N or None, confidence). `serve(Detector, option=default, ...)` does the rest:

- an event is passed on only while the needle advances, with at least a quarter of its mean speed of the last 0.3 s: what a detector sees in
  holds and retractions, or while the friction goes because the needle stops, is no puncture;
- after a gap in the samples the detector is made again;
- a sample without a force (nan) is left out.
"""

import argparse
import math
import sys


def serve(detector, **defaults):
    """Answers the samples on standard input, one line each."""
    parser = argparse.ArgumentParser(description=sys.modules["__main__"].__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in defaults.items():
        parser.add_argument(f"--{name}", type=type(default), default=default, help=f"default {default}")
    options = vars(parser.parse_args())
    write, flush = sys.stdout.write, sys.stdout.flush
    for line in sys.stdin:
        if line.startswith("start"):
            rate = float(line.split()[1])
            sample = detector(rate, **options).sample
            gain, slow_gain = 1 - math.exp(-1 / (0.01 * rate)), 1 - math.exp(-1 / (0.3 * rate))
            gap = max(5 / rate, 0.02)
            speed, usual, last_time, last_position = 0.0, 0.0, math.inf, 0.0
            continue
        time, position, force = map(float, line.split(","))
        reply = "\n"
        if force == force:
            elapsed = time - last_time
            if elapsed > gap:
                sample = detector(rate, **options).sample
            if elapsed > 0:
                speed += gain * ((position - last_position) / elapsed - speed)
                usual += slow_gain * (speed - usual)
            last_time, last_position = time, position
            event = sample(force)
            if event is not None and speed > max(1e-4, usual / 4):
                drop, confidence = event
                reply = f"1,{'' if drop is None else format(drop, '.4f')},{confidence:.4f}\n"
        write(reply)
        flush()


class Peak:
    """When a statistic has risen above its threshold: reports its largest value once it has not grown for 4 ms, at the latest after 20 ms.

    So the confidence of an event is the statistic's peak rather than the threshold it has just passed, and thresholds above the
    one set can be tried afterwards on the confidences alone.
    """

    def __init__(self, rate, threshold):
        self.threshold = threshold
        self.patience = int(0.004 * rate + 0.5)
        self.longest = int(0.02 * rate + 0.5)
        self.reset()

    def reset(self):
        self.largest, self.age, self.held = self.threshold, 0, 0

    def __call__(self, statistic):
        """The peak, or None as long as there is nothing to report."""
        if statistic > self.largest:
            self.largest, self.age = statistic, 0
        elif self.largest == self.threshold:
            return None
        else:
            self.age += 1
        self.held += 1
        if self.age < self.patience and self.held < self.longest:
            return None
        peak = self.largest
        self.reset()
        return peak


class Residual:
    """The force less its own straight line, extrapolated by one sample, in noise standard deviations.

    Level and slope follow the force with the time constant given (a steady-state Kalman filter of a straight line). A deviation beyond four
    standard deviations does not drag them along; where it lasts longer than the time constant, they start again. The
    noise is the mean absolute residual of the last second.
    """

    def __init__(self, rate, time_constant):
        memory = math.exp(-1 / max(time_constant * rate, 3.0))
        self.gain_level, self.gain_slope = 1 - memory**2, (1 - memory) ** 2
        self.patience = max(time_constant * rate, 3.0)
        self.longest = max(rate, 50.0)
        self.count, self.scale, self.deviation = 0, 0.0, 0.0
        self.restart(None)

    def restart(self, level):
        self.level, self.slope, self.outside = level, 0.0, 0

    def __call__(self, force):
        if self.level is None:
            self.level = force
        predicted = self.level + self.slope
        deviation = self.deviation = force - predicted
        size = abs(deviation)
        if self.count < self.longest:
            self.count += 1
        scale = self.scale
        if self.count > 20:
            size = min(size, 4 * scale)
        self.scale = scale = max(scale + (size - scale) / self.count, 1e-4)
        limit = 5 * scale  # four standard deviations
        if -limit < deviation < limit:
            self.outside = 0
            followed = deviation
        else:
            self.outside += 1
            if self.outside > self.patience or self.count <= 20:
                self.restart(force)
                return 0.0
            followed = math.copysign(limit, deviation)
        self.level = predicted + self.gain_level * followed
        self.slope += self.gain_slope * followed
        return deviation / (1.25 * scale) if self.count > 20 else 0.0


class OnResidual:
    """A detector of changes of the mean at work on the residual of the force.

    A subclass has `reset()` and `update(residual)`, which returns how strongly the residual speaks for a fall of its mean by now. Samples
    faster than 1 kHz are averaged to about 1 kHz first. After an event, residual and detector start again.
    """

    def __init__(self, rate, trend, threshold):
        self.block = max(1, int(rate / 1000))
        self.sum, self.count = 0.0, 0
        self.residual = Residual(rate / self.block, trend)
        self.peak = Peak(rate / self.block, threshold)
        self.reset()

    def sample(self, force):
        if self.block > 1:
            self.sum += force
            self.count += 1
            if self.count < self.block:
                return None
            force = self.sum / self.block
            self.sum, self.count = 0.0, 0
        peak = self.peak(self.update(self.residual(force)))
        if peak is None:
            return None
        drop = -self.residual.deviation
        self.residual.restart(force)
        self.reset()
        return (drop if drop > 0 else None), peak
