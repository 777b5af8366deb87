//! A diagnosis in one sentence.

use stylet_diagnose::claims::{contradicts, parameter_name};
use stylet_diagnose::diagnosis_json::{
    BaseParameter, Cause, Diagnosis, Finding, FindingKind, SearchStep, Verdict,
};
use stylet_record::QualityKind;
use stylet_stats::number_format::significant;
use stylet_tissue::known_effect_info;

/// The verdict in one sentence, with the recordings that are outliers.
#[must_use]
pub fn summary_sentence(d: &Diagnosis) -> String {
    let outliers = outlier_recordings(d);
    let mut text = verdict(d);
    if !outliers.is_empty() {
        let are = if outliers.len() == 1 { "is" } else { "are" };
        text += &format!(" But {} {are} not like the other recordings: see the note.", outliers.join(", "));
    }
    text
}

/// The findings that contradict agreement or limit the confidence, one sentence each.
#[must_use]
pub fn findings(d: &Diagnosis) -> Vec<String> {
    d.findings.iter().filter(|f| f.kind != FindingKind::OutlierRecording).map(|f| f.message.clone()).collect()
}

/// Share explained by the best model in the presence of an unmodelled force.
#[must_use]
pub fn partial_model(d: &Diagnosis) -> Option<String> {
    let p = d.partial.as_ref()?;
    Some(format!(
        "the best partial model, with {}, removes {} % of the misfit; extended.ron holds it",
        p.effects.join(", "),
        significant(100.0 * p.share, 2)
    ))
}

/// The first formula to try for an unexplained residual, or else the variable that carries it, in words.
#[must_use]
pub fn proposed_formula(d: &Diagnosis) -> Option<String> {
    let formulas = d.formulas.as_ref()?;
    let Some(p) = formulas.proposals.first() else {
        let variable = &formulas.variables.first()?.variable;
        return Some(format!(
            "the residual depends most on {variable}; no simple formula predicts held-out recordings better"
        ));
    };
    Some(format!(
        "a function of {} to try as a custom effect: {} ({} N on held-out recordings; --effects proposed_effects.ron)",
        p.variable,
        p.formula,
        significant(p.held_out_n, 3)
    ))
}

/// Why custom effects among the candidates are not causes, in words.
#[must_use]
pub fn unneeded_custom_effects(d: &Diagnosis) -> Vec<String> {
    let tested = d.visible_effects.iter().map(|e| &e.effect).chain(&d.not_identifiable);
    let custom = |id: &str| known_effect_info(id).is_some_and(|info| info.custom.is_some());
    let unneeded = tested.filter(|id| custom(id) && d.causes.iter().all(|c| c.effect != **id));
    let sentence = |id: &String| {
        let of_step = |s: &SearchStep, name: &str| {
            s.candidates.iter().find(|c| c.effect == name).map(|c| (c.gain_nats, c.parameters))
        };
        let fitted = d.search_steps.iter().find_map(|s| {
            let (nats, parameters) = of_step(s, id)?;
            let selected = s.selected.as_deref()?;
            let (selected_nats, selected_parameters) = of_step(s, selected)?;
            Some(format!(
                "it gains {} nats with {parameters} parameters, {selected} {} with {selected_parameters}",
                significant(nats, 4),
                significant(selected_nats, 4)
            ))
        });
        format!(
            "{id} is not needed: {}",
            fitted.unwrap_or_else(|| "it gains too little to be selected".to_owned())
        )
    };
    unneeded.map(sentence).collect()
}

/// Effects that these recordings cannot separate from a simpler one that is named.
#[must_use]
pub fn general_forms(c: &Cause) -> Option<String> {
    (!c.general_forms.is_empty()).then(|| {
        format!(
            "{} or {}: these recordings cannot separate them; the simpler one is kept, and the confidence is shared",
            c.effect,
            c.general_forms.join(" or ")
        )
    })
}

/// Puncture forces that no recording reached, in words.
#[must_use]
pub fn lower_limits(d: &Diagnosis) -> Vec<String> {
    let limits = d.base_parameters.iter().filter(|b| b.at_least);
    limits.map(|b| format!("{}: {}, never reached", parameter_name(b), lower_limit(b))).collect()
}

/// A parameter that is only bounded from below.
pub(super) fn lower_limit(b: &BaseParameter) -> String {
    format!("at least {} N", significant(b.low, 3))
}

/// The sentence of the verdict `parameters`.
pub(crate) fn wrong_numbers(d: &Diagnosis) -> String {
    let is_off = |f: &&Finding| matches!(f.kind, FindingKind::OutOfTolerance | FindingKind::LayerCount);
    let off: Vec<&str> = d.findings.iter().filter(is_off).map(|f| f.message.as_str()).collect();
    format!("No effect of the library is missing, but numbers of the scenario are wrong: {}.", off.join("; "))
}

fn verdict(d: &Diagnosis) -> String {
    let names = || d.causes.iter().map(|c| c.effect.as_str()).collect::<Vec<_>>().join(" and ");
    match d.verdict {
        Verdict::None if d.agrees => {
            "The simulation agrees with the data: no effect is needed beyond the base law.".to_owned()
        }
        Verdict::None => {
            let first =
                d.findings.iter().find(|f| contradicts(f.kind) && f.kind != FindingKind::OutlierRecording);
            let but = first.map_or_else(String::new, |f| format!(", but {}", f.message));
            format!("No effect of the library is needed beyond the base law{but}.")
        }
        Verdict::Parameters => wrong_numbers(d),
        Verdict::Named => format!("The simulation lacks {}.", names()),
        Verdict::Ambiguous => {
            let class = |c: &Cause| {
                std::iter::once(c.effect.as_str())
                    .chain(c.equivalent.iter().map(String::as_str))
                    .collect::<Vec<_>>()
                    .join(" or ")
            };
            format!(
                "The simulation lacks {}: these recordings cannot separate them.",
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

/// Recordings whose force is an outlier among the others.
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
