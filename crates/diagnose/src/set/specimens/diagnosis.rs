//! What many indented specimens show, as a diagnosis.

use super::{Specimens, relaxing};
use crate::outcome::{Cause, Diagnosis, Estimate, Gain, LeftoverReport, NoiseReport, Quality, Verdict};
use crate::set::first::Insertion;
use stylet_tissue::{AnyEffect, Effect, PowerLawFriction, RateDependentPuncture, ShaftSlip};

impl Specimens {
    /// The effects of the rungs that are kept, each once.
    pub fn kept(&self) -> impl Iterator<Item = &str> {
        let mut seen: Vec<&str> = Vec::new();
        for effect in self.rungs.iter().filter(|r| r.kept).filter_map(|r| r.effect.as_deref()) {
            if !seen.contains(&effect) {
                seen.push(effect);
            }
        }
        seen.into_iter()
    }

    /// As a diagnosis.
    #[must_use]
    pub fn diagnosis(&self, runs: &[Insertion]) -> Diagnosis {
        let of = |effect: &str| {
            self.numbers
                .iter()
                .filter(|n| (effect == relaxing(&[]).info().id) == n.name.starts_with("terms."))
                .map(|n| (n.name.clone(), Estimate { value: n.mean, low: n.low, high: n.high }))
                .collect()
        };
        let causes: Vec<Cause> = self
            .kept()
            .map(|effect| Cause {
                share: 0.0,
                effect: effect.to_owned(),
                equivalent: Vec::new(),
                confidence: self
                    .rungs
                    .iter()
                    .filter(|r| r.kept && r.effect.as_deref() == Some(effect))
                    .map(|r| r.better)
                    .fold(0.0, f64::max),
                parameters: of(effect),
                gain_nats: 0.0,
            })
            .collect();
        let last = self.rungs.iter().rfind(|r| r.kept).map_or(0.0, |r| r.left_out_n);
        let noise = stylet_stats::median_of(runs.iter().map(Insertion::noise_n));
        Diagnosis {
            traces: Vec::new(),
            verdict: if causes.is_empty() { Verdict::None } else { Verdict::Named },
            causes,
            base_parameters: Vec::new(),
            invisible: unseen(),
            gain: Gain {
                held_out: true,
                recordings: runs.iter().map(|r| r.name.clone()).collect(),
                rmse_before_n: self.rungs.first().map_or(0.0, |r| r.left_out_n),
                rmse_after_n: last,
                floor_n: noise,
                each_n: Vec::new(),
            },
            leftover: LeftoverReport { p_value: 1.0, depends_on: Vec::new(), nats: 0.0, share: 0.0 },
            data_quality: runs
                .iter()
                .flat_map(|r| r.notes.iter().map(|n| Quality { recording: r.name.clone(), note: n.clone() }))
                .collect(),
            evidence: Vec::new(),
            noise: NoiseReport { sd_n: noise, ar: [0.0; 2], from_air: false },
            differences: Default::default(),
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
