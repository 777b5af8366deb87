"""Recursive high-pass filter with a threshold.

After the descriptions in R. L'Orsa, K. Zareinia, G. R. Sutherland, D. Westwick, K. J. Kuchenbecker, "Comparing Puncture-Detection Approaches
for Manual Needle Insertions Through the Parietal Pleura", IEEE Trans. Med. Robot. Bionics 7(2), 455-468, 2025 (a recursive digital filter
made for puncture detection) and R. L'Orsa et al., "Enhancing needle puncture detection using high-pass filtering and diffuse
reflectance", Front. Robot. AI 12:1429327, 2025 (a high-pass filter before each detector). The coefficients of their filter are theirs: here it is
a Butterworth high-pass of second order, which takes away level and slope of the force, after a low-pass of first order against the noise.

Options: `cutoff` and `smooth` are the corner frequencies of the two in Hz, `threshold` how far the output must fall below zero, in its own standard deviations
of the last second.
"""

import math

from entrant import Peak, serve


class HighPass:
    def __init__(self, rate, cutoff, smooth, threshold):
        tangent = math.tan(math.pi * min(cutoff / rate, 0.2))
        norm = 1 / (1 + math.sqrt(2) * tangent + tangent**2)
        self.b = norm
        self.a1, self.a2 = 2 * (tangent**2 - 1) * norm, (1 - math.sqrt(2) * tangent + tangent**2) * norm
        self.gain = 1 - math.exp(-2 * math.pi * smooth / rate)
        self.longest = max(rate, 50.0)
        self.scale, self.count = 0.0, 0
        self.peak = Peak(rate, threshold)
        self.smoothed = None

    def restart(self, force):
        """The filter as it is after a long time at this force."""
        self.smoothed = self.x1 = self.x2 = force
        self.y1 = self.y2 = 0.0

    def sample(self, force):
        if self.smoothed is None:
            self.restart(force)
        x = self.smoothed = self.smoothed + self.gain * (force - self.smoothed)
        y = self.b * (x - 2 * self.x1 + self.x2) - self.a1 * self.y1 - self.a2 * self.y2
        self.x2, self.x1, self.y2, self.y1 = self.x1, x, self.y1, y
        if self.count < self.longest:
            self.count += 1
        scale = self.scale
        size = abs(y) if self.count <= 20 else min(abs(y), 4 * scale)
        self.scale = scale = max(scale + (size - scale) / self.count, 1e-4)
        peak = self.peak(-y / (1.25 * scale)) if self.count > 20 else None
        if peak is None:
            return None
        self.restart(force)
        return 1.25 * scale * peak, peak


if __name__ == "__main__":
    serve(HighPass, cutoff=2.0, smooth=8.0, threshold=6.0)
