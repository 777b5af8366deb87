//! Insertions as an instrument without its faults would have measured them.

use super::{Instrument, NOTHING, Shown};
use crate::raw::{self, Raw};
use crate::set::first::Insertion;
use stylet_record::Recording;
use stylet_tissue::AnyEffect;

/// Effects that are undone, and their number.
const UNDONE: [(&str, &str); 5] = [
    ("time_delay", "delay_s"),
    ("low_pass_lag", "time_constant_s"),
    ("force_drift", "rate_n_per_s"),
    ("force_bias", "force_n"),
    ("force_gain", "eps"),
];
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
        let delay_s = self.number("time_delay", "delay_s");
        let shifted: Vec<Recording> = runs.iter().map(|r| earlier(&r.recording, delay_s)).collect();
        let notes: Vec<_> = runs.iter().map(|r| r.notes.clone()).collect();
        let mut raw = raw::look(&shifted.iter().collect::<Vec<_>>(), &notes);
        let force_n = shifted.iter().flat_map(|r| &r.force_n).fold(0.0_f64, |most, f| most.max(f.abs()));
        raw.spikes = raw.spikes.filter(|s| s.size_n > NOTHING * force_n);
        let layers = runs.first().map_or(0, |r| r.ruptures_s.len());
        let runs = runs
            .iter()
            .zip(shifted)
            .map(|(run, mut recording)| {
                let limit_n = raw.limit_n.map(|limit| self.without_gain(limit));
                if self.shown.is_empty() {
                    return Insertion { limit_n, ..(*run).clone() };
                }
                self.undo_force(&mut recording);
                let notes = run.notes.clone();
                Insertion { notes, limit_n, ..Insertion::new(run.name.clone(), recording, layers) }
            })
            .collect();
        Undone { runs, raw }
    }

    /// What is undone, as effects of a simulation; tones, which blocks average away, and the drive stay out of it.
    pub(crate) fn effects(&self) -> Vec<AnyEffect> {
        UNDONE
            .iter()
            .filter_map(|(effect, path)| {
                let at = self.number(effect, path);
                (at != 0.0).then(|| AnyEffect::from_parameters(effect, &[at])).flatten()
            })
            .collect()
    }

    fn undo_force(&self, recording: &mut Recording) {
        quick(recording, self.number("low_pass_lag", "time_constant_s"));
        let rate = self.number("force_drift", "rate_n_per_s");
        let began = recording.time_s[0];
        for (f, t) in recording.force_n.iter_mut().zip(&recording.time_s) {
            *f = self.without_gain(*f - rate * (t - began));
        }
    }

    fn without_gain(&self, force_n: f64) -> f64 {
        (force_n - self.number("force_bias", "force_n")) / (1.0 + self.number("force_gain", "eps"))
    }

    /// A number of an effect that is shown; zero when it is not.
    fn number(&self, effect: &str, path: &str) -> f64 {
        let of = |s: &Shown| s.parameters.get(path).map(|e| e.value);
        self.shown.iter().find(|s| s.effect == effect).and_then(of).unwrap_or(0.0)
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
