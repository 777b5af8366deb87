//! Converts the analysis of many indented specimens to a diagnosis.

use super::SpecimenReport;
use crate::claims::{self, Context};
use crate::diagnosis_json::{
    Cause, DataQualityNote, Diagnosis, Estimate, Gain, NoiseReport, ResidualStructureReport, Verdict,
};
use crate::repeated_insertions::segmented_recording::SegmentedRecording;
use stylet_record::QualityNote;
use stylet_tissue::{PowerLawFriction, RateDependentPuncture, ShaftSlip, StressRelaxation};

impl SpecimenReport {
    /// Effects of the kept candidates, without repetition.
    pub fn kept_effects(&self) -> impl Iterator<Item = &str> {
        let mut ids: Vec<&str> = Vec::new();
        for effect in self.candidates.iter().filter(|r| r.kept).filter_map(|r| r.effect.as_deref()) {
            if !ids.contains(&effect) {
                ids.push(effect);
            }
        }
        ids.into_iter()
    }

    /// Converts to a diagnosis.
    #[must_use]
    pub fn diagnosis(&self, recordings: &[SegmentedRecording]) -> Diagnosis {
        let of = |effect: &str| {
            self.parameters
                .iter()
                .filter(|n| (effect == StressRelaxation::ID) == n.name.starts_with("terms."))
                .map(|n| (n.name.clone(), Estimate { value: n.mean, low: n.low, high: n.high }))
                .collect()
        };
        let causes: Vec<Cause> = self
            .kept_effects()
            .map(|effect| Cause {
                effect: effect.to_owned(),
                confidence: self
                    .candidates
                    .iter()
                    .filter(|r| r.kept && r.effect.as_deref() == Some(effect))
                    .map(|r| r.improved_share)
                    .fold(0.0, f64::max),
                parameters: of(effect),
                ..Cause::default()
            })
            .collect();
        let noise = stylet_stats::median_of(recordings.iter().map(SegmentedRecording::noise_n));
        let note = |(r, note): (&SegmentedRecording, &QualityNote)| DataQualityNote {
            recording: r.name.clone(),
            note: note.clone(),
        };
        let mut diagnosis = Diagnosis {
            verdict: if causes.is_empty() { Verdict::None } else { Verdict::Named },
            causes,
            // Effects that need a retraction or a puncture.
            not_identifiable: [PowerLawFriction::ID, ShaftSlip::ID, RateDependentPuncture::ID]
                .map(str::to_owned)
                .to_vec(),
            gain: Gain {
                held_out: true,
                recordings: recordings.iter().map(|r| r.name.clone()).collect(),
                rmse_before_n: self.candidates.first().map_or(0.0, |r| r.held_out_n),
                rmse_after_n: self.candidates.iter().rfind(|r| r.kept).map_or(0.0, |r| r.held_out_n),
                floor_n: noise,
                ..Gain::default()
            },
            residual_structure: ResidualStructureReport { p_value: 1.0, ..Default::default() },
            data_quality: recordings
                .iter()
                .flat_map(|r| r.notes.iter().map(move |n| (r, n)))
                .map(note)
                .collect(),
            noise: NoiseReport { sd_n: noise, ..NoiseReport::default() },
            advice: vec![
                "The recordings contain neither a retraction nor a puncture: friction and puncture are not \
                identifiable."
                    .to_owned(),
            ],
            ..Diagnosis::default()
        };
        claims::apply(&mut diagnosis, &Context::default());
        diagnosis
    }
}
