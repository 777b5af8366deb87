//! Candidate terms as columns: the problem that a sparse regression is given.
//!
//! What a user of such a package would work out: the residual of the fitted base law, the change of the
//! simulated force per base parameter, and its change by every effect of the library at the values where
//! the search begins too. Ruptures are imposed where the data show them, as in the search; what they say of
//! the law comes as further rows.

use crate::fit::{Data, HUBER, Residuals, residuals};
use crate::look::Look;
use crate::model::{Choice, Role};
use crate::search::{Search, shift};
use crate::spectrum::{peaks, sharpen};
use crate::starts::{self, Hints, Start};
use crate::track::Track;

/// Lines of the residual's periodogram that become terms.
const LINES: usize = 5;
/// Frequencies of a breathing tissue that become terms: those that explain most by themselves.
const BREATHS: usize = 6;
/// Smallest frequency (Hz) of a line.
const SLOWEST_HZ: f64 = 0.04;

/// One column.
#[derive(Clone, Debug)]
pub struct Column {
    /// Effect; empty for a base parameter.
    pub effect: &'static str,
    /// Values of the effect's parameters, or layer and number of a base parameter.
    pub values: Vec<f64>,
    /// Change of the force in N: by the effect, or per relative change of the base parameter.
    pub x: Vec<f64>,
}

/// The regression problem of a case.
#[derive(Clone, Debug, Default)]
pub struct Terms {
    /// Residual of the base law in N.
    pub y: Vec<f64>,
    /// Recording of each row; rows of ruptures have the number of recordings added.
    pub recording: Vec<usize>,
    /// The columns.
    pub columns: Vec<Column>,
}

impl Terms {
    /// The terms of a fitted base law, as means over `q` samples. Rows of ruptures stand at the end: their
    /// distance from the law's own in units of what sampling leaves open, times the noise, and held down
    /// where large as the fit does.
    #[must_use]
    pub fn of(search: &Search, q: usize) -> Option<Self> {
        let (model, data) = (&search.base.model, search.data_of(&search.base));
        let mut at = Residuals::default();
        if !residuals(model, &data, &mut at) {
            return None;
        }
        let rows = Rows::new(&data, &at, q);
        let mut out = Self {
            y: rows.of(&at.e, at.events.iter().map(|e| e.u)),
            recording: rows.recording.clone(),
            columns: Vec::new(),
        };
        let mut work = Residuals::default();
        let mut add =
            |effect: &'static str, values: Vec<f64>, trial: &crate::model::Model, there: &Data, step: f64| {
                if residuals(trial, there, &mut work) {
                    let e: Vec<f64> = at.e.iter().zip(&work.e).map(|(a, b)| (a - b) / step).collect();
                    let u = at.events.iter().zip(&work.events).map(|(a, b)| (a.u - b.u) / step);
                    out.columns.push(Column { effect, values, x: rows.of(&e, u) });
                }
            };
        let slots = model.slots();
        let p = model.vector(&slots);
        for (k, slot) in slots.iter().enumerate() {
            let Role::Base { layer, what } = slot.role else { continue };
            let mut moved = p.clone();
            let step = if p[k] + slot.step > slot.high { -slot.step } else { slot.step };
            moved[k] += step;
            let mut trial = model.clone();
            trial.set(&slots, &moved);
            add("", vec![layer as f64 + 1.0, what as f64], &trial, &data, step);
        }
        for start in candidates(search, &data, &at) {
            let choice = &start.choice;
            let trial = model.with(choice.clone());
            let there = shift(&data, &start);
            add(choice.info.id, choice.values.clone(), &trial, &there, 1.0);
            if start.quadrature {
                let mut other = choice.clone();
                other.values[2] = core::f64::consts::FRAC_PI_2;
                add(choice.info.id, other.values.clone(), &model.with(other), &there, 1.0);
            }
        }
        Some(out)
    }
}

/// Which samples make a row.
struct Rows {
    blocks: Vec<(usize, usize)>,
    recording: Vec<usize>,
    /// Factor of each rupture's row.
    ruptures: Vec<f64>,
}

impl Rows {
    fn new(data: &Data, at: &Residuals, q: usize) -> Self {
        let mut rows = Self { blocks: Vec::new(), recording: Vec::new(), ruptures: Vec::new() };
        let mut from = 0;
        for (k, track) in data.tracks.iter().enumerate() {
            for i in (0..(track.len() + 1).saturating_sub(q)).step_by(q) {
                if track.used[i..i + q].iter().all(|u| *u) {
                    rows.blocks.push((from + i, from + i + q));
                    rows.recording.push(k);
                }
            }
            from += track.len();
        }
        let layers = at.events.len() / data.tracks.len().max(1);
        for (k, event) in at.events.iter().enumerate() {
            rows.ruptures.push(data.noise.marginal_n * (HUBER / event.u.abs().max(HUBER)).sqrt());
            rows.recording.push(data.tracks.len() + k / layers.max(1));
        }
        rows
    }

    fn of(&self, samples: &[f64], events: impl Iterator<Item = f64>) -> Vec<f64> {
        let mean = |(from, to): &(usize, usize)| samples[*from..*to].iter().sum::<f64>() / (to - from) as f64;
        self.blocks.iter().map(mean).chain(self.ruptures.iter().zip(events).map(|(f, u)| f * u)).collect()
    }
}

