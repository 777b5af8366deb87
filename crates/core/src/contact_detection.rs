//! First contact found from the data \[D\]: bias and noise are learnt in air, contact is declared
//! when the low-passed force stands out of the noise for several samples, and its position is
//! traced back along the loading line to zero force.

use crate::config::ContactConfig;
use crate::line_fit::LineFit;
use crate::low_pass::LowPassCoefficients;
use crate::sample::Sample;

/// Time over which bias and noise in air are forgotten, in s.
const FORGET_S: f64 = 5.0;

/// What the search knows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactDetector {
    /// Of the low-pass on the force, and of what is forgotten of bias and noise.
    coefficients: LowPassCoefficients<2>,
    elapsed_s: f64,
    force_n: f64,
    // Welford's running mean and variance of the force in air.
    count: f64,
    mean_n: f64,
    m2: f64,
    above: usize,
    line: LineFit,
    first: u64,
    declared_m: Option<f64>,
}

/// What the search says after a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ContactStatus {
    /// Still in air.
    InAir,
    /// Contact declared; the position is the present best guess.
    Provisional { surface_m: f64, first: u64 },
    /// Contact settled.
    Settled { surface_m: f64, first: u64 },
}

impl ContactDetector {
    pub(crate) fn new(config: &ContactConfig) -> Self {
        Self {
            coefficients: LowPassCoefficients::new([config.time_constant_s, FORGET_S]),
            elapsed_s: 0.0,
            force_n: 0.0,
            count: 0.0,
            mean_n: 0.0,
            m2: 0.0,
            above: 0,
            line: LineFit::default(),
            first: 0,
            declared_m: None,
        }
    }

    fn noise_n(&self, config: &ContactConfig) -> f64 {
        if self.count < 2.0 {
            return f64::INFINITY;
        }
        libm::sqrt(self.m2 / (self.count - 1.0)).max(config.min_noise_n)
    }

    /// Takes sample number `number`.
    pub(crate) fn update(
        &mut self,
        config: &ContactConfig,
        dt_s: f64,
        sample: Sample,
        number: u64,
    ) -> ContactStatus {
        self.elapsed_s += dt_s;
        let [low_pass, forget] = *self.coefficients.at_interval(dt_s);
        if self.count == 0.0 && self.declared_m.is_none() {
            self.force_n = sample.force_n;
        }
        self.force_n += low_pass * (sample.force_n - self.force_n);
        let noise = self.noise_n(config);
        let lift = self.force_n - self.mean_n;
        let learning = self.elapsed_s < config.learn_s || self.count < 10.0;
        if let Some(declared_m) = self.declared_m {
            self.line.add(sample.position_m, sample.force_n);
            let surface_m = self.surface_m(config, declared_m);
            let first = self.first;
            return if (sample.position_m - declared_m).abs() >= config.extrapolate_over_m {
                ContactStatus::Settled { surface_m, first }
            } else {
                ContactStatus::Provisional { surface_m, first }
            };
        }
        // The loading line begins where the force starts to stand out.
        if !learning && lift > 2.0 * noise {
            if self.line.count == 0.0 {
                self.first = number;
            }
            self.line.add(sample.position_m, sample.force_n);
        } else {
            self.line = LineFit::default();
            self.learn(forget, learning, sample.force_n);
        }
        self.above = if !learning && lift > config.noise_sds * noise { self.above + 1 } else { 0 };
        if self.above < config.samples.max(1) {
            return ContactStatus::InAir;
        }
        self.declared_m = Some(sample.position_m);
        ContactStatus::Provisional { surface_m: self.surface_m(config, sample.position_m), first: self.first }
    }

    /// Bias and noise: by Welford's recursion at first, then slowly forgetting, so that a drift in air
    /// is followed and a loading line is not.
    fn learn(&mut self, share: f64, learning: bool, force_n: f64) {
        if learning {
            self.count += 1.0;
            let delta = force_n - self.mean_n;
            self.mean_n += delta / self.count;
            self.m2 += delta * (force_n - self.mean_n);
            return;
        }
        let delta = force_n - self.mean_n;
        self.mean_n += share * delta;
        self.m2 += share * ((self.count - 1.0) * delta * delta - self.m2);
    }

