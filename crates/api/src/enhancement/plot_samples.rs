//! What the report shows of a recording that is longer than it can draw.

use stylet_core::Output;
use stylet_record::Sample;
use stylet_report::insertion_report::RunReport;
use stylet_report::significant;

/// Samples that a report draws.
const SHOWN: usize = 20_000;
/// Ruptures, layers and other events that it lists.
const LISTED: usize = 1000;

/// A sample and what each model made of it.
#[derive(Clone, Debug)]
pub(super) struct PlotSample {
    pub index: usize,
    pub sample: Sample,
    pub outs: Vec<Output>,
}

/// Samples for the report: all of a short recording, of a long one, from each of many stretches of equal length, the first and those where
/// a curve has its extremes.
pub(super) struct PlotSampler {
    samples: usize,
    stretches: usize,
    stretch: usize,
    end: usize,
    /// Smallest and largest value of each curve in this stretch, and where.
    extremes: Vec<[Option<(f64, PlotSample)>; 2]>,
    shown: Vec<PlotSample>,
}

impl PlotSampler {
    /// For a recording of so many samples heard by so many models.
    pub fn new(samples: usize, models: usize) -> Self {
        let (curves, stretches) = (curves_of(models), stretches(samples, models));
        Self {
            samples,
            stretches,
            stretch: 0,
            end: 0,
            extremes: vec![[None, None]; curves],
            shown: Vec::new(),
        }
    }

    /// The next sample.
    pub fn add(&mut self, index: usize, sample: &Sample, outs: &[Output]) {
        let moment = || PlotSample { index, sample: *sample, outs: outs.to_vec() };
        if index >= self.end {
            self.close();
            self.stretch += 1;
            self.end = (self.stretch as u128 * self.samples as u128 / self.stretches as u128) as usize;
            self.shown.push(moment());
        }
        if self.stretches == self.samples {
            return;
        }
        for (value, [low, high]) in curves(sample, outs).zip(&mut self.extremes) {
            if low.as_ref().is_none_or(|(least, _)| value < *least) {
                *low = Some((value, moment()));
            }
            if high.as_ref().is_none_or(|(most, _)| value > *most) {
                *high = Some((value, moment()));
            }
        }
    }

    fn close(&mut self) {
        let from = self.shown.len().saturating_sub(1);
        let found = self.extremes.iter_mut().flatten().filter_map(Option::take).map(|(_, moment)| moment);
        self.shown.extend(found);
        self.shown[from..].sort_by_key(|moment| moment.index);
        self.shown.dedup_by_key(|moment| moment.index);
    }

    /// The samples to show, in the order of time.
    pub fn finish(mut self) -> Vec<PlotSample> {
        self.close();
        self.shown
    }
}

/// The curves whose extremes must be seen.
fn curves(sample: &Sample, outs: &[Output]) -> impl Iterator<Item = f64> {
    [sample.force_n, sample.position_m].into_iter().chain(outs.iter().flat_map(of_model))
}

fn of_model(out: &Output) -> [f64; 3] {
    [out.enhanced_n, out.reconstructed_n, out.cusum_n2]
}

/// Curves whose extremes are kept: force, position, and those of each model.
fn curves_of(models: usize) -> usize {
    2 + models * of_model(&Output::default()).len()
}

/// Stretches of which the first sample and those with the extremes are shown; as many as samples when all are.
fn stretches(samples: usize, models: usize) -> usize {
    if samples <= SHOWN { samples.max(1) } else { SHOWN / (2 * curves_of(models) + 1) }
}

/// That it is a selection.
pub(super) fn selection_note(samples: usize, shown: usize, models: usize) -> String {
    format!(
        "{samples} samples are more than a page can draw: it shows {shown} of them, among them the extremes of force, position, enhanced and \
         reconstructed force and CUSUM in every {} samples; enhanced.csv has all. States between them are not shown.",
        significant((samples as f64 / stretches(samples, models) as f64).ceil(), 2)
    )
}

/// Lists on the page that are too long to be read end early, and say so.
pub(super) fn truncate_lists(page: &mut RunReport) {
    let most = page.combinations.iter().map(|c| c.detections.len().max(c.layers.len())).max().unwrap_or(0);
    if most <= LISTED {
        return;
    }
    for combination in &mut page.combinations {
        combination.detections.truncate(LISTED);
        combination.compensations_s.truncate(LISTED);
        combination.layers.truncate(LISTED);
    }
    page.notes.push(format!(
        "The page lists the first {LISTED} ruptures and layers of up to {most}; events.json and enhance.json have all."
    ));
}
