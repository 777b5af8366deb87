//! The diagnosis from end to end.

use crate::base_law_fit::{PreparedRecordings, fit_base_law, refit_with_random_effects};
use crate::competing_effects::{CompetingEffect, EQUIVALENCE_NATS, find_competing_effects};
use crate::confidence_intervals::{Covariance, release_unreached_punctures};
use crate::diagnosis_json::*;
use crate::effect_selection::Search;
use crate::error::DiagnoseError;
use crate::held_out::{
    FreeRunResidual, JackknifeResult, held_out_residuals, jackknife_effects, pooled_rms, sample_noise_sd_n,
};
use crate::identifiability;
use crate::negligible_effects::{self, Negligible};
use crate::random_effect_selection::select_random_effects;
use crate::residual_tests;
use crate::varying_coefficient_test::{FEATURES, VaryingCoefficient, varying_coefficient_test};
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rayon::prelude::*;
use std::cell::LazyCell;
use std::collections::BTreeMap;
use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::{Assumptions, ParameterRole};
use stylet_identify::noise::NoiseSource as NoiseFrom;
use stylet_identify::score_test::ScoreTest;
use stylet_record::sensor_artefacts;
use stylet_record::{QualityNote, Recording, assess};
use stylet_scenario::Scenario;
use stylet_stats::special_functions::chi_square_sf;
use stylet_tissue::{AnyEffect, EffectInfo};

/// One recording with its name.
#[derive(Clone, Debug)]
pub struct NamedRecording {
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
    /// Without held-out gain and invisibles.
    pub brief: bool,
}

/// The diagnosis with what the report draws.
pub struct DiagnosisResult {
    /// What is said.
    pub diagnosis: Diagnosis,
    /// The scenario with re-fitted parameters and the effects added.
    pub extended_scenario: Scenario,
    /// The search.
    pub search: Search,
    /// The rivals of every effect of the best model, in its order.
    pub competing_effects: Vec<Vec<CompetingEffect>>,
    /// The base law on every recording left out.
    pub base_held_out: Vec<Option<FreeRunResidual>>,
    /// The extended law on every recording left out.
    pub extended_held_out: Vec<Option<FreeRunResidual>>,
}

/// Leftover structure counts from this p-value on: cross-recording sums have longer tails than their skewness tells.
const LEFTOVER_P: f64 = 1e-6;
/// The unknown dominates when more than this share of what the base law leaves beyond the noise is still left.
const UNEXPLAINED: f64 = 0.1;
/// What is left counts when its variance is this share of the noise's.
const EXCESS: f64 = 0.8;
/// With one recording, where nothing tells structure from slow noise, it must be so many times the noise's.
const EXCESS_ALONE: f64 = 3.0;
/// Slow noise of more than two and a half times the fast one is none any more, whatever its colour.
const EXCESS_SLOW: f64 = 6.0;
/// An effect that would gain more than this share of what the effects explain by acting otherwise imitates something unknown, ...
const IMITATES: f64 = 0.02;
/// ... if that is so many nats: an effect by its own law gains half a nat by chance, and some tens where the motion is not known exactly.
const IMITATES_NATS: f64 = 100.0;
/// ... and so many by a noise that may be as slow as what is left.
const IMITATES_SLOW_NATS: f64 = 10.0;
/// Beside something unknown a cause stands when, where that is silent, its strengths are the same whichever recording is left out, to this
/// share, ...
const SAME: f64 = 0.1;
/// ... it pays, there and by all that was recorded, where it had been found, for so much of what is left of recordings left out, ...
const PAYS: f64 = 0.1;
/// ... it would gain no more than this share of what it explains by acting otherwise, ...
const OTHERWISE: f64 = 0.001;
/// ... and by all that was recorded no more than this, ...
const OTHERWISE_LOUD: f64 = 0.03;
/// ... or than this, where any force of its kind would be imitated.
const OTHERWISE_IMITATES: f64 = 0.0005;
/// Why an effect beside something unknown is a trace.
pub const REASON_IMITATES_UNMODELLED: &str = "what no effect of the library explains may imitate it";

/// What is drawn is the same for the same recordings.
const SEED: u64 = 1;

