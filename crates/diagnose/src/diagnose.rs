//! The diagnosis from end to end.

use crate::error::DiagnoseError;
use crate::held_out;
use crate::leftover;
use crate::model::{Model, Role, base_value, in_logarithm};
use crate::outcome::*;
use crate::profile;
use crate::raw;
use crate::refine::covariance_diagonal;
use crate::search::{Candidate, Search, Settings};
use crate::track::Track;
use crate::visible;
use std::collections::BTreeMap;
use stylet_record::{QualityNote, Recording, assess};
use stylet_scenario::Scenario;
use stylet_tissue::AnyEffect;

/// One recording with its name.
#[derive(Clone, Debug)]
pub struct Evidence {
    /// Name, such as the file's.
    pub name: String,
    /// The recording.
    pub recording: Recording,
    /// Remarks of the reader beyond [`assess`].
    pub notes: Vec<QualityNote>,
}

/// Settings of a diagnosis.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// The search's.
    pub search: Settings,
    /// Without intervals, held-out gain and invisibles: for calibrating.
    pub brief: bool,
}

/// The diagnosis with what the report draws.
pub struct Examined {
    /// What is said.
    pub diagnosis: Diagnosis,
    /// The scenario with re-fitted parameters and the effects added.
    pub extended: Scenario,
    /// The search.
    pub search: Search,
}

/// Rivals within so many nats of the best form one class.
pub const CLASS_NATS: f64 = 3.0;
/// Leftover structure counts from this p-value on: the noise's colour in air is known to a few hundred samples, so
/// that clean data with strongly coloured noise reach 1e-5 now and then.
pub const LEFTOVER_P: f64 = 1e-6;
/// ... and dominates when it is more than this share of what the causes explain.
pub const DOMINATES: f64 = 0.05;
/// What remains is more than noise when its variance is so many times that in air ...
const EXCESS: f64 = 2.0;
/// ... and dominates when it is more than this share of what the base law leaves beyond the noise.
const UNEXPLAINED: f64 = 0.25;
/// Intervals are widened by this factor (calibrated: `stylet benchmark diagnose`).
const WIDEN: f64 = 1.15;

