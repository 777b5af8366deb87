"""The laws of the independent simulator against SciPy: the equations of the page (base law, relaxation, Dahl friction, a puncture that depends on
speed, a compliant needle), integrated by `solve_ivp` with its own event finding.

    cargo run --release -p stylet-examine --example trace > trace.json
    python3 benches/peers/referee_scipy.py trace.json

Prints the largest difference of the force over the largest force and of the instants of ruptures, and fails above 1e-3.
Samples within 1 ms of a jump (a rupture, a change of speed) are left out.
"""

import json
import sys

import numpy as np
from scipy.integrate import solve_ivp

BAND, V0 = 1e-5, 1e-3


class Reality:
    def __init__(self, data, numbers):
        self.layers = data["layers"]
        self.fronts = data["surface_m"] + np.concatenate([[0.0], np.cumsum([l[0] for l in self.layers])])
        self.numbers = numbers
        self.pieces, self.start = data["pieces"], data["start_m"]

    def base(self, piece, since, begin):
        speed, ripple, hz, _ = self.pieces[piece]
        if ripple == 0.0:
            return begin + speed * since, speed
        w = 2 * np.pi * hz
        return begin + speed * since + ripple / w * (1 - np.cos(w * since)), speed + ripple * np.sin(w * since)

    def friction(self, z):
        inside = [min(max(z - s, 0.0), l[0]) for s, l in zip(self.fronts, self.layers)]
        return sum(l[2] * x for l, x in zip(self.layers, inside)), sum(inside)

    def elastic(self, z, ruptured):
        if ruptured >= len(self.layers):
            return 0.0
        return self.layers[ruptured][1] * max(z - self.fronts[ruptured], 0.0)

    def spring(self):
        return self.numbers.get("stiffness_n_per_m")

    def tip(self, t, y, piece, t0, begin, ruptured):
        """Position and speed of the tip; of a compliant needle the position is a state and the balance of force gives the speed."""
        z, v = self.base(piece, t - t0, begin)
        if self.spring() is None:
            return z, v
        pull = self.spring() * (z - y[3])
        viscous, _ = self.friction(y[3])
        if viscous < 1e-9:
            return y[3], v
        return y[3], (pull - self.elastic(y[3], ruptured)) / viscous

    def rates(self, t, y, piece, t0, begin, ruptured):
        z, v = self.tip(t, y, piece, t0, begin, ruptured)
        e = self.elastic(z, ruptured)
        out = [0.0, 0.0, 0.0, 0.0]
        for j in (0, 1):
            if f"terms.{j}.fraction" in self.numbers:
                g, tau = self.numbers[f"terms.{j}.fraction"], self.numbers[f"terms.{j}.time_constant_s"]
                out[j] = (g * e - y[j]) / tau
        if "delta_m" in self.numbers and self.friction(z)[1] > 0.0:
            s = np.sign(v) if abs(v) > BAND else 0.0
            out[2] = v / self.numbers["delta_m"] * (1 - y[2] * s)
        if self.spring() is not None:
            out[3] = v
        return out

    def force(self, t, y, piece, t0, begin, ruptured):
        if self.spring() is not None:
            return self.spring() * (self.base(piece, t - t0, begin)[0] - y[3])
        z, v = self.base(piece, t - t0, begin)
        viscous, inside = self.friction(z)
        dry = self.numbers.get("c_n_per_m", 0.0) * y[2] * inside
        return self.elastic(z, ruptured) - y[0] - y[1] + viscous * v + dry

    def near(self, t, y, piece, t0, begin, ruptured):
        """Rises through zero at the rupture of the active layer."""
        if ruptured >= len(self.layers):
            return -1.0
        z, v = self.tip(t, y, piece, t0, begin, ruptured)
        thick, _, _, puncture = self.layers[ruptured]
        far = (z - self.fronts[ruptured] - thick) / thick
        if puncture is None:
            return far
        alpha = self.numbers.get("alpha", 0.0)
        limit = puncture * max(0.1, 1 + alpha * np.log(max(abs(v), 0.1 * V0) / V0))
        return max(far, (self.elastic(z, ruptured) - y[0] - y[1]) / limit - 1.0)


def run(data, numbers):
    it = Reality(data, numbers)
    wanted = np.array(data["time_s"])
    force = np.full(len(wanted), np.nan)
    ruptures, jumps = [], []
    t, begin, y, ruptured = 0.0, it.start, np.array([0.0, 0.0, 0.0, it.start]), 0
    for piece, (_, _, _, duration) in enumerate(it.pieces):
        t0, end = t, t + duration
        while t < end:
            args = (piece, t0, begin, ruptured)
            if it.near(t, y, *args) >= 0.0:  # a change of speed brings the layer beyond its limit at once
                ruptures.append(t)
                jumps.append(t)
                ruptured += 1
                y[:2] = 0.0
                continue

            def event(s, y, *a):
                return it.near(s, y, *a)

            event.terminal, event.direction = True, 1.0
            stiff = it.spring() is not None
            found = solve_ivp(
                it.rates, (t, end), y, method="Radau" if stiff else "DOP853", args=args, events=event,
                rtol=1e-9, atol=1e-11, max_step=0.01, dense_output=True,
            )
            stop = found.t[-1]
            here = np.flatnonzero((wanted >= t) & (wanted <= stop))
            for k in here:
                force[k] = it.force(wanted[k], found.sol(wanted[k]), *args)
            t, y = stop, found.y[:, -1].copy()
            if found.status == 1:
                ruptures.append(t)
                jumps.append(t)
                ruptured += 1
                y[:2] = 0.0
        begin = it.base(piece, duration, begin)[0]
        jumps.append(end)
        t = end
    keep = np.all(np.abs(wanted[:, None] - np.array(jumps)[None, :]) > 1e-3, axis=1) & np.isfinite(force)
    return force, np.array(ruptures), keep


def main():
    data = json.load(open(sys.argv[1]))
    worst = 0.0
    for r in data["runs"]:
        force, ruptures, keep = run(data, r["numbers"])
        theirs = np.array(r["force_n"])
        if len(ruptures) != len(r["ruptures_s"]):
            sys.exit(f"{r['name']}: ruptures {ruptures} here, {r['ruptures_s']} there")
        off = np.max(np.abs(force - theirs)[keep]) / np.max(np.abs(theirs))
        late = np.max(np.abs(ruptures - np.array(r["ruptures_s"])))
        print(f"{r['name']:<26} force differs by {off:.1e} of the largest, ruptures by {late:.1e} s ({keep.sum()} samples)")
        worst = max(worst, off)
    if worst > 1e-3:
        sys.exit("more than 1e-3")


main()
