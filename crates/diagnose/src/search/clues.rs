//! Where in the data to look: spectral lines, and what shows only in the few samples after a rupture.

use super::{Candidate, FAST_HZ, Search, choice, nats};
use crate::fit::{Data, Residuals, objective, residuals};
use crate::look::Look;
use crate::model::{Choice, Model};
use crate::refine::seed_punctures;
use crate::spectrum::{peaks, periodogram, sharpen};
use crate::starts::{self, Hints, Start};
use crate::track::Track;
use rayon::prelude::*;

impl Search {
    /// Where to look, by what the standing model leaves: its lines from the spectrum at full rate, as exactly as the
    /// averages tell them.
    pub(super) fn hints(&self, stood: &Model, spectrum: &(Vec<f64>, Vec<f64>), coarse: &Data) -> Hints {
        let layers = stood.assumed.layers.len();
        let surface = stood.assumed.surface_m;
        let deepest = coarse.tracks.iter().flat_map(|t| &t.z).fold(f64::NEG_INFINITY, |m, z| m.max(*z));
        let depth_m = (deepest - surface).max(0.0);
        let mut hints = Hints { layers, depth_m, force_n: self.force_n, ..Hints::default() };
        let mut lines: Vec<f64> = peaks(&spectrum.0, &spectrum.1, 0.04, 5)
            .into_iter()
            .map(|p| p.0)
            .filter(|f| *f <= FAST_HZ)
            .collect();
        self.sharpen(stood, coarse, &mut lines);
        hints.lines_hz = lines;
        hints.breath_hz = (0..64).map(|k| 0.05 + 0.0125 * f64::from(k)).collect();
        hints
    }

    /// Frequencies of peaks as exactly as all recordings together tell them.
    pub(super) fn sharpen(&self, of: &Model, data: &Data, lines_hz: &mut [f64]) {
        let mut r = Residuals::default();
        if lines_hz.is_empty() || !residuals(of, data, &mut r) {
            return;
        }
        let limit = 6.0 * data.noise.marginal_n;
        r.e.iter_mut().for_each(|e| *e = e.clamp(-limit, limit));
        let span = |t: &Track| t.t.last().zip(t.t.first()).map_or(0.0, |(b, a)| b - a);
        let span_s = data.tracks.iter().map(span).fold(1e-3, f64::max);
        lines_hz.par_iter_mut().for_each(|f| *f = sharpen(&data.tracks, &r.e, *f, span_s));
    }

    /// Periodogram of the whitened residuals, summed over the recordings.
    #[must_use]
    pub fn spectrum(&self, of: &Candidate, data: &Data) -> (Vec<f64>, Vec<f64>) {
        let mut r = Residuals::default();
        if !residuals(&of.model, data, &mut r) {
            return (Vec::new(), Vec::new());
        }
        let longest = data.tracks.iter().map(Track::len).max().unwrap_or(0);
        let mut parts: Vec<(&Track, &[f64])> = Vec::new();
        let mut from = 0;
        for track in data.tracks.iter() {
            parts.push((track, &r.w[from..from + track.len()]));
            from += track.len();
        }
        let each: Vec<(Vec<f64>, Vec<f64>)> = parts
            .into_par_iter()
            .map(|(track, w)| {
                let w: Vec<f64> = w.iter().map(|w| w.clamp(-6.0, 6.0)).collect();
                periodogram(&w, track.sample_hz, longest)
            })
            .collect();
        let mut each = each.into_iter();
        let mut sum = each.next().unwrap_or_default();
        for (_, p) in each {
            sum.1.iter_mut().zip(p).for_each(|(s, p)| *s += p);
        }
        sum
    }

    /// Effects that show in the few samples after a rupture, which averages blur: a look at full rate. Springs are
    /// looked at on averages, when so many nats of theirs are worth a fit.
    pub(super) fn sharp(
        &self,
        standing: &Candidate,
        data: &Data,
        coarse: &Data,
        springs: Option<f64>,
    ) -> Vec<Choice> {
        const TRIED: [(&str, &[f64]); 4] = [
            ("low_pass_lag", &[3e-4, 1e-3, 3e-3, 1e-2]),
            ("time_delay", &[3e-4, 1e-3, 3e-3]),
            ("soft_boundary", &[1e-5, 5e-5, 2e-4]),
            ("needle_compliance", &[150.0, 500.0, 1500.0, 5000.0, 15e3, 50e3, 150e3]),
        ];
        let taken = standing.model.names();
        let stood = nats(&standing.model, data);
        let tried: Vec<(&'static str, f64)> = TRIED
            .iter()
            .filter(|(id, _)| !taken.contains(id) && (springs.is_some() || *id != "needle_compliance"))
            .flat_map(|(id, values)| values.iter().map(|v| (*id, *v)))
            .collect();
        let found: Vec<Option<(f64, &'static str, f64)>> = tried
            .par_iter()
            .map(|&(id, value)| {
                let mut model = standing.model.with(choice(id, &[value])?);
                if id == "needle_compliance" {
                    let at = seed_punctures(&mut model, coarse)?;
                    return Some((objective(&model, &at), id, value));
                }
                if id == "soft_boundary" {
                    // What a narrow boundary does lies within a sample of the rupture.
                    let mut there = data.clone();
                    crate::refine::retime(&model, &mut there, false, true);
                    return Some((nats(&model, &there), id, value));
                }
                Some((nats(&model, data), id, value))
            })
            .collect();
        let mut best: Vec<(f64, &'static str, f64)> = Vec::new();
        for f in found.into_iter().flatten() {
            match best.iter_mut().find(|b| b.1 == f.1) {
                Some(b) if f.0 < b.0 => *b = f,
                Some(_) => {}
                None => best.push(f),
            }
        }
        best.retain(|b| match (b.1, springs) {
            ("needle_compliance", Some(most)) => b.0 < most,
            _ => b.0 < stood - 3.0,
        });
        best.iter().filter_map(|b| choice(b.1, &[b.2])).collect()
    }

    /// Interferences too fast for averages.
    pub(super) fn fast_lines(
        &self,
        standing: &Candidate,
        data: &Data,
        (f, p): &(Vec<f64>, Vec<f64>),
    ) -> Vec<Start> {
        // Not beside a line that stands already.
        let near = |hz: f64| {
            let lines = standing.model.effects.iter().filter(|e| e.info.id == "periodic_interference");
            lines.map(|e| e.values[1]).any(|own| (own - hz).abs() < 0.2)
        };
        let mut lines = peaks(f, p, FAST_HZ, 9);
        lines.retain(|l| !near(l.0));
        let Some(&(frequency, value)) = lines.first() else { return Vec::new() };
        if value < 14.0 {
            return Vec::new();
        }
        let mut frequency = [frequency];
        self.sharpen(&standing.model, data, &mut frequency);
        let hints = Hints { lines_hz: frequency.to_vec(), ..Hints::default() };
        let Some(info) = stylet_tissue::info("periodic_interference") else { return Vec::new() };
        let Some(look) = Look::new(&standing.model, data) else { return Vec::new() };
        let mut work = Residuals::default();
        starts::of(info, &hints).iter().filter_map(|s| look.at(s, &mut work)).map(|s| s.start).collect()
    }
}