/// Compares what a scenario believes with what was measured.
///
/// # Errors
/// [`DiagnoseError`] when the recordings do not fit the scenario.
pub fn diagnose(
    scenario: &Scenario,
    evidence: &[NamedRecording],
    options: &Options,
    mut progress: impl FnMut(&str),
) -> Result<DiagnosisResult, DiagnoseError> {
    let times = crate::input_checks::check_recordings(scenario, evidence)?;
    let CleanRecordings { recordings, mut notes, raw } = clean_recordings(evidence);
    for (notes, unlike) in notes.iter_mut().zip(crate::input_checks::force_outlier_notes(&times)) {
        notes.extend(unlike);
    }
    progress("fitting the base law");
    let blocks: Vec<BlockAverages> =
        recordings.par_iter().zip(&raw.exclude).map(|(r, x)| BlockAverages::new(r, x, BLOCK_S)).collect();
    let prepared = PreparedRecordings::new(
        Arc::new(assumptions_of(scenario)),
        blocks,
        raw.step_n.unwrap_or(0.0) * stylet_stats::UNIFORM_SD,
    );
    let (fitted, data) = fit_base_law(&prepared).ok_or(DiagnoseError::NoFit)?;
    let (fitted, data) = select_random_effects(fitted, data);
    let (fitted, data) = refit_with_random_effects(&prepared, fitted, data);
    let mut search = Search::run(&prepared, fitted, data, &mut progress);
    let mut classes = find_competing_effects(&mut search);
    progress("judging");
    let mut judged = judge(&mut search, &classes);
    // Where numbers are coarse what is left may be their steps.
    judged.unknown &= !raw.step_n.is_some_and(|s| s > 0.5 * sample_noise_sd_n(&search.data));
    let mut loud: Vec<(&str, JackknifeResult)> = Vec::new();
    if judged.unknown && evidence.len() > 1 {
        progress("listening where the unknown is silent");
        let mut heard = search.continue_reweighted(&prepared);
        if let Some(better) = heard.as_ref().and_then(|h| search.adopt_if_better(h, &prepared)) {
            search = better;
            classes = find_competing_effects(&mut search);
            judged = judge(&mut search, &classes);
            heard = if judged.unknown { search.continue_reweighted(&prepared) } else { None };
        }
        if let Some(mut heard) = heard {
            let told = jackknife_effects(&search.best, &search.data, sample_noise_sd_n(&search.data));
            loud = search.best.model.effects.iter().map(|e| e.info.id).zip(told).collect();
            classes = find_competing_effects(&mut heard);
            let told = judge(&mut heard, &classes);
            let share = told.residual_structure.share;
            judged = Judged {
                unknown: true,
                lined: judged.lined,
                residual_structure: ResidualStructureReport { share, ..judged.residual_structure },
                ..told
            };
            search = heard;
        }
    }
    let names: Vec<String> = evidence.iter().map(|e| e.name.clone()).collect();
    let (before, after) = if options.brief {
        (Vec::new(), Vec::new())
    } else {
        progress("leaving one recording out");
        let before = held_out_residuals(&search.base, &search.data);
        let same = search.best.model.effects.is_empty();
        let after = if same { before.clone() } else { held_out_residuals(&search.best, &search.data) };
        (before, after)
    };
    let noise_n = sample_noise_sd_n(&search.data);
    let small = if options.brief {
        Vec::new()
    } else {
        negligible_effects::negligible_effects(&search, &after, &judged.causes, &judged.against_none)
    };
    let mut traces = take_traces(&mut judged, small);
    let mut from_raw = sensor_artefact_causes(&raw, noise_n);
    let unknown = judged.unknown;
    if unknown {
        let borne = jackknife_effects(&search.best, &search.data, noise_n);
        let effects = search.best.model.effects.iter().zip(&borne);
        let loud = |id: &str| loud.iter().find(|l| l.0 == id).map(|l| &l.1);
        let kept: Vec<&str> =
            effects.filter(|(e, b)| stands(e.info, b, loud(e.info.id))).map(|(e, _)| e.info.id).collect();
        let gone = judged.causes.iter().filter(|c| !kept.contains(&c.effect.as_str()));
        let gone = gone
            .map(|c| Negligible { effect: c.effect.clone(), reason: REASON_IMITATES_UNMODELLED.to_owned() })
            .collect();
        traces.extend(take_traces(&mut judged, gone));
    }
    let mut causes = judged.causes;
    // Where none of its effects is a cause, the base law is what is left.
    let after = if explains(&search, &causes) { after } else { before.clone() };
    let verdict = if unknown {
        Verdict::Unknown
    } else if causes.iter().any(|c| !c.equivalent.is_empty()) {
        Verdict::Ambiguous
    } else if causes.is_empty() && from_raw.is_empty() {
        Verdict::None
    } else {
        Verdict::Named
    };
    causes.append(&mut from_raw);
    let not_identifiable = if options.brief {
        Vec::new()
    } else {
        identifiability::not_identifiable(&search.best, &search.data)
    };
    let gain = Gain {
        held_out: names.len() > 1,
        recordings: names,
        rmse_before_n: pooled_rms(&before, &search.data),
        rmse_after_n: pooled_rms(&after, &search.data),
        floor_n: noise_n,
        per_recording_n: each(&before, &after, &search),
    };
    let mut data_quality = Vec::new();
    for (e, notes) in evidence.iter().zip(notes) {
        data_quality
            .extend(notes.into_iter().map(|note| DataQualityNote { recording: e.name.clone(), note }));
    }
    let diagnosis = Diagnosis {
        verdict,
        advice: identifiability::advice(&causes, &not_identifiable),
        base_parameters: judged.base_parameters,
        not_identifiable: not_identifiable,
        gain,
        negligible: traces,
        residual_structure: judged.residual_structure,
        data_quality,
        search_steps: search.stages.iter().map(step).collect(),
        noise: NoiseReport { sd_n: noise_n, ar: colour(&search), from_air: false },
        random_effect_sd: differences(&search),
        causes,
    };
    let extended = extended(scenario, &search, &diagnosis);
    Ok(DiagnosisResult {
        diagnosis,
        extended_scenario: extended,
        search,
        competing_effects: classes,
        base_held_out: before,
        extended_held_out: after,
    })
}

/// Recordings as the engine takes them.
pub(crate) struct CleanRecordings {
    /// Without samples that are no numbers.
    pub recordings: Vec<Recording>,
    /// Remarks on each.
    pub notes: Vec<Vec<QualityNote>>,
    /// What the raw numbers show.
    pub raw: sensor_artefacts::SensorArtefacts,
}

/// Reads quality and raw numbers of recordings.
pub(crate) fn clean_recordings(evidence: &[NamedRecording]) -> CleanRecordings {
    let mut notes: Vec<Vec<QualityNote>> = Vec::new();
    let mut recordings: Vec<Recording> = Vec::new();
    for e in evidence {
        let mut own = e.notes.clone();
        own.extend(crate::input_checks::non_finite_note(&e.recording));
        for note in assess(&e.recording) {
            if !own.contains(&note) {
                own.push(note);
            }
        }
        notes.push(own);
        recordings.push(crate::input_checks::drop_non_finite(&e.recording));
    }
    let borrowed: Vec<&Recording> = recordings.iter().collect();
    let raw = sensor_artefacts::find_sensor_artefacts(&borrowed, &notes);
    CleanRecordings { recordings, notes, raw }
}

/// What a scenario believes, and how surely.
#[must_use]
pub fn assumptions_of(s: &Scenario) -> Assumptions {
    let layers = s.tissue.layers.len();
    Assumptions {
        tissue: s.tissue.clone(),
        known_effects: s.effects.clone(),
        tolerance: vec![s.tolerance; layers],
        thickness_tolerance: vec![s.thickness_tolerance; layers],
        surface_tolerance_m: s.surface_tolerance_m,
    }
}

/// What follows from the search alone.
struct Judged {
    causes: Vec<Cause>,
    /// Nats that speak against an effect's having no strength.
    against_none: Vec<(String, f64)>,
    base_parameters: Vec<BaseParameter>,
    residual_structure: ResidualStructureReport,
    unknown: bool,
    /// What is left has lines in its spectrum.
    lined: bool,
}