/// Compares what a scenario believes with what was measured.
///
/// # Errors
/// [`DiagnoseError`] when the recordings do not fit the scenario.
pub fn diagnose(
    scenario: &Scenario,
    evidence: &[Evidence],
    options: &Options,
    mut progress: impl FnMut(&str),
) -> Result<Examined, DiagnoseError> {
    crate::check::check(scenario, evidence)?;
    let mut notes: Vec<Vec<QualityNote>> = Vec::new();
    for e in evidence {
        let mut own = e.notes.clone();
        own.extend(crate::check::holes(&e.recording));
        for note in assess(&e.recording) {
            if !own.contains(&note) {
                own.push(note);
            }
        }
        notes.push(own);
    }
    let recordings: Vec<&Recording> = evidence.iter().map(|e| &e.recording).collect();
    let raw = raw::look(&recordings, &notes);
    let tracks: Vec<Track> = recordings.iter().zip(&raw.exclude).map(|(r, x)| Track::new(r, x)).collect();
    progress("fitting the base law");
    let mut search = Search::base(
        &scenario.tissue,
        scenario.tolerance,
        &scenario.effects,
        tracks,
        raw.step_n.unwrap_or(0.0),
        options.search,
    )
    .ok_or(DiagnoseError::NoFit)?;
    search.run(&mut progress);
    progress("judging");
    let mut told = Vec::new();
    if !options.brief {
        (search.best, told) = profile::settled(&search, &search.best);
    }
    let best = search.best.clone();
    let data = search.data_of(&best);
    // By the noise in air: that of the model's own residual takes structure for colour.
    let in_air = crate::fit::Data { noise: search.air.unwrap_or(data.noise), ..data.clone() };
    let left = leftover::test(&best.model, &in_air);
    let explained = search.base.nats - best.nats;
    let dominated =
        left.p_value < LEFTOVER_P && left.nats > DOMINATES * explained.max(0.0) && left.nats > 8.0;
    let dominated = dominated || excess(&search, &in_air);

    // A step of the recorded force beyond the noise makes the residual a function of the motion by itself.
    let coarse_steps = search.data.dead_n > 0.0;
    let dominated = dominated && !coarse_steps;

    let mut causes = Vec::new();
    let mut spread = if options.brief { None } else { covariance_diagonal(&best.model, &data) };
    for number in spread.iter_mut().flatten() {
        if let Some((_, sd)) = told.iter().find(|t| t.0 == number.0) {
            number.2 = sd.max(number.2);
        }
    }
    for index in 0..best.model.effects.len() {
        causes.push(cause(&search, &best, index, spread.as_deref()));
    }
    causes.sort_by(|a: &Cause, b| b.gain_nats.total_cmp(&a.gain_nats));
    let noise = search.data.noise;
    let mut from_raw = raw_causes(&raw, noise.marginal_n);
    let verdict = if dominated {
        Verdict::Unknown
    } else if causes.iter().any(|c: &Cause| c.equivalent.iter().any(|e| !nests(e, &c.effect))) {
        Verdict::Ambiguous
    } else if causes.is_empty() && from_raw.is_empty() {
        Verdict::None
    } else {
        Verdict::Named
    };
    let shown = if dominated { search.base.clone() } else { best.clone() };
    if dominated {
        causes.clear();
    }
    causes.append(&mut from_raw);
    let verdict = if verdict == Verdict::Unknown {
        causes.clear();
        verdict
    } else {
        verdict
    };
    let names: Vec<String> = evidence.iter().map(|e| e.name.clone()).collect();
    let gain = if options.brief {
        Gain {
            held_out: false,
            recordings: names,
            rmse_before_n: 0.0,
            rmse_after_n: 0.0,
            floor_n: noise.marginal_n,
            each_n: Vec::new(),
        }
    } else {
        progress("leaving one recording out");
        gain(&search, &shown, &raw, names)
    };
    let invisible = if options.brief { Vec::new() } else { visible::invisible(&search, &shown) };
    let advice = visible::advice(&causes, &invisible);
    let base_parameters = base_parameters(&shown, &search);
    let evidence_trace = search.stages.iter().map(step).collect();
    let mut data_quality = Vec::new();
    for (e, notes) in evidence.iter().zip(notes) {
        data_quality.extend(notes.into_iter().map(|note| Quality { recording: e.name.clone(), note }));
    }
    let extended = extended(scenario, &shown, &causes);
    let diagnosis = Diagnosis {
        verdict,
        causes,
        base_parameters,
        invisible,
        gain,
        leftover: LeftoverReport {
            p_value: left.p_value,
            depends_on: left.depends_on.iter().map(|d| d.0.clone()).collect(),
            nats: left.nats,
        },
        data_quality,
        evidence: evidence_trace,
        noise: NoiseReport { sd_n: noise.marginal_n, ar: noise.a, from_air: search.air.is_some() },
        advice,
    };
    Ok(Examined { diagnosis, extended, search })
}

/// Whether the best model leaves far more than the noise in air, and more than a share of what the base law
/// left beyond it.
fn excess(search: &Search, in_air: &crate::fit::Data) -> bool {
    let Some(air) = search.air else { return false };
    let floor = air.marginal_n * air.marginal_n;
    let variance = |c: &Candidate| {
        let mut r = crate::fit::Residuals::default();
        let data = crate::fit::Data { ruptures: c.ruptures.clone(), ..in_air.clone() };
        crate::fit::residuals(&c.model, &data, &mut r).then(|| {
            // Outlying samples are nobody's cause.
            let limit = 50.0 * floor;
            let used = data.tracks.iter().flat_map(|t| &t.used);
            let (sum, n) =
                r.e.iter()
                    .zip(used)
                    .filter(|(_, u)| **u)
                    .fold((0.0, 0.0), |(s, n), (e, _)| (s + (e * e).min(limit), n + 1.0));
            sum / f64::max(n, 1.0)
        })
    };
    let (Some(after), Some(before)) = (variance(&search.best), variance(&search.base)) else { return false };
    after > EXCESS * floor && after - floor > UNEXPLAINED * (before - floor)
}

fn step(stage: &crate::search::Stage) -> EvidenceStep {
    let mut rivals: Vec<Rival> = stage
        .rivals
        .iter()
        .map(|(name, gain, numbers)| Rival {
            effect: (*name).to_owned(),
            gain_nats: *gain,
            parameters: *numbers,
            screened_only: false,
        })
        .collect();
    for (name, gain) in &stage.screened {
        if !rivals.iter().any(|r| r.effect == *name) {
            let parameters = stylet_tissue::info(name).map_or(0, |i| i.parameters.len());
            rivals.push(Rival {
                effect: (*name).to_owned(),
                gain_nats: *gain,
                parameters,
                screened_only: true,
            });
        }
    }
    EvidenceStep {
        standing: stage.stood.iter().map(|s| (*s).to_owned()).collect(),
        rivals,
        needed_nats: stage.needed,
        taken: stage.taken.map(str::to_owned),
    }
}

