//! Puncture forces that scatter from recording to recording: the instants of ruptures then tell less than sampling
//! leaves open, and no effect may be named for explaining some of the scatter.

use super::{Candidate, Search};
use crate::fit::{Residuals, residuals, rho};

/// Nats that the scatter itself has to gain, as an effect of its own would.
const NEEDED: f64 = 20.0;

impl Search {
    /// Nats that a candidate gains when its puncture forces may scatter; 0 when they do not.
    pub(super) fn scatter(&self, candidate: &Candidate) -> f64 {
        let mut r = Residuals::default();
        if !residuals(&candidate.model, &self.data_of(candidate), &mut r) {
            return 0.0;
        }
        let u: Vec<f64> = r.events.iter().map(|e| e.u).collect();
        gain(&u)
    }

    /// The candidate's nats with what scatter gains.
    pub(super) fn forgiving(&self, candidate: &Candidate) -> Candidate {
        Candidate { nats: candidate.nats - self.scatter(candidate), ..candidate.clone() }
    }
}

/// `sum rho(u)` less its minimum over a common scale `s >= 1`, `sum u^2/(2 s^2) + n ln s`, less what that needs.
fn gain(u: &[f64]) -> f64 {
    let n = u.len().max(1) as f64;
    let plain: f64 = u.iter().map(|u| rho(*u)).sum();
    let variance = u.iter().map(|u| u * u).sum::<f64>() / n;
    if variance <= 1.0 {
        return 0.0;
    }
    let scaled = 0.5 * n * (1.0 + variance.ln());
    (plain - scaled - NEEDED).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::gain;

    #[test]
    fn events_as_exact_as_sampling_gain_nothing_from_scatter() {
        assert_eq!(gain(&[0.5, -1.2, 1.6, -0.3]), 0.0);
        assert_eq!(gain(&[2.5, -1.2, 1.6, -2.3, 1.9]), 0.0);
    }

    #[test]
    fn scattered_events_gain_what_huber_charges_for_them() {
        let u = [40.0, -35.0, 60.0, -20.0, 15.0, -70.0];
        assert!(gain(&u) > 600.0);
    }
}