/// Mean square of a residual beyond the noise, outlying samples cut, in units of the noise.
fn excess(data: &FitData, e: &[Vec<f64>]) -> f64 {
    // Outlying blocks are nobody's cause, nor are those at a jump of the speed that noisy positions leave open.
    const LIMIT: f64 = 6.0;
    const AT_JUMP: usize = 4;
    let (mut sum, mut n) = (0.0, 0.0);
    for (b, e) in data.recordings.iter().zip(e) {
        let mut near = vec![false; b.len()];
        for jump in &b.motion.jumps {
            let (lo, hi) =
                (b.block_at(jump.time_s - jump.time_sd_s), b.block_at(jump.time_s + jump.time_sd_s));
            let (lo, hi) = (lo.saturating_sub(AT_JUMP), (hi + AT_JUMP + 1).min(b.len()));
            near[lo.min(hi)..hi].fill(true);
        }
        for k in (0..b.len()).filter(|k| b.used[*k] && !near[*k]) {
            let sd = data.noise.bin_at(b.abs_force_n[k]).sd_n;
            sum += (e[k] / sd).powi(2).min(LIMIT * LIMIT);
            n += 1.0;
        }
    }
    sum / f64::max(n, 1.0) - 1.0
}

/// Chance that white noise of so many blocks has one line as strong as `excess` times all others together (Fisher 1929).
fn line_p(excess: f64, blocks: usize) -> f64 {
    let bins = 0.5 * blocks as f64;
    (bins * (1.0 + excess).powf(1.0 - bins)).clamp(f64::MIN_POSITIVE, 1.0)
}

fn judge(search: &mut Search, classes: &[Vec<CompetingEffect>]) -> Judged {
    let told = residual_tests::test_residuals(&search.best, &search.data);
    let lines = crate::tone_detection::detect_tones(&search.best, &search.data);
    let quiet = if lines.is_empty() {
        search.data.clone()
    } else {
        crate::tone_detection::with_noise_without_tones(&search.best, &search.data, &lines)
    };
    let (before, after) = (
        excess(&quiet, &search.base.residuals.residual_n),
        excess(&quiet, &search.best.residuals.residual_n),
    );
    let lined = !lines.is_empty() && after > EXCESS;
    let share = (after.max(0.0) / before.max(1e-9)).min(1.0);
    let alone = search.data.recording_count() < 2;
    let sure =
        if alone { after > EXCESS_ALONE } else { after > EXCESS && told.coloured_noise.p_value < LEFTOVER_P };
    let at_sight = after > EXCESS_SLOW && told.white_noise.p_value < LEFTOVER_P;
    let stretch =
        crate::outlier_segment_test::outlier_segment_p_value(&quiet, &search.best.residuals.residual_n);
    let without = |k: usize| {
        fit(
            &search.best.model.without_effect(k),
            &search.data,
            Effort { max_iterations: 3, min_gain_nats: 1.0 },
        )
    };
    let without: Vec<Option<Fit>> = (0..search.best.model.effects.len()).map(without).collect();
    // Intervals by the noise as it is, structure that is left included, however slow.
    let whole = search.data.with_estimated_noise(&search.best.residuals.residual_n, NoiseFrom::LongMemory);
    let settled = fit(
        &crate::geometry_selection::free_geometry(&search.best.model),
        &whole,
        Effort { max_iterations: 3, min_gain_nats: 0.1 },
    )
    .unwrap_or_else(|| search.best.clone());
    let settled = release_unreached_punctures(settled, &whole);
    let bent = imitates(&search.best, &search.data, &without, (&settled, &whole));
    let unknown = bent.is_some() || (share > UNEXPLAINED && (sure || at_sight || lined || stretch.is_some()));
    let left = if unknown && !sure { &told.white_noise } else { &told.coloured_noise };
    let spread = Covariance::new(&settled, &whole, &mut ChaCha8Rng::seed_from_u64(SEED));
    let (mut causes, mut against_none) = (Vec::new(), Vec::new());
    for (k, choice) in settled.model.effects.iter().enumerate() {
        let none = Vec::new();
        let rivals = classes.get(k).unwrap_or(&none);
        let mut parameters = BTreeMap::new();
        for (p, info) in choice.info.parameters.iter().enumerate() {
            parameters.insert(info.path.to_owned(), spread.effect_parameter(k, p));
        }
        against_none.extend(spread.nats_against_zero(k).map(|nats| (choice.info.id.to_owned(), nats)));
        let stage = search.stages.iter().rev().find(|s| s.selected.is_some_and(|t| t.0 == choice.info.id));
        let gain_nats = stage.and_then(|s| s.selected).map_or(0.0, |t| t.1);
        let needed = stage.map_or(0.0, |s| s.required_nats);
        let weights: f64 = rivals.iter().map(|r| libm::exp(-r.nats_behind.max(-3.0))).sum();
        let back = without[k].as_ref().map_or(0.0, |f| excess(&quiet, &f.residuals.residual_n) - after);
        causes.push(Cause {
            effect: choice.info.id.to_owned(),
            equivalent: rivals
                .iter()
                .filter(|r| r.nats_behind < EQUIVALENCE_NATS)
                .map(|r| r.name.to_owned())
                .collect(),
            confidence: 1.0 / (1.0 + weights + libm::exp(-(gain_nats - needed).clamp(-30.0, 30.0) - 3.0)),
            parameters,
            gain_nats,
            share: (back / before.max(1e-9)).clamp(0.0, 1.0),
        });
    }
    let base_parameters = base_parameters(search, &spread);
    causes.sort_by(|a, b| b.gain_nats.total_cmp(&a.gain_nats));
    let mut depends_on: Vec<String> = left.depends_on.iter().map(|d| d.0.clone()).collect();
    if lined {
        depends_on.insert(0, "frequency".to_owned());
    } else if unknown && depends_on.is_empty() {
        depends_on.push(bent.map_or("time", |b| b.feature).to_owned());
    }
    let bent_p = bent
        .map_or(1.0, |b| (chi_square_sf(2.0 * b.nats, 1.0) * FEATURES.len() as f64).max(f64::MIN_POSITIVE));
    let line = if lined { line_p(after, search.data.compared_block_count()) } else { 1.0 };
    let residual_structure = ResidualStructureReport {
        p_value: left.p_value.min(line).min(bent_p).min(stretch.filter(|_| unknown).unwrap_or(1.0)),
        depends_on,
        nats: left.nats,
        share,
    };
    if lined {
        // Nats are of one noise.
        for fit in [&mut search.base, &mut search.best] {
            fit.residuals = residuals(&fit.model, &quiet).unwrap_or_else(|| fit.residuals.clone());
        }
        search.data = quiet;
    }
    Judged { causes, against_none, base_parameters, residual_structure, unknown, lined }
}

