//! Puncture forces that scatter from recording to recording: the instants of ruptures then tell less than sampling
//! leaves open, and no effect may be named for explaining some of the scatter.

use super::{Candidate, Search};
use crate::fit::{Residuals, residuals, rho};

/// Nats that the scatter itself has to gain, as an effect of its own would.
const NEEDED: f64 = 20.0;
/// Smallest and largest scatter that is tried, as a share of the puncture force, and the ratio of two that follow one
/// another.
const SHARES: (f64, f64, f64) = (1e-4, 1.0, 1.1);

/// A rupture whose force is known: layer, distance from the puncture force as a share of it, what sampling leaves
/// open of that share, and its distance in standard deviations as the fit counts it.
struct Known {
    layer: usize,
    share: f64,
    sd: f64,
    u: f64,
}

impl Search {
    /// Nats that a candidate gains when its puncture forces may scatter; 0 when they do not.
    pub(super) fn scatter(&self, candidate: &Candidate) -> f64 {
        let mut r = Residuals::default();
        if !residuals(&candidate.model, &self.data_of(candidate), &mut r) {
            return 0.0;
        }
        let layers = candidate.model.assumed.layers.len();
        let one = |(k, e): (usize, &crate::forward::Event)| {
            let (share, sd) = e.by_force()?;
            Some(Known { layer: k % layers, share, sd, u: e.u })
        };
        let known: Vec<Known> = r.events.iter().enumerate().filter_map(one).collect();
        gain(&known, layers)
    }

    /// The candidate's nats with what scatter gains.
    pub(super) fn forgiving(&self, candidate: &Candidate) -> Candidate {
        Candidate { nats: candidate.nats - self.scatter(candidate), ..candidate.clone() }
    }
}

/// `sum rho(u)` less its minimum when the shares of a layer scatter around a common one with a standard deviation
/// `s`, `sum d^2/(2 (sd^2 + s^2)) + ln(1 + s^2/sd^2)/2`, less what that needs.
fn gain(known: &[Known], layers: usize) -> f64 {
    let plain: f64 = known.iter().map(|k| rho(k.u)).sum();
    let steps = ((SHARES.1 / SHARES.0).ln() / SHARES.2.ln()) as i32;
    let scattered = (0..=steps)
        .map(|step| {
            let s = SHARES.0 * SHARES.2.powi(step);
            (0..layers).map(|layer| around_common(known.iter().filter(|k| k.layer == layer), s)).sum()
        })
        .fold(f64::INFINITY, f64::min);
    (plain - scattered - NEEDED).max(0.0)
}

/// Nats of a layer's shares that scatter by `s` around their weighted mean.
fn around_common<'a>(known: impl Iterator<Item = &'a Known> + Clone, s: f64) -> f64 {
    let variance = |k: &Known| k.sd * k.sd + s * s;
    let (sum, weight) =
        known.clone().fold((0.0, 0.0), |(sum, w), k| (sum + k.share / variance(k), w + 1.0 / variance(k)));
    let mean = if weight > 0.0 { sum / weight } else { 0.0 };
    known
        .map(|k| 0.5 * (k.share - mean).powi(2) / variance(k) + 0.5 * (variance(k) / (k.sd * k.sd)).ln())
        .sum()
}

#[cfg(test)]
mod tests {
    use super::{Known, gain};

    /// Ruptures of one layer at shares of their sampling errors of 0.1 % each.
    fn ruptures(u: &[f64]) -> Vec<Known> {
        u.iter().map(|u| Known { layer: 0, share: 1e-3 * u, sd: 1e-3, u: *u }).collect()
    }

    #[test]
    fn events_as_exact_as_sampling_gain_nothing_from_scatter() {
        assert_eq!(gain(&ruptures(&[0.5, -1.2, 1.6, -0.3]), 1), 0.0);
        assert_eq!(gain(&ruptures(&[2.5, -1.2, 1.6, -2.3, 1.9]), 1), 0.0);
    }

    #[test]
    fn scattered_events_gain_what_huber_charges_for_them() {
        assert!(gain(&ruptures(&[40.0, -35.0, 60.0, -20.0, 15.0, -70.0]), 1) > 600.0);
    }

    /// One slow recording, whose sampling leaves little open, weighs no more than the others once all scatter.
    #[test]
    fn a_slow_recording_does_not_dominate_the_scatter() {
        let mut known = ruptures(&[30.0, -25.0, 20.0, -28.0]);
        let before = gain(&known, 1);
        (known[0].sd, known[0].u) = (1e-5, 3000.0);
        let charged = 3.0 * (3000.0 - 30.0);
        assert!((gain(&known, 1) - before - charged).abs() < 0.01 * charged);
    }
}
