//! Selection of samples for the report of a recording that is too long to draw.

use stylet_core::Output;
use stylet_record::Sample;
use stylet_report::insertion_report::RunReport;
use stylet_report::significant;

/// Largest number of samples in a report.
const MAX_SAMPLES: usize = 20_000;
/// Largest number of ruptures and layers that it lists.
const MAX_LISTED: usize = 1000;

/// A sample and the output of each run.
#[derive(Clone, Debug)]
pub(super) struct PlotSample {
    pub index: usize,
    pub sample: Sample,
    pub outs: Vec<Output>,
}

/// Selects all samples of a short recording; of a long one, from each of many sections of equal length, the first sample and
/// those with the extremes of each curve.
pub(super) struct PlotSampler {
    samples: usize,
    sections: usize,
    section: usize,
    end: usize,
    /// Samples with the smallest and largest value of each curve in this section.
    extremes: Vec<[Option<(f64, PlotSample)>; 2]>,
    selected: Vec<PlotSample>,
}

impl PlotSampler {
    /// Creates a sampler for a recording of this length and this number of runs.
    pub fn new(samples: usize, runs: usize) -> Self {
        let (curves, sections) = (curve_count(runs), section_count(samples, runs));
        Self {
            samples,
            sections,
            section: 0,
            end: 0,
            extremes: vec![[None, None]; curves],
            selected: Vec::new(),
        }
    }

    /// Adds the next sample.
    pub fn add(&mut self, index: usize, sample: &Sample, outs: &[Output]) {
        let plot_sample = || PlotSample { index, sample: *sample, outs: outs.to_vec() };
        if index >= self.end {
            self.close();
            self.section += 1;
            self.end = (self.section as u128 * self.samples as u128 / self.sections as u128) as usize;
            self.selected.push(plot_sample());
        }
        if self.sections == self.samples {
            return;
        }
        for (value, [low, high]) in curves(sample, outs).zip(&mut self.extremes) {
            if low.as_ref().is_none_or(|(least, _)| value < *least) {
                *low = Some((value, plot_sample()));
            }
            if high.as_ref().is_none_or(|(most, _)| value > *most) {
                *high = Some((value, plot_sample()));
            }
        }
    }

    fn close(&mut self) {
        let from = self.selected.len().saturating_sub(1);
        let found =
            self.extremes.iter_mut().flatten().filter_map(Option::take).map(|(_, plot_sample)| plot_sample);
        self.selected.extend(found);
        self.selected[from..].sort_by_key(|plot_sample| plot_sample.index);
        self.selected.dedup_by_key(|plot_sample| plot_sample.index);
    }

    /// The selected samples, ordered by time.
    pub fn finish(mut self) -> Vec<PlotSample> {
        self.close();
        self.selected
    }
}

/// Curves whose extremes are selected.
fn curves(sample: &Sample, outs: &[Output]) -> impl Iterator<Item = f64> {
    [sample.force_n, sample.position_m].into_iter().chain(outs.iter().flat_map(run_curves))
}

fn run_curves(out: &Output) -> [f64; 3] {
    [out.enhanced_n, out.reconstructed_n, out.cusum_n2]
}

/// Number of curves: force, position, and those of each run.
fn curve_count(runs: usize) -> usize {
    2 + runs * run_curves(&Output::default()).len()
}

/// Number of sections; as many as samples when all are selected.
fn section_count(samples: usize, runs: usize) -> usize {
    if samples <= MAX_SAMPLES { samples.max(1) } else { MAX_SAMPLES / (2 * curve_count(runs) + 1) }
}

/// A note that the report shows a selection.
pub(super) fn selection_note(samples: usize, shown: usize, runs: usize) -> String {
    format!(
        "{samples} samples are more than a page can draw: it shows {shown} of them, among them the extremes of force, position, enhanced and \
         reconstructed force and CUSUM in every {} samples; enhanced.csv has all. States between them are not shown.",
        significant((samples as f64 / section_count(samples, runs) as f64).ceil(), 2)
    )
}

/// Truncates long lists of the report, with a note.
pub(super) fn truncate_lists(page: &mut RunReport) {
    let most = page.combinations.iter().map(|c| c.detections.len().max(c.layers.len())).max().unwrap_or(0);
    if most <= MAX_LISTED {
        return;
    }
    for combination in &mut page.combinations {
        combination.detections.truncate(MAX_LISTED);
        combination.compensations_s.truncate(MAX_LISTED);
        combination.layers.truncate(MAX_LISTED);
    }
    page.notes.push(format!(
        "The page lists the first {MAX_LISTED} ruptures and layers of up to {most}; events.json and enhance.json have all."
    ));
}