/// How an effect of a fit that only imitates what is there would rather act, where there is one: of several the one that would gain most.
/// `without` are the fits without each, `slow` is the fit by a noise that may be slow: a zero that wanders bends whatever goes with time.
fn imitates(
    best: &Fit,
    data: &FitData,
    without: &[Option<Fit>],
    slow: (&Fit, &FitData),
) -> Option<VaryingCoefficient> {
    if without.is_empty() {
        return None;
    }
    let look = ScoreTest::new(best, data);
    let slowly = LazyCell::new(|| ScoreTest::new(slow.0, slow.1));
    let lost = |less: &Option<Fit>| less.as_ref().map_or(0.0, |f| f.nats() - best.nats());
    let most = without.iter().map(lost).fold(0.0, f64::max);
    let bent = |(k, less): (usize, &Option<Fit>)| {
        let told = varying_coefficient_test(&look, k, lost(less))?;
        let clear = told.nats > IMITATES_NATS.max(IMITATES * most)
            && varying_coefficient_test(&slowly, k, lost(less))?.nats > IMITATES_SLOW_NATS;
        clear.then_some(told)
    };
    without.iter().enumerate().filter_map(bent).max_by(|a, b| a.nats.total_cmp(&b.nats))
}

/// Whether an effect beside something unknown is a cause: by what is heard where that is silent, and by all that was recorded, where it had
/// been found.
fn stands(info: &EffectInfo, silent: &JackknifeResult, loud: Option<&JackknifeResult>) -> bool {
    let most = if info.absorbs_unmodelled { OTHERWISE_IMITATES } else { OTHERWISE_LOUD };
    silent.relative_se < SAME
        && silent.varying_coefficient_share < OTHERWISE.min(most)
        && loud.is_none_or(|l| l.varying_coefficient_share < most)
        && [Some(silent), loud].into_iter().flatten().all(|b| b.held_out_gain > PAYS)
}

/// Moves causes that are none to `traces`.
fn take_traces(judged: &mut Judged, small: Vec<Negligible>) -> Vec<NegligibleEffect> {
    let mut traces = Vec::new();
    for s in small {
        if let Some(k) = judged.causes.iter().position(|c| c.effect == s.effect) {
            let cause = judged.causes.remove(k);
            traces.push(NegligibleEffect {
                effect: cause.effect,
                parameters: cause.parameters,
                reason: s.reason,
            });
        }
    }
    traces
}

fn base_parameters(search: &Search, spread: &Covariance) -> Vec<BaseParameter> {
    let mut out = Vec::new();
    let believed = &search.best.model.assumed.tissue;
    let mut add = |layer: usize, name: &str, role: ParameterRole, assumed: f64, scale: f64| {
        let Some((x, half)) = spread.shared_parameter(role) else { return };
        let (value, low) = (x * scale, (x - half) * scale);
        let high = spread.prior_upper_end(role).map_or(x + half, |open| open.max(x + half)) * scale;
        out.push(BaseParameter {
            layer,
            name: name.to_owned(),
            assumed,
            value,
            low,
            high,
            changed: assumed < low || assumed > high,
            at_bound: spread.at_bound(role),
        });
    };
    for (l, layer) in believed.layers.iter().enumerate() {
        let (k, b) = (layer.stiffness_n_per_m, layer.friction_ns_per_m2);
        add(l + 1, "stiffness_n_per_m", ParameterRole::Stiffness(l), k, k);
        add(l + 1, "friction_ns_per_m2", ParameterRole::Friction(l), b, b);
        if let Some(f) = layer.puncture_n {
            add(l + 1, "puncture_n", ParameterRole::Puncture(l), f, f);
        }
        add(l + 1, "thickness_m", ParameterRole::Thickness(l), layer.thickness_m, 1.0);
    }
    add(0, "surface_m", ParameterRole::Surface, believed.surface_m, 1.0);
    out
}

fn each(
    before: &[Option<FreeRunResidual>],
    after: &[Option<FreeRunResidual>],
    search: &Search,
) -> Vec<(f64, f64)> {
    let one = |l: &Option<FreeRunResidual>, k: usize| {
        l.as_ref().map_or(f64::NAN, |l| {
            (l.mean_square_n2 + search.data.recordings[k].within_block_sd_n().powi(2)).sqrt()
        })
    };
    before.iter().zip(after).enumerate().map(|(k, (b, a))| (one(b, k), one(a, k))).collect()
}

/// What differs from recording to recording, by the best model.
fn differences(search: &Search) -> RandomEffectSd {
    let (s, free) = (&search.best.model.scatter, &search.best.model.free);
    RandomEffectSd {
        puncture: s.rupture_force,
        rupture_depth_m: s.rupture_depth_m,
        surface_m: if free.recording_surface { s.surface_m } else { 0.0 },
        friction: if free.recording_friction { s.ln_friction } else { 0.0 },
    }
}

/// First two coefficients of the noise per block, in the calmest range of the force.
fn colour(search: &Search) -> [f64; 2] {
    search.data.noise.bins.first().map_or([0.0; 2], |b| [b.ar[0], b.ar[1]])
}

fn step(stage: &crate::effect_selection::SearchStage) -> SearchStep {
    SearchStep {
        included: stage.included.iter().map(|s| (*s).to_owned()).collect(),
        candidates: stage
            .candidates
            .iter()
            .map(|(name, gain, numbers)| crate::diagnosis_json::SearchCandidate {
                effect: (*name).to_owned(),
                gain_nats: *gain,
                parameters: *numbers,
                screened_only: false,
            })
            .collect(),
        required_nats: stage.required_nats,
        selected: stage.selected.map(|t| t.0.to_owned()),
    }
}