    /// Zero-force end of the loading line (where contact was declared, when nothing is extrapolated), never beyond the declaration and at most 5 mm before.
    fn surface_m(&self, config: &ContactConfig, declared_m: f64) -> f64 {
        if config.extrapolate_over_m <= 0.0 {
            return declared_m;
        }
        match self.line.x_at(self.mean_n) {
            Some(at) if self.line.slope() > 0.0 => at.clamp(declared_m - 0.005, declared_m),
            _ => declared_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 0.005;
    const SPEED_MPS: f64 = 0.0023;

    /// A force of 40 N/m from the surface at zero on, with bias and noise, from 5 mm before: what is found, sample by sample.
    fn search(
        config: &ContactConfig,
        bias_n: f64,
        noise_n: f64,
        drift_n_per_s: f64,
    ) -> alloc::vec::Vec<ContactStatus> {
        let mut search = ContactDetector::new(config);
        (0..1000_u64)
            .map(|k| {
                let time_s = DT_S * k as f64;
                let position_m = -0.005 + SPEED_MPS * time_s;
                let noise = noise_n * ((k * 7919 % 1009) as f64 / 504.0 - 1.0);
                let drift_n = drift_n_per_s * time_s.min(0.005 / SPEED_MPS);
                let force_n = bias_n + drift_n + noise + 40.0 * position_m.max(0.0);
                search.update(
                    config,
                    DT_S,
                    Sample { time_s, position_m, velocity_mps: SPEED_MPS, force_n },
                    k,
                )
            })
            .collect()
    }

    /// Sample at which it is declared and settled, and where.
    fn found(all: &[ContactStatus]) -> (usize, usize, f64) {
        let declared = all.iter().position(|f| *f != ContactStatus::InAir).expect("a contact");
        let settled = all.iter().position(|f| matches!(f, ContactStatus::Settled { .. })).expect("settled");
        let ContactStatus::Settled { surface_m, .. } = all[settled] else { unreachable!() };
        (declared, settled, surface_m)
    }

    #[test]
    fn the_surface_is_where_the_loading_line_comes_from_whatever_bias_and_noise_are() {
        let config = ContactConfig::default();
        for (bias_n, noise_n) in [(0.0, 0.0), (0.0, 0.02), (-1.5, 0.02), (3.0, 0.005)] {
            let (declared, settled, surface_m) = found(&search(&config, bias_n, noise_n, 0.0));
            assert!(surface_m.abs() < 1e-4 + 5e-3 * noise_n, "{surface_m} m at {bias_n} N, {noise_n} N");
            // Never in the air, and settled a millimetre after.
            assert!(DT_S * declared as f64 * SPEED_MPS > 0.005, "declared at {declared}");
            let travel_m = (settled - declared) as f64 * DT_S * SPEED_MPS;
            assert!((0.001..0.001 + 2.0 * DT_S * SPEED_MPS).contains(&travel_m), "{travel_m} m");
        }
    }

    #[test]
    fn a_slow_drift_in_air_is_followed_and_is_no_contact() {
        // 10 mN/s: twice the noise within the two seconds of the way in air.
        let (declared, _, surface_m) = found(&search(&ContactConfig::default(), 0.0, 0.01, 0.01));
        assert!(DT_S * declared as f64 * SPEED_MPS > 0.005 && surface_m.abs() < 1e-3, "{surface_m} m");
    }

    #[test]
    fn without_extrapolation_the_surface_is_where_contact_was_declared_and_settles_there() {
        let config = ContactConfig { extrapolate_over_m: 0.0, ..ContactConfig::default() };
        let all = search(&config, 0.0, 0.02, 0.0);
        let (declared, settled, surface_m) = found(&all);
        assert_eq!(surface_m, -0.005 + SPEED_MPS * (DT_S * declared as f64));
        assert_eq!(settled, declared + 1);
    }

    #[test]
    fn the_more_standard_deviations_and_samples_are_asked_for_the_later_contact_is_declared() {
        let declared = |noise_sds: f64, samples: usize| {
            found(&search(&ContactConfig { noise_sds, samples, ..ContactConfig::default() }, 0.0, 0.02, 0.0))
                .0
        };
        let usual = declared(5.0, 5);
        assert_eq!(declared(5.0, 25), usual + 20);
        // Five more of the noise's standard deviations, 0.02/sqrt(3) N, at 40 N/m are 1.44 mm: 125 samples.
        assert!((115..=135).contains(&(declared(10.0, 5) - usual)), "{} {usual}", declared(10.0, 5));
    }

    #[test]
    fn contact_is_not_declared_while_bias_and_noise_are_learned() {
        // The needle is said to begin at the surface: what loads it in the first second is taken for bias.
        let config = ContactConfig { learn_s: 1.0, ..ContactConfig::default() };
        let mut search = ContactDetector::new(&config);
        for k in 0..190_u64 {
            let force_n = if k < 20 { 0.0 } else { 0.5 };
            let found = search.update(&config, DT_S, Sample { force_n, ..Sample::default() }, k);
            assert_eq!(found, ContactStatus::InAir, "sample {k}");
        }
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{found} for {expected}");
    }

    /// Noise of 0.1 N about 0.3 N is known from twenty samples of a second; the low-passed force is this.
    fn known(force_n: f64) -> (ContactConfig, ContactDetector) {
        let config = ContactConfig::default();
        let mut search = ContactDetector::new(&config);
        (search.count, search.mean_n, search.m2) = (20.0, 0.3, 0.19);
        (search.elapsed_s, search.force_n) = (1.0, force_n);
        (config, search)
    }

    fn at(position_m: f64, force_n: f64) -> Sample {
        Sample { position_m, force_n, ..Sample::default() }
    }

    #[test]
    fn bias_and_noise_are_those_of_all_samples_at_first_and_then_forgotten_slowly() {
        let config = ContactConfig::default();
        let mut search = ContactDetector::new(&config);
        assert_eq!(search.noise_n(&config), f64::INFINITY);
        let forces_n = [0.7, 0.4, 0.9, 0.1, 0.6];
        search.learn(0.1, true, forces_n[0]);
        assert_eq!(search.noise_n(&config), f64::INFINITY);
        forces_n[1..].iter().for_each(|f| search.learn(0.1, true, *f));
        near(search.mean_n, 0.54);
        let squares: f64 = forces_n.iter().map(|f| (f - 0.54) * (f - 0.54)).sum();
        near(search.noise_n(&config), (squares / 4.0).sqrt());
        let (config, mut search) = known(0.3);
        near(search.noise_n(&config), 0.1);
        search.learn(0.1, false, 0.5);
        near(search.mean_n, 0.32);
        // The variance of 0.01 moves by a tenth towards 0.04.
        near(search.noise_n(&config), 0.013_f64.sqrt());
        assert_eq!(search.count, 20.0);
        search.m2 = 0.0;
        assert_eq!(search.noise_n(&config), 1e-4);
    }

    #[test]
    fn the_force_is_low_passed_from_the_first_sample_on() {
        let (config, mut search) = known(0.3);
        search.update(&config, 0.005, at(0.001, 0.4), 7);
        near(search.force_n, 0.3 + 0.1 * (1.0 - (-0.1_f64).exp()));
        near(search.elapsed_s, 1.005);
        let mut fresh = ContactDetector::new(&config);
        fresh.update(&config, 0.0, at(0.0, 5.0), 0);
        assert_eq!((fresh.force_n, fresh.mean_n), (5.0, 5.0));
    }

    #[test]
    fn a_loading_line_begins_at_two_standard_deviations_and_contact_is_counted_from_five() {
        // Lift over the bias, whether it belongs to the line, and whether it counts.
        for (lift_n, line, above) in
            [(0.19, 0.0, 0), (0.21, 1.0, 0), (0.49, 1.0, 0), (0.51, 1.0, 1), (-0.6, 0.0, 0)]
        {
            let force_n = 0.3 + lift_n;
            let (config, mut search) = known(force_n);
            assert_eq!(search.update(&config, 0.005, at(0.001, force_n), 7), ContactStatus::InAir);
            assert_eq!((search.line.count, search.above), (line, above), "{lift_n} N");
            assert_eq!(search.first, if line > 0.0 { 7 } else { 0 });
            // What belongs to the line is no noise.
            assert_eq!(search.mean_n == 0.3, line > 0.0);
            // The line goes on, or is given up.
            search.force_n = force_n;
            search.update(&config, 0.005, at(0.001, force_n), 8);
            assert!(search.line.count == 2.0 * line && search.above == 2 * above);
            search.force_n = 0.3;
            search.update(&config, 0.005, at(0.001, 0.3), 9);
            assert_eq!((search.line.count, search.above), (0.0, 0));
        }
        // As long as bias and noise are being learned all is noise: for a quarter of a second and ten samples.
        for (elapsed_s, count, learning) in
            [(0.24, 20.0, true), (0.246, 20.0, false), (1.0, 9.0, true), (1.0, 10.0, false)]
        {
            let (config, mut search) = known(0.9);
            (search.elapsed_s, search.count) = (elapsed_s, count);
            search.m2 = 0.01 * (count - 1.0);
            search.update(&config, 0.005, at(0.001, 0.9), 7);
            assert_eq!(
                (search.above == 0, search.count > count),
                (learning, learning),
                "{elapsed_s} {count}"
            );
        }
    }

    #[test]
    fn contact_is_declared_after_its_samples_and_settled_after_its_travel() {
        for (samples, needed) in [(3, 3), (1, 1), (0, 1)] {
            let (mut config, mut search) = known(0.9);
            config.samples = samples;
            for k in 1..needed {
                assert_eq!(search.update(&config, 0.005, at(0.001, 0.9), k), ContactStatus::InAir);
            }
            let found = search.update(&config, 0.005, at(0.0012, 0.9), needed);
            assert!(matches!(found, ContactStatus::Provisional { first: 1, .. }), "{found:?}");
            assert_eq!(search.declared_m, Some(0.0012));
            for (position_m, settled) in
                [(0.0015, false), (0.002, false), (0.0003, false), (0.0023, true), (0.0001, true)]
            {
                let mut search = search;
                let found = search.update(&config, 0.005, at(position_m, 1.3), 9);
                assert_eq!(
                    matches!(found, ContactStatus::Settled { first: 1, .. }),
                    settled,
                    "{position_m} m"
                );
                assert_eq!(search.mean_n, 0.3, "nothing more is learned of the air");
            }
        }
    }

    #[test]
    fn the_surface_is_where_the_line_meets_the_bias_within_five_millimetres_before_the_declaration() {
        // Slope, and where the line is 0.3 N; the surface, with contact declared at 10 mm.
        for (slope, zero_m, surface_m) in [
            (40.0, 0.0083, 0.0083),
            (40.0, 0.001, 0.005),
            (40.0, 0.012, 0.01),
            (-40.0, 0.0083, 0.01),
            (0.0, 0.0, 0.01),
        ] {
            let (mut config, mut search) = known(0.3);
            assert_eq!(search.surface_m(&config, 0.01), 0.01, "no line");
            for x in [0.0097, 0.0101, 0.0109] {
                search.line.add(x, 0.3 + slope * (x - zero_m));
            }
            assert!((search.surface_m(&config, 0.01) - surface_m).abs() < 1e-12);
            config.extrapolate_over_m = 0.0;
            assert_eq!(search.surface_m(&config, 0.01), 0.01);
        }
    }
}
