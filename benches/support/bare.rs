//! Plain scalar loops with the arithmetic of the force law and of the online algorithm, for comparison:
//! what a hand-written program for exactly this one case would cost. They are the yardstick of the
//! benchmarks, not part of Stylet.

/// The base law of three layers, hard-wired: no effects, no interpolation of rupture instants.
pub struct BareLaw {
    pub front: [f64; 3],
    pub thickness: [f64; 3],
    pub stiffness: [f64; 3],
    pub friction: [f64; 3],
    pub puncture: [f64; 3],
    pub ruptured: usize,
}

impl BareLaw {
    #[inline(always)]
    pub fn step(&mut self, z: f64, v: f64) -> f64 {
        let mut elastic = 0.0;
        while self.ruptured < 3 {
            let a = self.ruptured;
            let x = z - self.front[a];
            elastic = if x > 0.0 { self.stiffness[a] * x } else { 0.0 };
            if elastic < self.puncture[a] && x < self.thickness[a] {
                break;
            }
            self.ruptured += 1;
            elastic = 0.0;
        }
        let mut friction = 0.0;
        for i in 0..3 {
            friction += self.friction[i] * (z - self.front[i]).clamp(0.0, self.thickness[i]);
        }
        elastic + v * friction
    }
}

/// RLS, CUSUM, derivative and a counter for the covariance reset, and at each rupture the re-run of
/// the layer's samples in one go.
pub struct BareCore {
    pub k: f64,
    pub b: f64,
    p: [f64; 3],
    start: f64,
    cumulative: f64,
    g: f64,
    f_lp: f64,
    rate: f64,
    since: u32,
    blind: f64,
    v_last: f64,
    a_lp: f64,
    layer: Vec<(f64, f64, f64)>,
}

impl BareCore {
    pub fn new() -> Self {
        Self {
            k: 0.0,
            b: 0.0,
            p: [1e6, 0.0, 1e6],
            start: 0.0,
            cumulative: 0.0,
            g: 0.0,
            f_lp: 0.0,
            rate: 0.0,
            since: 0,
            blind: 0.002,
            v_last: 0.0,
            a_lp: 0.0,
            layer: Vec::with_capacity(16384),
        }
    }

    #[inline(always)]
    fn update(&mut self, dz: f64, v: f64, y: f64, prior_b: f64) -> f64 {
        self.since += 1;
        if self.since == 5 {
            self.since = 0;
            self.p = [1e6, 0.0, prior_b];
        }
        let phi = [dz, dz * v];
        let e = y - phi[0] * self.k - phi[1] * self.b;
        let p0 = self.p[0] * phi[0] + self.p[1] * phi[1];
        let p1 = self.p[1] * phi[0] + self.p[2] * phi[1];
        let gain = 1.0 / (1.0 + phi[0] * p0 + phi[1] * p1);
        self.k += p0 * e * gain;
        self.b += p1 * e * gain;
        self.p = [self.p[0] - p0 * p0 * gain, self.p[1] - p0 * p1 * gain, self.p[2] - p1 * p1 * gain];
        e
    }

    /// Returns the enhanced force and whether a rupture was declared.
    #[inline(always)]
    pub fn step(&mut self, dt: f64, z: f64, v: f64, f: f64) -> (f64, bool) {
        let step = 0.01 * (f - self.f_lp);
        self.f_lp += step;
        self.rate += 0.1 * (step / dt - self.rate);
        self.a_lp += 0.4 * ((v - self.v_last) / dt - self.a_lp);
        self.v_last = v;
        let dz = z - self.start;
        if dz <= 0.0 {
            return (f, false);
        }
        self.layer.push((z, v, f));
        let e = self.update(dz, v, f - self.cumulative * v, 1e6);
        let mut found = false;
        if dz > self.blind && self.a_lp.abs() < 0.05 {
            self.g = (self.g + e * e - 0.0113).max(0.0);
            if self.g > 0.0112 {
                found = true;
                let share: f64 = 0.66;
                let prior = 1e6 * (1.0 - share) / (share * v * v);
                (self.k, self.b, self.p, self.since) = (0.0, 0.0, [1e6, 0.0, prior], 0);
                let layer = std::mem::take(&mut self.layer);
                for &(z, v, f) in &layer {
                    self.update(z - self.start, v, f - self.cumulative * v, prior);
                }
                self.layer = layer;
                self.layer.clear();
                self.cumulative += self.b.max(0.0) * dz;
                (self.k, self.b, self.p, self.g) = (0.0, 0.0, [1e6, 0.0, 1e6], 0.0);
                self.start = z;
                self.blind = 0.0075;
            }
        }
        (f - self.cumulative * v, found)
    }
}
