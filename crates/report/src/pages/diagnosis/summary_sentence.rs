//! A diagnosis in one sentence.

use stylet_diagnose::diagnosis_json::{Cause, Diagnosis, Verdict};
use stylet_record::QualityKind;
use stylet_stats::number_format::significant;

/// The verdict in one sentence, with the recordings that are outliers.
#[must_use]
pub fn summary_sentence(d: &Diagnosis) -> String {
    let outliers = outlier_recordings(d);
    let mut text = verdict(d, outliers.is_empty());
    if !outliers.is_empty() {
        let are = if outliers.len() == 1 { "is" } else { "are" };
        text += &format!(" But {} {are} not like the other recordings: see the note.", outliers.join(", "));
    }
    text
}

fn verdict(d: &Diagnosis, agrees: bool) -> String {
    let names = || d.causes.iter().map(|c| c.effect.as_str()).collect::<Vec<_>>().join(" and ");
    match d.verdict {
        Verdict::None if agrees => {
            "The simulation agrees with the data: no effect is needed beyond the base law.".to_owned()
        }
        Verdict::None => "No effect is needed beyond the base law.".to_owned(),
        Verdict::Named => format!("The simulation lacks {}.", names()),
        Verdict::Ambiguous => {
            let class = |c: &Cause| {
                std::iter::once(c.effect.as_str())
                    .chain(c.equivalent.iter().map(String::as_str))
                    .collect::<Vec<_>>()
                    .join(" or ")
            };
            format!(
                "The simulation lacks {}: these recordings cannot tell them apart.",
                d.causes.iter().map(class).collect::<Vec<_>>().join(", and ")
            )
        }
        Verdict::Unknown => {
            let on = if d.residual_structure.depends_on.is_empty() {
                String::new()
            } else {
                format!(" (it depends on {})", d.residual_structure.depends_on.join(", "))
            };
            format!("The data hold structure that no effect of the library explains{on}.")
        }
    }
}

/// Recordings whose force is unlike that of the others.
fn outlier_recordings(d: &Diagnosis) -> Vec<&str> {
    let all = d.data_quality.iter().filter(|q| q.note.kind == QualityKind::OutlierRecording);
    all.map(|q| q.recording.as_str()).collect()
}

/// Random effects between insertions that limit the prediction of a new one; `None` when all are negligible.
#[must_use]
pub fn recording_differences(d: &Diagnosis) -> Option<String> {
    let x = &d.random_effect_sd;
    let mut what = Vec::new();
    let percent = |share: f64| significant(100.0 * share, 2);
    let millimetres = |m: f64| significant(1e3 * m, 2);
    if x.puncture >= 0.01 {
        what.push(format!("puncture forces by {} %", percent(x.puncture)));
    }
    if x.rupture_depth_m >= 1e-4 {
        what.push(format!("places at which layers give way by {} mm", millimetres(x.rupture_depth_m)));
    }
    if x.surface_m >= 1e-4 {
        what.push(format!("the surface by {} mm", millimetres(x.surface_m)));
    }
    if x.friction >= 0.01 {
        what.push(format!("friction by {} %", percent(x.friction)));
    }
    let differ = format!("from insertion to insertion differ (one standard deviation): {}", what.join(", "));
    (!what.is_empty()).then_some(differ)
}