/// Causes that the raw numbers show.
pub(crate) fn sensor_artefact_causes(raw: &sensor_artefacts::SensorArtefacts, noise_n: f64) -> Vec<Cause> {
    let mut causes = Vec::new();
    let mut add = |effect: AnyEffect, intervals: &[(f64, f64)]| {
        use stylet_tissue::Effect;
        let info = effect.info();
        let parameters = info
            .parameters
            .iter()
            .zip(effect.parameters())
            .zip(intervals)
            .map(|((p, value), (low, high))| {
                (p.path.to_owned(), Estimate { value, low: low.max(0.0), high: *high })
            })
            .collect();
        causes.push(Cause {
            effect: info.id.to_owned(),
            equivalent: Vec::new(),
            confidence: 0.99,
            parameters,
            gain_nats: 0.0,
            share: 0.0,
        });
    };
    let about = |value: f64, sd: f64| (value - stylet_stats::Z95 * sd, value + stylet_stats::Z95 * sd);
    if let Some(limit_n) = raw.limit_n {
        // A force that comes in steps shows its limit at the nearest one.
        let half_n = 0.5 * raw.step_n.unwrap_or(0.0) + 1e-6 * limit_n;
        add(stylet_tissue::Saturation { limit_n }.into(), &[(limit_n - half_n, limit_n + half_n)]);
    }
    if let Some(step_n) = raw.step_n.filter(|s| *s > 0.3 * noise_n) {
        add(stylet_tissue::Quantisation { step_n }.into(), &[about(step_n, 1e-4 * step_n)]);
    }
    if let Some(s) = &raw.spikes {
        let effect = stylet_tissue::ForceSpikes { rate_hz: s.rate_hz(), size_n: s.size_n };
        add(effect.into(), &[s.rate_interval_hz(), s.size_interval_n()]);
    }
    causes
}

/// Whether an effect of the best model is a cause.
fn explains(search: &Search, causes: &[Cause]) -> bool {
    search.best.model.effects.iter().any(|e| causes.iter().any(|c| c.effect == e.info.id))
}

