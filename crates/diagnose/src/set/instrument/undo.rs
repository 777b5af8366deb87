//! Insertions as an instrument without its faults would have measured them.

use super::{Instrument, NOTHING};
use crate::raw::{self, Raw};
use crate::set::first::Insertion;
use stylet_record::Recording;
use stylet_tissue::AnyEffect;

/// The slope of the force is taken over so many samples to either side.
const SLOPE: usize = 3;

/// Insertions with what the instrument shows undone, and what their raw force says.
#[derive(Clone, Debug)]
pub struct Undone {
    /// The insertions.
    pub runs: Vec<Insertion>,
    /// What the force says as it was written down: limits and steps are the sensor's, not the tissue's.
    pub raw: Raw,
}

impl Instrument {
    /// Undoes what it shows: a delay first, the lag, then drift, bias and gain. Without anything shown the insertions stay as they are.
    #[must_use]
    pub fn undo(&self, runs: &[&Insertion]) -> Undone {
        let of = |e: &AnyEffect| if let AnyEffect::TimeDelay(d) = e { d.delay_s } else { 0.0 };
        let delay_s: f64 = self.effects().iter().map(of).sum();
        let shifted: Vec<Recording> = runs.iter().map(|r| earlier(&r.recording, delay_s)).collect();
        let notes: Vec<_> = runs.iter().map(|r| r.notes.clone()).collect();
        let mut raw = raw::look(&shifted.iter().collect::<Vec<_>>(), &notes);
        let force_n = shifted.iter().flat_map(|r| &r.force_n).fold(0.0_f64, |most, f| most.max(f.abs()));
        raw.spikes = raw.spikes.filter(|s| s.size_n > NOTHING * force_n);
        let layers = runs.first().map_or(0, |r| r.ruptures_s.len());
        let runs = runs
            .iter()
            .zip(shifted)
            .enumerate()
            .map(|(k, (run, mut recording))| {
                let limit_n = raw.limit_n.map(|limit| self.without_gain(limit));
                if self.shown.is_empty() {
                    return Insertion { limit_n, ..(*run).clone() };
                }
                self.undo_force(&mut recording, self.drifts_n_per_s.get(k).copied().flatten());
                let notes = run.notes.clone();
                Insertion { notes, limit_n, ..Insertion::new(run.name.clone(), recording, layers) }
            })
            .collect();
        Undone { runs, raw }
    }

    /// What is undone, as effects of a simulation; tones, which blocks average away, and the drive stay out of it.
    pub(crate) fn effects(&self) -> Vec<AnyEffect> {
        let undone =
            |e: &AnyEffect| !matches!(e, AnyEffect::PeriodicInterference(_) | AnyEffect::DriveFriction(_));
        self.shown.iter().filter_map(|s| s.itself.clone()).filter(undone).collect()
    }

    /// `drift_n_per_s` is the recording's own, where it tells it.
    fn undo_force(&self, recording: &mut Recording, drift_n_per_s: Option<f64>) {
        let effects = self.effects();
        for e in &effects {
            if let AnyEffect::LowPassLag(lag) = e {
                quick(recording, lag.time_constant_s);
            }
        }
        let of = |e: &AnyEffect| if let AnyEffect::ForceDrift(d) = e { d.rate_n_per_s } else { 0.0 };
        let shown: f64 = effects.iter().map(of).sum();
        let rate = if shown == 0.0 { 0.0 } else { drift_n_per_s.unwrap_or(shown) };
        let began = recording.time_s[0];
        for (f, t) in recording.force_n.iter_mut().zip(&recording.time_s) {
            *f = self.without_gain(*f - rate * (t - began));
        }
    }

    fn without_gain(&self, force_n: f64) -> f64 {
        let (mut bias_n, mut gain) = (0.0, 0.0);
        for e in self.shown.iter().filter_map(|s| s.itself.as_ref()) {
            match e {
                AnyEffect::ForceBias(b) => bias_n = b.force_n,
                AnyEffect::ForceGain(g) => gain = g.eps,
                _ => {}
            }
        }
        (force_n - bias_n) / (1.0 + gain)
    }
}

/// The same recording, its force so much earlier: every sample keeps its place and takes the force that was written down a delay later,
/// as it was written down; those at the end that would need what comes after the recording go.
fn earlier(recording: &Recording, delay_s: f64) -> Recording {
    let mut out = recording.clone();
    if delay_s <= 0.0 {
        return out;
    }
    let t = &recording.time_s;
    let last = t[t.len() - 1];
    let kept = t.partition_point(|t| t + delay_s <= last).max(2);
    out.force_n = (0..kept)
        .map(|i| {
            let wanted = t[i] + delay_s;
            let k = t.partition_point(|t| *t < wanted).min(t.len() - 1);
            let nearer = k > 0 && wanted - t[k - 1] < t[k] - wanted;
            recording.force_n[if nearer { k - 1 } else { k }]
        })
        .collect();
    out.time_s.truncate(kept);
    out.position_m.truncate(kept);
    out.velocity_mps.truncate(kept);
    out.joint_torque_nm.truncate(kept);
    if let Some(f) = &mut out.force_virtual_n {
        f.truncate(kept);
    }
    out
}

/// Undoes a lag: the force and its time constant times its slope.
fn quick(recording: &mut Recording, lag_s: f64) {
    if lag_s <= 0.0 {
        return;
    }
    let (t, f) = (&recording.time_s, &recording.force_n);
    let slope = |i: usize| {
        let (a, b) = (i.saturating_sub(SLOPE), (i + SLOPE).min(f.len() - 1));
        super::line(&t[a..=b], &f[a..=b]).rate_n_per_s
    };
    recording.force_n = (0..f.len()).map(|i| f[i] + lag_s * slope(i)).collect();
}