/// A cause with its class, confidence and intervals.
fn cause(search: &Search, best: &Candidate, index: usize, spread: Option<&[(Role, f64, f64)]>) -> Cause {
    let choice = &best.model.effects[index];
    // Rivals that stand on the same other effects.
    let others = &best.model.names()[..best.model.effects.len() - 1];
    let last = index + 1 == best.model.effects.len()
        && search.rivals.first().is_some_and(|r| {
            r.model.names().starts_with(others) && r.model.effects.len() == others.len() + 1
        });
    let own = search.reference;
    let name_of = |c: &Candidate| c.model.last_name().to_owned();
    let mut weights = 0.0;
    let mut equivalent = Vec::new();
    let rivals: Vec<&Candidate> = if last {
        search.rivals.iter().filter(|r| name_of(r) != choice.info.id).collect()
    } else {
        Vec::new()
    };
    for rival in rivals {
        let behind = rival.fined() - own;
        // A larger model that holds the one named is no rival of it.
        if !nests(&name_of(rival), choice.info.id) {
            weights += (-behind.max(-3.0)).exp();
        }
        if behind < CLASS_NATS {
            equivalent.push(name_of(rival));
        }
    }
    let mut parameters = BTreeMap::new();
    for (k, p) in choice.info.parameters.iter().enumerate() {
        let value = choice.values[k];
        let role = Role::Effect { effect: index, parameter: k };
        let sd = spread.and_then(|s| s.iter().find(|x| x.0 == role)).map_or(f64::NAN, |x| x.2) * WIDEN * 1.96;
        let sd = if choice.info.id == "hidden_membrane" && k == 0 {
            membrane_depth_sd(choice, index, spread) * WIDEN * 1.96
        } else {
            sd
        };
        let (low, high) = if p.whole || !sd.is_finite() {
            (value, value)
        } else if in_logarithm(choice.info, k) {
            (value * (-sd).exp(), value * sd.exp())
        } else {
            (value - sd, value + sd)
        };
        parameters.insert(p.path.to_owned(), Estimate { value, low: low.max(p.low), high: high.min(p.high) });
    }
    let without = search
        .stages
        .iter()
        .filter(|s| s.taken == Some(choice.info.id))
        .filter_map(|s| s.rivals.iter().find(|r| r.0 == choice.info.id))
        .map(|r| r.1)
        .next_back();
    let gain_nats = without.unwrap_or(search.base.nats - best.nats);
    let alarm = (-(gain_nats - search.settings.needed(choice.info.id)).max(0.0)).exp() * 0.01;
    Cause {
        effect: choice.info.id.to_owned(),
        equivalent,
        confidence: (1.0 - alarm) / (1.0 + weights),
        parameters,
        gain_nats,
    }
}

/// Uncertainty in m of the depth at which a membrane begins: where it breaks is known to the travel of
/// one sample, the rest is its stretch `F_m/K_m` (their errors taken as independent, which is wide).
fn membrane_depth_sd(
    choice: &crate::model::Choice,
    index: usize,
    spread: Option<&[(Role, f64, f64)]>,
) -> f64 {
    const BREAK_SD_M: f64 = 5e-6;
    let relative = |parameter: usize| {
        let role = Role::Effect { effect: index, parameter };
        spread.and_then(|s| s.iter().find(|x| x.0 == role)).map_or(f64::NAN, |x| x.2)
    };
    let stretch_m = choice.values[2] / choice.values[1];
    libm::hypot(BREAK_SD_M, stretch_m * libm::hypot(relative(1), relative(2)))
}

/// Whether the larger effect holds the smaller one as a special case.
pub(crate) fn nests(larger: &str, smaller: &str) -> bool {
    matches!((larger, smaller), ("stribeck_friction" | "presliding_friction", "coulomb_friction"))
}