/// The scenario as the diagnosis leaves it.
fn extended(scenario: &Scenario, search: &Search, d: &Diagnosis) -> Scenario {
    let mut out = scenario.clone();
    let none = search.best.model.effects.is_empty() && d.verdict != Verdict::Unknown;
    let source = if none || explains(search, &d.causes) { &search.best } else { &search.base };
    out.tissue = source.model.tissue.clone();
    let named = |id: &str| d.causes.iter().any(|c| c.effect == id);
    out.effects.extend(source.model.effects.iter().filter(|e| named(e.info.id)).filter_map(|e| e.effect()));
    for c in d.causes.iter().filter(|c| source.model.effects.iter().all(|e| e.info.id != c.effect)) {
        let Some(info) = stylet_tissue::effect_info(&c.effect) else { continue };
        let values: Vec<f64> =
            info.parameters.iter().filter_map(|p| c.parameters.get(p.path)).map(|e| e.value).collect();
        out.effects.extend(AnyEffect::from_parameters(info.id, &values));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{
        base_parameters, colour, differences, each, excess, extended, imitates, judge, line_p,
        sensor_artefact_causes, stands, step, take_traces,
    };
    use crate::competing_effects::CompetingEffect;
    use crate::confidence_intervals::Covariance;
    use crate::diagnosis_json::{Cause, Diagnosis, Verdict};
    use crate::effect_selection::Search;
    use crate::held_out::{FreeRunResidual, JackknifeResult};
    use crate::negligible_effects::Negligible;
    use crate::test_fixtures::{fit_from_truth, recordings_with_added_force, search_stage};
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::fit::{Effort, Fit, fit};
    use stylet_identify::likelihood::{FitData, residuals};
    use stylet_identify::model::{EffectTerm, FreeParameters, ParameterRole};
    use stylet_identify::noise::Noise;
    use stylet_record::Recording;
    use stylet_record::sensor_artefacts::{SensorArtefacts, Spikes};
    use stylet_tissue::{AnyEffect, Effect, ForceBias, ForceDrift, Respiration};

    /// Fisher 1929: `m (1 + x)^(1 - m)` for a line `x` times all others among `m` half the blocks.
    #[test]
    fn the_chance_of_a_line_is_fishers() {
        let wanted = 25.0 * 1.4_f64.powi(-24);
        assert!((line_p(0.4, 50) / wanted - 1.0).abs() < 1e-12, "{} for {wanted}", line_p(0.4, 50));
        assert_eq!(line_p(0.001, 50), 1.0);
        assert_eq!(line_p(9.0, 9000), f64::MIN_POSITIVE);
    }

    /// Two recordings at a steady speed and one that stops, every block a residual of so many noises.
    #[test]
    fn what_is_left_beyond_the_noise_is_its_mean_square_less_one() {
        let data = |stops: bool| {
            let t: Vec<f64> = (0..1000).map(|k| f64::from(k) / 100.0).collect();
            let z = t.iter().map(|t| if stops { (2e-3 * t).min(0.01) } else { 2e-3 * t }).collect();
            let r = Recording::new(t, z, vec![0.0; 1000]).expect("a recording");
            FitData::new(Arc::new(vec![BlockAverages::new(&r, &[], BLOCK_S)]), Noise::white(0.5), 0.0)
        };
        let still = data(false);
        let n = still.recordings[0].len();
        let e: Vec<f64> = (0..n).map(|k| 0.5 * (0.7 + (k % 5) as f64 * 0.3)).collect();
        let used: Vec<usize> = (0..n).filter(|k| still.recordings[0].used[*k]).collect();
        let square =
            used.iter().map(|k| (0.7 + (k % 5) as f64 * 0.3_f64).powi(2)).sum::<f64>() / used.len() as f64;
        assert!((excess(&still, std::slice::from_ref(&e)) - (square - 1.0)).abs() < 1e-9);
        // Outlying blocks count as six noises.
        let mut far = e.clone();
        far[100] = 99.0;
        let more = (36.0 - (2.0 * e[100]).powi(2)) / used.len() as f64;
        assert!((excess(&still, &[far]) - (square - 1.0 + more)).abs() < 1e-9);
        // Four blocks to either side of a jump of the speed are nobody's; those beyond count.
        let stopped = data(true);
        let b = &stopped.recordings[0];
        let jump = b.motion.jumps.first().expect("it stops");
        let (lo, hi) = (b.block_at(jump.time_s - jump.time_sd_s), b.block_at(jump.time_s + jump.time_sd_s));
        let with = |k: usize| {
            let mut e = vec![0.5; n];
            e[k] = 2.0;
            excess(&stopped, &[e])
        };
        for k in [lo - 4, lo, hi, hi + 4] {
            assert!(with(k).abs() < 1e-12, "{k}: {}", with(k));
        }
        for k in [lo - 5, hi + 5] {
            assert!(with(k) > 0.01, "{k}: {}", with(k));
        }
        assert_eq!(excess(&still, &[]), -1.0);
    }

    #[test]
    fn causes_of_the_raw_numbers_have_intervals_and_steps_have_to_matter() {
        let z = stylet_stats::Z95;
        let spikes = Spikes { count: 9, size_n: 0.1, size_sd_n: 0.9, observed_s: 45.0 };
        let raw = SensorArtefacts {
            limit_n: Some(2.5),
            step_n: Some(0.031),
            spikes: Some(spikes),
            ..SensorArtefacts::default()
        };
        let causes = sensor_artefact_causes(&raw, 0.1);
        assert_eq!(
            causes.iter().map(|c| c.effect.as_str()).collect::<Vec<_>>(),
            ["saturation", "quantisation", "force_spikes"]
        );
        let limit = causes[0].parameters["limit_n"];
        let half = 0.5 * 0.031 + 2.5e-6;
        assert!((limit.low - 2.5 + half).abs() < 1e-12 && (limit.high - 2.5 - half).abs() < 1e-12);
        let step = causes[1].parameters["step_n"];
        assert!(
            (step.low - 0.031 * (1.0 - z * 1e-4)).abs() < 1e-12
                && (step.high - 0.031 * (1.0 + z * 1e-4)).abs() < 1e-12
        );
        let (rate, size) = (causes[2].parameters["rate_hz"], causes[2].parameters["size_n"]);
        assert_eq!(
            (rate.value, rate.low, rate.high),
            (0.2, spikes.rate_interval_hz().0, spikes.rate_interval_hz().1)
        );
        // No size is less than nothing.
        assert!(
            spikes.size_interval_n().0 < 0.0 && size.low == 0.0 && size.high == spikes.size_interval_n().1
        );
        // Steps of less than three tenths of the noise are nobody's matter.
        assert_eq!(
            sensor_artefact_causes(
                &SensorArtefacts { step_n: Some(0.029), ..SensorArtefacts::default() },
                0.1
            )
            .len(),
            0
        );
        assert_eq!(sensor_artefact_causes(&raw, 0.2).len(), 2);
    }

    const AT: [[f64; 2]; 4] = [[3e-3, 3e-4], [4e-3, -3e-4], [5e-3, 0.0], [6e-3, 1e-4]];

    /// A search that found these effects in insertions off a sensor that shows so much more (N), its base law fitted beside.
    fn found(effects: &[AnyEffect], runs: usize, more_n: impl Fn(f64) -> f64) -> Search {
        let runs = recordings_with_added_force(&[], &AT[..runs], more_n);
        let f = fit_from_truth(effects, &runs.iter().collect::<Vec<_>>());
        let mut search = Search::for_tests(f.fit, f.data);
        search.accept(search.best.clone());
        search.base = search.best.clone();
        if !effects.is_empty() {
            search.base.model.effects.clear();
            search.base = fit(&search.base.model, &search.data, Effort::FULL).expect("a fit");
        }
        search.stages = effects.iter().map(|e| search_stage(Some((e.id(), 50.0)), 48.0, &[])).collect();
        search
    }

    fn drift() -> AnyEffect {
        ForceDrift { rate_n_per_s: 0.02 }.into()
    }

    fn slow(amplitude_n: f64) -> impl Fn(f64) -> f64 {
        move |t| amplitude_n * (1.6 * t).sin()
    }

    /// A slow wave that all have in common: with several recordings it counts from eight tenths of the noise's variance on where it is
    /// more than chance, with one from three times that on.
    #[test]
    fn what_recordings_have_in_common_is_unknown_where_it_is_large_against_the_noise() {
        let rows = [(4, 0.0, false), (4, 0.003, false), (4, 0.015, true), (1, 0.012, false), (1, 0.03, true)];
        for (runs, amplitude_n, unknown) in rows {
            let mut search = found(&[], runs, slow(amplitude_n));
            let left = excess(&search.data, &search.best.residuals.residual_n);
            let told = judge(&mut search, &[]);
            assert_eq!(told.unknown, unknown, "{runs} {amplitude_n} {left}");
            assert!(
                !told.lined && told.causes.is_empty() && (told.residual_structure.share - 1.0).abs() < 1e-3
            );
            if runs == 4 {
                // Neither large enough at sight, nor a stretch.
                assert!(left < 6.0 && unknown == (left > 0.8), "{left}");
                assert_eq!(
                    told.residual_structure.depends_on,
                    if unknown { vec!["time"] } else { Vec::new() }
                );
                assert_eq!(told.residual_structure.p_value < 1e-6, unknown);
            }
        }
    }

    #[test]
    fn a_line_that_is_left_depends_on_frequency_and_is_no_noise() {
        let mut search = found(&[], 4, |t| 0.03 * (14.0 * t).sin());
        let before = search.data.noise.sd_n();
        let told = judge(&mut search, &[]);
        assert!(told.unknown && told.lined && search.data.noise.sd_n() < 0.5 * before);
        assert_eq!(told.residual_structure.depends_on, ["frequency"]);
        let after = excess(&search.data, &search.best.residuals.residual_n);
        let chance = line_p(after, search.data.compared_block_count());
        assert!(told.residual_structure.p_value == chance && chance < 1e-50, "{chance}");
        // What is fitted later is held against the same noise.
        for f in [&search.base, &search.best] {
            let nats = residuals(&f.model, &search.data).expect("a replay").nats;
            assert_eq!(f.nats(), nats);
        }
    }

    #[test]
    fn a_zero_that_runs_faster_and_faster_is_no_drift_but_something_unknown() {
        for (bent_n_per_s2, with) in [(0.0, None), (0.0025, Some("time"))] {
            let drift = ForceDrift { rate_n_per_s: 0.1 }.into();
            let mut search = found(&[drift], 4, move |t| 0.1 * t + bent_n_per_s2 * t * t);
            let less = fit(
                &search.best.model.without_effect(0),
                &search.data,
                Effort { max_iterations: 3, min_gain_nats: 1.0 },
            );
            let told = imitates(&search.best, &search.data, &[less], (&search.best, &search.data));
            assert_eq!(told.map(|o| o.feature), with, "{told:?}");
            assert_eq!(judge(&mut search, &[]).unknown, with.is_some());
        }
    }

    #[test]
    fn beside_something_unknown_a_cause_is_the_same_and_acts_by_its_law_where_that_is_silent() {
        let borne = |spread: f64, gain: f64, otherwise: f64| JackknifeResult {
            relative_se: spread,
            held_out_gain: gain,
            varying_coefficient_share: otherwise,
        };
        let (drift, breathes) = (drift(), AnyEffect::from(Respiration::default()));
        let heard = |b: JackknifeResult| stands(drift.info(), &b, None);
        assert!(heard(borne(0.09, 0.2, 9e-4)));
        assert!(!heard(borne(0.11, 0.2, 9e-4)) && !heard(borne(0.09, 0.2, 1.1e-3)));
        assert!(!heard(borne(0.09, 0.09, 0.0)));
        // By all that was recorded it paid and acted by its law, too, if less surely.
        let with = |info, loud: JackknifeResult| stands(info, &borne(0.09, 0.2, 4e-4), Some(&loud));
        let loud = |b: JackknifeResult| with(drift.info(), b);
        assert!(
            loud(borne(0.4, 0.2, 0.02)) && !loud(borne(0.05, 0.2, 0.04)) && !loud(borne(0.05, 0.0, 0.02))
        );
        // A breath is seen in whatever comes and goes.
        let breath = |otherwise: f64| with(breathes.info(), borne(0.4, 0.2, otherwise));
        assert!(breath(4e-4) && !breath(6e-4));
    }

    fn rival(effect: &AnyEffect, behind: f64) -> CompetingEffect {
        CompetingEffect {
            name: effect.id(),
            nats_behind: behind,
            choice: EffectTerm::new(effect.info(), &effect.parameters()),
        }
    }

    #[test]
    fn a_cause_is_as_sure_as_its_rivals_are_behind_and_as_it_gained_beyond_what_it_needed() {
        let bias: AnyEffect = ForceBias { force_n: 0.05 }.into();
        let mut search = found(&[bias.clone(), drift()], 2, |t| 0.02 * t + 0.05);
        search.stages[1] = search_stage(Some(("force_drift", 70.0)), 69.0, &[]);
        let rivals = vec![rival(&bias, 1.0), rival(&drift(), 3.0), rival(&bias, -5.0)];
        let told = judge(&mut search, &[rivals, Vec::new()]);
        let ids: Vec<&str> = told.causes.iter().map(|c| c.effect.as_str()).collect();
        assert_eq!(ids, ["force_drift", "force_bias"], "the one that gained most comes first");
        let (first, second) = (&told.causes[0], &told.causes[1]);
        assert!((first.confidence - 1.0 / (1.0 + (-4.0_f64).exp())).abs() < 1e-12);
        // None is counted as if it were more than three nats ahead.
        let weights = (-1.0_f64).exp() + (-3.0_f64).exp() + 3.0_f64.exp();
        assert!((second.confidence - 1.0 / (1.0 + weights + (-5.0_f64).exp())).abs() < 1e-12);
        assert_eq!((first.gain_nats, second.gain_nats), (70.0, 50.0));
        // Three nats behind is no class any more.
        assert_eq!(
            (first.equivalent.len(), &second.equivalent[..]),
            (0, &["force_bias".to_owned(), "force_bias".to_owned()][..])
        );
        let mut against: Vec<&str> = told.against_none.iter().map(|a| a.0.as_str()).collect();
        against.sort_unstable();
        assert_eq!(against, ["force_bias", "force_drift"]);
        let e = first.parameters["rate_n_per_s"];
        assert!(e.low < 0.02 && 0.02 < e.high && e.high - e.low < 4e-3, "{e:?}");
        let of = |f: &Fit| excess(&search.data, &f.residuals.residual_n);
        let less = fit(
            &search.best.model.without_effect(1),
            &search.data,
            Effort { max_iterations: 3, min_gain_nats: 1.0 },
        );
        let share = (of(&less.expect("a fit")) - of(&search.best)) / of(&search.base);
        assert!((first.share / share - 1.0).abs() < 1e-9 && second.share < share && share < 0.9, "{share}");
        assert!(!told.unknown && !told.lined && told.residual_structure.depends_on.is_empty());
    }

    #[test]
    fn base_parameters_are_told_beside_what_was_assumed() {
        let mut search = found(&[], 3, |_| 0.0);
        let mut belief = search.best.model.assumed.as_ref().clone();
        belief.tissue.layers[0].stiffness_n_per_m *= 0.8;
        belief.tissue.layers[0].friction_ns_per_m2 *= 1.3;
        search.best.model.assumed = Arc::new(belief);
        let spread = Covariance::new(&search.best, &search.data, &mut ChaCha8Rng::seed_from_u64(1));
        let told = base_parameters(&search, &spread);
        let names: Vec<(usize, &str)> = told.iter().map(|p| (p.layer, p.name.as_str())).collect();
        let of_layer = ["stiffness_n_per_m", "friction_ns_per_m2", "puncture_n"].map(|n| (1, n));
        assert_eq!(names, [&of_layer[..], &[(0, "surface_m")]].concat());
        // What is there is what the insertions were made with.
        for (p, (there, changed)) in
            told.iter().zip([(250.0, true), (2e4, true), (2.0, false), (4e-3, false)])
        {
            assert!((p.value / there - 1.0).abs() < 0.01, "{p:?}");
            assert!(p.low < p.value && (p.high + p.low - 2.0 * p.value).abs() < 1e-9 * p.value, "{p:?}");
            assert_eq!((p.changed, p.at_bound), (changed, false), "{p:?}");
        }
        let role = ParameterRole::Thickness(0);
        search.best.model.free.thickness = true;
        let unsure = Covariance::new(&search.best, &search.data, &mut ChaCha8Rng::seed_from_u64(1));
        let told = base_parameters(&search, &unsure);
        assert_eq!(
            unsure.shared_parameter(role).is_some(),
            told.iter().any(|p| (p.layer, &p.name[..]) == (1, "thickness_m"))
        );
    }

    #[test]
    fn what_is_told_of_every_recording_is_its_own() {
        let mut search = found(&[drift()], 2, |t| 0.02 * t);
        let left = |square_n2: f64| {
            Some(FreeRunResidual { mean_square_n2: square_n2, ..FreeRunResidual::default() })
        };
        let within = search.data.recordings[1].within_block_sd_n();
        let told = each(&[None, left(0.04)], &[left(0.01), left(0.09)], &search);
        assert!(told[0].0.is_nan() && within > 1e-3);
        assert_eq!(told[1], ((0.04 + within * within).sqrt(), (0.09 + within * within).sqrt()));
        let s = &mut search.best.model;
        (s.scatter.rupture_force, s.scatter.rupture_depth_m, s.scatter.surface_m, s.scatter.ln_friction) =
            (0.1, 2e-3, 3e-4, 0.4);
        for (own_surface, own_friction) in [(true, false), (false, true)] {
            search.best.model.free = FreeParameters {
                recording_surface: own_surface,
                recording_friction: own_friction,
                ..search.best.model.free
            };
            let d = differences(&search);
            assert_eq!((d.puncture, d.rupture_depth_m), (0.1, 2e-3));
            assert_eq!(d.surface_m, if own_surface { 3e-4 } else { 0.0 });
            assert_eq!(d.friction, if own_friction { 0.4 } else { 0.0 });
        }
        let mut noise = Noise::white(0.5);
        (noise.bins[0].ar[0], noise.bins[0].ar[1]) = (0.3, -0.2);
        search.data = search.data.with_noise(noise);
        assert_eq!(colour(&search), [0.3, -0.2]);
        let told = step(&search_stage(Some(("force_drift", 9.0)), 7.0, &[(drift(), 12.0)]));
        assert_eq!((told.selected.as_deref(), told.required_nats), (Some("force_drift"), 7.0));
        assert_eq!((told.candidates[0].effect.as_str(), told.candidates[0].gain_nats), ("force_drift", 12.0));
    }

    /// A diagnosis that names these, and nothing else of it.
    fn diagnosis(verdict: Verdict, causes: Vec<Cause>) -> Diagnosis {
        let none = r#"{"verdict": "none", "causes": [], "base_parameters": [], "not_identifiable": [], "data_quality": [], "evidence": [],
            "gain": {"held_out": false, "recordings": [], "rmse_before_n": 0, "rmse_after_n": 0, "floor_n": 0, "per_recording_n": []},
            "residual_structure": {"p_value": 1, "depends_on": [], "nats": 0}, "noise": {"sd_n": 0, "ar": [0, 0], "from_air": false},
            "advice": []}"#;
        Diagnosis { verdict, causes, ..serde_json::from_str(none).expect("a diagnosis") }
    }

    #[test]
    fn a_scenario_is_extended_by_the_causes_and_the_law_that_they_are_part_of() {
        let mut search = found(&[drift(), ForceBias { force_n: 0.05 }.into()], 2, |t| 0.02 * t + 0.05);
        let scenario = stylet_scenario::parse(
            "a scenario",
            r#"(name: "a", tissue: (surface_m: 0.0, layers: []), motion: Recorded)"#,
        );
        let scenario = scenario.expect("a scenario");
        let (best, base) = (search.best.model.tissue.clone(), search.base.model.tissue.clone());
        assert!(best != base);
        let saturated = || {
            sensor_artefact_causes(&SensorArtefacts { limit_n: Some(2.5), ..SensorArtefacts::default() }, 0.1)
                .remove(0)
        };
        let drifts = || Cause { effect: "force_drift".to_owned(), ..saturated() };
        let of = |search: &Search, verdict, causes| {
            let s = extended(&scenario, search, &diagnosis(verdict, causes));
            (s.tissue, s.effects.iter().map(|e| e.id()).collect::<Vec<_>>())
        };
        assert_eq!(of(&search, Verdict::Named, vec![drifts()]), (best.clone(), vec!["force_drift"]));
        // Effects that are no causes go with their law; what the raw numbers show belongs to neither.
        assert_eq!(of(&search, Verdict::None, vec![]), (base.clone(), vec![]));
        assert_eq!(of(&search, Verdict::Named, vec![saturated()]), (base.clone(), vec!["saturation"]));
        let both = vec![drifts(), saturated()];
        assert_eq!(of(&search, Verdict::Unknown, both).1, ["force_drift", "saturation"]);
        search.best.model.effects.clear();
        assert_eq!(of(&search, Verdict::None, vec![]), (best, vec![]));
        assert_eq!(of(&search, Verdict::Unknown, vec![]), (base, vec![]));
    }

    #[test]
    fn causes_that_are_too_small_become_traces() {
        let mut search = found(&[drift(), ForceBias { force_n: 0.05 }.into()], 2, |t| 0.02 * t + 0.05);
        let mut judged = judge(&mut search, &[]);
        let small = |effect: &str| Negligible { effect: effect.to_owned(), reason: "a reason".to_owned() };
        let told = take_traces(&mut judged, vec![small("time_delay"), small("force_bias")]);
        assert_eq!(
            told.iter().map(|t| (&t.effect[..], &t.reason[..])).collect::<Vec<_>>(),
            [("force_bias", "a reason")]
        );
        assert!(told[0].parameters.contains_key("force_n"));
        assert_eq!(judged.causes.iter().map(|c| &c.effect[..]).collect::<Vec<_>>(), ["force_drift"]);
    }
}