/// Where the search begins too, with the largest recorded force as the limit of a saturation and the
/// library's own step of a quantisation. Single outliers are no term.
fn candidates(search: &Search, data: &Data, at: &Residuals) -> Vec<Start> {
    let model = &search.base.model;
    let spectrum = search.spectrum(&search.base, data);
    let span = |t: &Track| t.t.last().zip(t.t.first()).map_or(0.0, |(b, a)| b - a);
    let span_s = data.tracks.iter().map(span).fold(1e-3, f64::max);
    let limit = 6.0 * data.noise.marginal_n;
    let clipped: Vec<f64> = at.e.iter().map(|e| e.clamp(-limit, limit)).collect();
    let lines_hz = peaks(&spectrum.0, &spectrum.1, SLOWEST_HZ, LINES)
        .iter()
        .map(|p| sharpen(&data.tracks, &clipped, p.0, span_s))
        .collect();
    let coarse = data.blocks(search.q, data.noise.blocks(search.q));
    let look = Look::new(model, &coarse);
    let surface = model.assumed.surface_m;
    let deepest = data.tracks.iter().flat_map(|t| &t.z).fold(surface, |m, z| m.max(*z));
    let hints = Hints {
        lines_hz,
        breath_hz: (0..64).map(|k| 0.05 + 0.0125 * f64::from(k)).collect(),
        layers: model.assumed.layers.len(),
        depth_m: deepest - surface,
        drops_m: Vec::new(),
        membranes: look.as_ref().map_or(Vec::new(), |l| l.membranes(surface, deepest - surface)),
        force_n: search.force_n,
    };
    let (breathing, mut out): (Vec<Start>, Vec<Start>) =
        starts::all(&hints).into_iter().partition(|s| s.choice.info.id == "respiration");
    let mut work = Residuals::default();
    let mut gains: Vec<(f64, Start)> =
        breathing.into_iter().filter_map(|s| Some((look.as_ref()?.at(&s, &mut work)?.gain, s))).collect();
    gains.sort_by(|a, b| b.0.total_cmp(&a.0));
    out.extend(gains.into_iter().take(BREATHS).map(|g| g.1));
    for (id, value) in [("saturation", search.force_n), ("quantisation", f64::NAN)] {
        let Some(info) = stylet_tissue::info(id) else { continue };
        let value = if value.is_finite() { value } else { info.parameters[0].start };
        let choice = Choice::new(info, &[value]);
        out.push(Start { choice, lead_s: 0.0, lead_m: 0.0, quadrature: false });
    }
    out
}

#[cfg(test)]
mod tests {
    use super::Terms;
    use crate::fit::{dot, solve};
    use crate::hidden::{self, Kind};
    use crate::search::{Search, Settings};
    use crate::track::Track;
    use stylet_tissue::AnyEffect;

    /// Least squares on the base parameters' columns and those of the effect that is there finds its size,
    /// and leaves the noise.
    #[test]
    fn the_columns_of_the_hidden_effect_explain_the_residual() {
        for (id, truth) in [("coulomb_friction", 4.0), ("force_drift", 0.004), ("tool_inertia", 2.0)] {
            let mut drawn = hidden::sketch_of(5, 2, Kind::Clean, 2).drawn;
            drawn.effects.extend(AnyEffect::from_parameters(id, &[truth]));
            let case = hidden::case(&drawn);
            let tracks: Vec<Track> = case.recordings.iter().map(|r| Track::new(r, &[])).collect();
            let search = Search::base(&case.believed.tissue, 0.3, &[], tracks, 0.0, Settings::default())
                .expect("base fit");
            let terms = Terms::of(&search, 2).expect("terms");
            assert!(terms.columns.iter().all(|c| c.x.len() == terms.y.len()));
            let samples = terms.recording.iter().filter(|r| **r < case.recordings.len()).count();
            let chosen: Vec<_> = terms
                .columns
                .iter()
                .filter(|c| c.effect == id || c.effect.is_empty() && c.x[..samples].iter().any(|x| *x != 0.0))
                .collect();
            let x: Vec<&[f64]> = chosen.iter().map(|c| &c.x[..samples]).collect();
            let y = &terms.y[..samples];
            let gram: Vec<Vec<f64>> = x.iter().map(|a| x.iter().map(|b| dot(a, b)).collect()).collect();
            let right: Vec<f64> = x.iter().map(|a| dot(a, y)).collect();
            let found = solve(&gram, &right).expect("independent columns");
            let at = chosen.iter().position(|c| c.effect == id).expect("its column");
            let value = found[at] * chosen[at].values[0];
            assert!((value / truth - 1.0).abs() < 0.05, "{id}: {value} for {truth}");
            let left: f64 = (0..samples)
                .map(|i| y[i] - x.iter().zip(&found).map(|(c, k)| k * c[i]).sum::<f64>())
                .map(|e| e * e)
                .sum();
            let noise_n = search.data.noise.blocks(2).marginal_n;
            let rms = (left / samples as f64).sqrt();
            let before = (dot(y, y) / samples as f64).sqrt();
            let nats = samples as f64 * (before / rms).ln();
            assert!(nats > 100.0 && rms < 1.3 * noise_n, "{id}: {nats} nats, left {rms}, noise {noise_n}");
        }
    }
}
