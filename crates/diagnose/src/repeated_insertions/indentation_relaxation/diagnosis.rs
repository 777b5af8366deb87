//! What many indented specimens show, as a diagnosis.

use super::{SpecimenReport, relaxing};
use crate::diagnosis_json::{
    Cause, DataQualityNote, Diagnosis, Estimate, Gain, NoiseReport, ResidualStructureReport, Verdict,
};
use crate::repeated_insertions::start_values::SegmentedRecording;
use stylet_tissue::{AnyEffect, Effect, PowerLawFriction, RateDependentPuncture, ShaftSlip};

impl SpecimenReport {
    /// The effects of the rungs that are kept, each once.
    pub fn kept_effects(&self) -> impl Iterator<Item = &str> {
        let mut seen: Vec<&str> = Vec::new();
        for effect in self.candidates.iter().filter(|r| r.kept).filter_map(|r| r.effect.as_deref()) {
            if !seen.contains(&effect) {
                seen.push(effect);
            }
        }
        seen.into_iter()
    }

    /// As a diagnosis.
    #[must_use]
    pub fn diagnosis(&self, runs: &[SegmentedRecording]) -> Diagnosis {
        let of = |effect: &str| {
            self.parameters
                .iter()
                .filter(|n| (effect == relaxing(&[]).info().id) == n.name.starts_with("terms."))
                .map(|n| (n.name.clone(), Estimate { value: n.mean, low: n.low, high: n.high }))
                .collect()
        };
        let causes: Vec<Cause> = self
            .kept_effects()
            .map(|effect| Cause {
                share: 0.0,
                effect: effect.to_owned(),
                equivalent: Vec::new(),
                confidence: self
                    .candidates
                    .iter()
                    .filter(|r| r.kept && r.effect.as_deref() == Some(effect))
                    .map(|r| r.improved_share)
                    .fold(0.0, f64::max),
                parameters: of(effect),
                gain_nats: 0.0,
            })
            .collect();
        let last = self.candidates.iter().rfind(|r| r.kept).map_or(0.0, |r| r.held_out_n);
        let noise = stylet_stats::median_of(runs.iter().map(SegmentedRecording::noise_n));
        Diagnosis {
            negligible: Vec::new(),
            verdict: if causes.is_empty() { Verdict::None } else { Verdict::Named },
            causes,
            base_parameters: Vec::new(),
            not_identifiable: unseen(),
            gain: Gain {
                held_out: true,
                recordings: runs.iter().map(|r| r.name.clone()).collect(),
                rmse_before_n: self.candidates.first().map_or(0.0, |r| r.held_out_n),
                rmse_after_n: last,
                floor_n: noise,
                per_recording_n: Vec::new(),
            },
            residual_structure: ResidualStructureReport {
                p_value: 1.0,
                depends_on: Vec::new(),
                nats: 0.0,
                share: 0.0,
            },
            data_quality: runs
                .iter()
                .flat_map(|r| {
                    r.notes.iter().map(|n| DataQualityNote { recording: r.name.clone(), note: n.clone() })
                })
                .collect(),
            search_steps: Vec::new(),
            noise: NoiseReport { sd_n: noise, ar: [0.0; 2], from_air: false },
            random_effect_sd: Default::default(),
            advice: vec![
                "Nothing is retracted or punctured here: friction and puncture cannot be seen.".to_owned(),
            ],
        }
    }
}

/// Effects that nothing shows where nothing is retracted or punctured.
fn unseen() -> Vec<String> {
    let effects: [AnyEffect; 3] = [
        PowerLawFriction { exponent: 1.0 }.into(),
        ShaftSlip::default().into(),
        RateDependentPuncture { alpha: 0.0 }.into(),
    ];
    effects.iter().map(|e| e.info().id.to_owned()).collect()
}