/// Causes that the raw numbers show.
fn raw_causes(raw: &raw::Raw, noise_n: f64) -> Vec<Cause> {
    let mut causes = Vec::new();
    let mut add = |effect: &str, numbers: &[(&str, f64, f64)]| {
        let parameters = numbers
            .iter()
            .map(|(path, value, sd)| {
                (
                    (*path).to_owned(),
                    Estimate { value: *value, low: (value - 1.96 * sd).max(0.0), high: value + 1.96 * sd },
                )
            })
            .collect();
        causes.push(Cause {
            effect: effect.to_owned(),
            equivalent: Vec::new(),
            confidence: 0.99,
            parameters,
            gain_nats: 0.0,
        });
    };
    if let Some(limit) = raw.limit_n {
        add("saturation", &[("limit_n", limit, 1e-6 * limit)]);
    }
    if let Some(step) = raw.step_n.filter(|s| *s > 0.3 * noise_n) {
        add("quantisation", &[("step_n", step, 1e-4 * step)]);
    }
    if let Some((count, size, seconds)) = raw.spikes {
        let rate = count as f64 / seconds.max(1e-9);
        add(
            "force_spikes",
            &[
                ("rate_hz", rate, rate / (count as f64).sqrt()),
                ("size_n", size, 1.5 * noise_n / (count as f64).sqrt()),
            ],
        );
    }
    causes
}

fn gain(search: &Search, shown: &Candidate, raw: &raw::Raw, names: Vec<String>) -> Gain {
    let mut shown = shown.clone();
    // What the raw numbers showed is simulated too.
    if let Some(limit_n) = raw.limit_n {
        shown.model.given.push(stylet_tissue::Saturation { limit_n }.into());
    }
    if let Some(step_n) = raw.step_n {
        shown.model.given.push(stylet_tissue::Quantisation { step_n }.into());
    }
    let each = held_out::gain(search, &search.base, &shown);
    let pooled = |pick: fn(&held_out::Before) -> f64| {
        let n: f64 = each.iter().map(|e| e.samples as f64).sum();
        (each.iter().map(|e| pick(e).powi(2) * e.samples as f64).sum::<f64>() / n.max(1.0)).sqrt()
    };
    Gain {
        held_out: names.len() > 1,
        recordings: names,
        rmse_before_n: pooled(|e| e.before_n),
        rmse_after_n: pooled(|e| e.after_n),
        floor_n: search.data.noise.marginal_n,
        each_n: each.iter().map(|e| (e.before_n, e.after_n)).collect(),
    }
}

fn base_parameters(shown: &Candidate, search: &Search) -> Vec<BaseParameter> {
    let spread = covariance_diagonal(&shown.model, &search.data_of(shown)).unwrap_or_default();
    const NAMES: [&str; 3] = ["stiffness_n_per_m", "friction_ns_per_m2", "puncture_n"];
    spread
        .iter()
        .filter_map(|(role, ratio, sd)| {
            let Role::Base { layer, what } = *role else { return None };
            let assumed = base_value(&shown.model.assumed, layer, what);
            let half = 1.96 * WIDEN * sd.min(shown.model.tolerance);
            Some(BaseParameter {
                layer: layer + 1,
                name: NAMES[what].to_owned(),
                assumed,
                value: assumed * ratio,
                low: assumed * (ratio - half),
                high: assumed * (ratio + half),
                changed: (ratio - 1.0).abs() > half,
                at_bound: (ratio - 1.0).abs() > 0.999 * shown.model.tolerance,
            })
        })
        .collect()
}

/// The scenario with the model's parameters and effects.
fn extended(scenario: &Scenario, shown: &Candidate, causes: &[Cause]) -> Scenario {
    let mut out = scenario.clone();
    out.tissue = rounded(&shown.model).tissue;
    out.effects.extend(rounded(&shown.model).effects.iter().filter_map(crate::model::Choice::effect));
    for cause in causes.iter().filter(|c| crate::starts::FROM_THE_RAW_DATA.contains(&c.effect.as_str())) {
        if let Some(info) = stylet_tissue::info(&cause.effect) {
            let values: Vec<f64> = info
                .parameters
                .iter()
                .map(|p| cause.parameters.get(p.path).map_or(p.start, |e| e.value))
                .collect();
            out.effects.extend(AnyEffect::from_parameters(info.id, &values));
        }
    }
    out
}

/// Numbers with nine significant digits.
fn rounded(model: &Model) -> Model {
    let nine = |x: f64| format!("{x:.9e}").parse().unwrap_or(x);
    let mut model = model.clone();
    for layer in &mut model.tissue.layers {
        layer.stiffness_n_per_m = nine(layer.stiffness_n_per_m);
        layer.friction_ns_per_m2 = nine(layer.friction_ns_per_m2);
        layer.puncture_n = layer.puncture_n.map(nine);
    }
    for effect in &mut model.effects {
        effect.values.iter_mut().for_each(|v| *v = nine(*v));
    }
    model
}
