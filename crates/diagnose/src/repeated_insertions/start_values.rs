//! Computes start values and priors from the raw forces, before any fit.

use super::segmented_recording::{SegmentedRecording, group_by_speed_and_stroke, have_one_speed};
use std::sync::Arc;
use stylet_identify::model::{
    Assumptions, DayParameters, EffectTerm, FreeParameters, Model, NO_RUPTURE, TiedParameter,
};
use stylet_stats::order_statistics::median_of;
use stylet_tissue::{AnyEffect, DelayedPuncture, ReleaseDepth, ShaftSlip, Tissue};

/// Prior standard deviation (m) of the surface about the position at which the force first rises.
const SURFACE_SD_M: f64 = 1.5e-3;
/// Prior standard deviation (m) of the surface for a blunt indenter, which first rests on soft tissue.
const INDENTATION_SURFACE_SD_M: f64 = 2e-3;
/// Index of `rate` among the parameters of `shaft_slip`.
pub(super) const SLIP_RATE_INDEX: usize = 6;
/// Index of `exponent` among the parameters of `delayed_puncture`.
const DELAY_EXPONENT_INDEX: usize = 2;
/// Relative prior standard deviation of a thickness.
const RELATIVE_THICKNESS_SD: f64 = 0.2;
/// Share of the load before a rupture that friction carries in the start values of the base law.
const FRICTION_LOAD_SHARE: f64 = 0.3;
/// Relative prior standard deviation of stiffness, friction and puncture force about their start values.
const STIFFNESS_FACTOR: f64 = 4.0;
/// Prior standard deviation (m) of the surface between days: ten times the repeatability of a stage.
pub const EXPECTED_DAY_SURFACE_SD_M: f64 = 3e-4;
/// Prior standard deviation of the logarithm of friction between days: as between recordings of one day.
pub const EXPECTED_DAY_FRICTION_SD: f64 = 0.03;

/// Start values that differ between starts, because the raw force does not determine them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartValues {
    /// Share of the load before the first rupture that the linear spring carries.
    pub linear_share: f64,
    /// Push plateau of the shaft, as a share of that load.
    pub hold_ratio: f64,
    /// Pull plateau, as a share of the push plateau.
    pub pull_ratio: f64,
    /// Share of the plateau that remains after the rupture.
    pub kept_share: f64,
    /// Exponent of the slip law.
    pub exponent: f64,
    /// Wear of the plateau (1/m) in the first layer and in deeper ones.
    pub wear_per_m: [f64; 2],
    /// Rate exponent of the plateau.
    pub rate: f64,
    /// Relaxing fractions.
    pub fractions: [f64; 2],
    /// Time constants of the relaxing fractions in s.
    pub time_constants_s: [f64; 2],
    /// Exponent of the delayed punctures.
    pub delay_exponent: f64,
    /// Surface relative to the position at which the force first rises, in m.
    pub surface_m: f64,
    /// Rupture depth (m) of deeper layers behind their front; the first layer then ruptures where the force reaches the plateau, if it
    /// shows no drop. `None`: layers rupture at the visible drops, which may belong to the layer above.
    pub rupture_depth_m: Option<f64>,
}

/// Path (m) behind the assumed end of the tissue from which the needle counts as having left it, beyond the error of the contact.
const LEFT_BEHIND_M: f64 = 1e-3;

/// Geometry from the raw data; per layer, the load before its rupture and the indentation at that load.
struct LayerGeometry {
    tissue: Tissue,
    /// Whether the needle leaves the last layer.
    leaves: bool,
    fronts_m: Vec<f64>,
    loads_n: Vec<f64>,
    indented_m: Vec<f64>,
}

/// Whether the rate exponent of a `shaft_slip` effect is held constant, as at one speed.
pub(super) fn is_rate_held(model: &Model, effect: usize) -> bool {
    model.tied.iter().any(|b| (b.effect, b.parameter, b.tied_to) == (effect, SLIP_RATE_INDEX, None))
}

/// Median over the recordings that show a value.
fn median_over(
    recordings: &[&SegmentedRecording],
    what: &dyn Fn(&SegmentedRecording) -> Option<f64>,
) -> Option<f64> {
    let all: Vec<f64> = recordings.iter().filter_map(|r| what(r)).collect();
    (!all.is_empty()).then(|| median_of(all))
}

/// Geometry of an assumed tissue, with its surface `beyond_m` behind the contact.
fn layer_geometry(assumed: &Tissue, recordings: &[&SegmentedRecording], beyond_m: f64) -> LayerGeometry {
    let of = |what: &dyn Fn(&SegmentedRecording) -> Option<f64>| median_over(recordings, what);
    let contact = of(&|r| Some(r.contact_m)).unwrap_or(assumed.surface_m);
    let deepest = of(&|r| Some(r.stroke_m)).unwrap_or(contact + 0.01);
    let largest =
        recordings.iter().flat_map(|r| &r.recording.force_n).fold(1e-3_f64, |most, f| most.max(f.abs()));
    let layers = assumed.layers.len();
    let surface_m = contact + beyond_m;
    let mut fronts_m = vec![surface_m];
    for l in 1..layers {
        let expected = assumed.front_m(l) - assumed.surface_m + contact;
        let front = of(&|r| r.releases_m[l]).map_or(expected, |z| z - 5e-4);
        let low = fronts_m[l - 1] + 1e-3;
        fronts_m.push(front.clamp(low, (deepest - 1e-3).max(low + 1e-3)));
    }
    let mut tissue = assumed.clone();
    tissue.surface_m = surface_m;
    let (mut loads_n, mut indented_m) = (Vec::new(), Vec::new());
    let mut leaves = false;
    for (l, layer) in tissue.layers.iter_mut().enumerate() {
        if l + 1 < layers {
            layer.thickness_m = fronts_m[l + 1] - fronts_m[l];
        } else {
            leaves = fronts_m[l] + layer.thickness_m + LEFT_BEHIND_M < deepest;
            if !leaves {
                layer.thickness_m = layer.thickness_m.max(deepest - fronts_m[l] + 0.02);
            }
        }
        // Friction of the layers above carries a part of the load of deeper layers.
        let share = if l == 0 { 1.0 } else { 0.6 };
        let load_n = of(&|r| r.loads_n[l]);
        let load = share * load_n.unwrap_or(largest).max(0.05 * largest);
        let at = of(&|r| {
            let t = r.ruptures_s[l];
            let k = r.recording.time_s.partition_point(|x| *x < t);
            (t < NO_RUPTURE).then(|| r.recording.position_m[k.min(r.recording.len() - 1)])
        });
        loads_n.push(load);
        indented_m.push((at.unwrap_or(deepest) - fronts_m[l]).max(2e-3));
    }
    LayerGeometry { tissue, leaves, fronts_m, loads_n, indented_m }
}

/// Prior of an indentation without rupture: one linear spring.
pub fn indentation_prior(assumed: &Tissue, run: &SegmentedRecording) -> Assumptions {
    let geometry = layer_geometry(assumed, &[run], 0.0);
    let mut tissue = geometry.tissue;
    for (layer, (load, x)) in tissue.layers.iter_mut().zip(geometry.loads_n.iter().zip(&geometry.indented_m))
    {
        layer.stiffness_n_per_m = (load / x).max(1.0);
        layer.friction_ns_per_m2 = 0.0;
        layer.puncture_n = None;
    }
    Assumptions { surface_tolerance_m: INDENTATION_SURFACE_SD_M, ..weak_prior(tissue, geometry.leaves) }
}

/// Prior of the base law: stiffness, friction and puncture force from the raw forces, which are accurate to a factor of a few.
pub fn base_law_prior(assumed: &Tissue, recordings: &[&SegmentedRecording]) -> Assumptions {
    let geometry = layer_geometry(assumed, recordings, 0.0);
    let speed = median_over(recordings, &|r| Some(r.speed_mps)).unwrap_or(1e-3).max(1e-5);
    let mut tissue = geometry.tissue;
    for (l, layer) in tissue.layers.iter_mut().enumerate() {
        let (load, x) = (geometry.loads_n[l], geometry.indented_m[l]);
        let ruptured = recordings.iter().filter(|r| r.ruptures_s[l].is_finite()).count();
        layer.stiffness_n_per_m = (load / x).max(1.0);
        layer.friction_ns_per_m2 = FRICTION_LOAD_SHARE * load / (speed * x);
        // A rupture below the threshold of a visible drop is expected where one is assumed.
        layer.puncture_n = (2 * ruptured >= recordings.len()).then_some(load).or(layer.puncture_n);
    }
    weak_prior(tissue, geometry.leaves)
}

/// Weak prior about the parameters of a tissue, which the needle `leaves` or not.
fn weak_prior(tissue: Tissue, leaves: bool) -> Assumptions {
    let layers = tissue.layers.len();
    Assumptions {
        known_effects: Vec::new(),
        further_effects: Vec::new(),
        tolerance: vec![STIFFNESS_FACTOR; layers],
        thickness_tolerance: (0..layers)
            .map(|l| if l + 1 < layers || leaves { RELATIVE_THICKNESS_SD } else { 0.0 })
            .collect(),
        surface_tolerance_m: SURFACE_SD_M,
        tissue,
    }
}

/// Time (s) at which the force first reaches `force_n` during the advance.
fn first_time_above(run: &SegmentedRecording, force_n: f64) -> f64 {
    let way = run.phases.start..=run.phases.deepest;
    let force = run.recording.force_n.get(way).unwrap_or(&[]);
    let at = force.iter().position(|f| *f >= force_n).map(|k| run.phases.start + k);
    at.and_then(|k| run.recording.time_s.get(k)).copied().unwrap_or(NO_RUPTURE)
}

/// Start model with `shaft_slip`, `delayed_puncture` and `release_depth` in every layer, and ruptures at the force drops. If the plateau of
/// the shaft is as high as the load of the first layer, this layer may rupture without a drop, where the force first reaches the plateau.
pub fn shaft_slip_start(assumed: &Tissue, recordings: &[&SegmentedRecording], guess: &StartValues) -> Model {
    let LayerGeometry { mut tissue, leaves, fronts_m: fronts, loads_n, indented_m } =
        layer_geometry(assumed, recordings, guess.surface_m);
    let days = group_by_speed_and_stroke(recordings);
    let one_speed = have_one_speed(recordings);
    let mut effects: Vec<AnyEffect> = Vec::new();
    let mut bound = Vec::new();
    for (l, layer) in tissue.layers.iter_mut().enumerate() {
        let (load, x) = (loads_n[l], indented_m[l]);
        layer.stiffness_n_per_m = (guess.linear_share * load / x).max(1.0);
        layer.friction_ns_per_m2 = 0.0;
        layer.puncture_n = None;
        let hold = guess.hold_ratio * load;
        let here = effects.len();
        if l == 0 && one_speed {
            // One speed identifies neither the rate exponent nor the exponent of the delay.
            bound.push(TiedParameter { effect: here, parameter: SLIP_RATE_INDEX, tied_to: None });
            bound.push(TiedParameter { effect: here + 1, parameter: DELAY_EXPONENT_INDEX, tied_to: None });
        }
        if l > 0 {
            // Parameters of the shaft material are common to the layers.
            bound.push(TiedParameter { effect: here + 1, parameter: 2, tied_to: Some(1) });
            bound.extend([3, 4, 6, 8, 9, 10, 11].map(|parameter| TiedParameter {
                effect: here,
                parameter,
                tied_to: Some(0),
            }));
        }
        effects.push(
            ShaftSlip {
                layer: l + 1,
                push_n: hold,
                pull_n: guess.pull_ratio * hold,
                retained_share: guess.kept_share,
                exponent: guess.exponent,
                wear_per_m: guess.wear_per_m[l.min(1)],
                rate: if one_speed { 0.0 } else { guess.rate },
                curvature_n_per_m2: (1.0 - guess.linear_share) * load / (x * x),
                fractions: guess.fractions,
                time_constants_s: guess.time_constants_s,
            }
            .into(),
        );
        effects.push(DelayedPuncture { layer: l + 1, force_n: load, exponent: guess.delay_exponent }.into());
        let depth_m = median_over(recordings, &|r| r.releases_m[l]).map_or(0.0, |z| z - fronts[l]);
        effects.push(ReleaseDepth { layer: l + 1, depth_m }.into());
    }
    let layers = tissue.layers.len();
    let prior = weak_prior(tissue, leaves);
    let mut model = Model::base(Arc::new(prior), recordings.len());
    model.effects = effects.iter().map(EffectTerm::of).collect();
    model.tied = bound;
    model.free = FreeParameters {
        surface: true,
        thickness: true,
        wide_thickness: false,
        recording_surface: true,
        recording_friction: true,
        recording_effects: true,
        day_surface: days.len() > 1,
        day_friction: days.len() > 1,
    };
    model.fixed_scatter = true;
    model.scatter.surface_m = 2e-4;
    model.scatter.day_surface_m = EXPECTED_DAY_SURFACE_SD_M;
    model.scatter.day_ln_friction = EXPECTED_DAY_FRICTION_SD;
    model.scatter.rupture_force = 0.09;
    model.days = vec![DayParameters::default(); days.len()];
    model.day_of =
        (0..recordings.len()).map(|r| days.iter().position(|g| g.contains(&r)).unwrap_or(0)).collect();
    model.rupture_times_s = recordings.iter().map(|r| r.ruptures_s.clone()).collect();
    if let Some(behind_m) = guess.rupture_depth_m {
        for (times, run) in model.rupture_times_s.iter_mut().zip(recordings) {
            let (time, place) = (&run.recording.time_s, &run.recording.position_m);
            if let Some((first, load)) = times.first_mut().zip(loads_n.first()).filter(|i| *i.0 == NO_RUPTURE)
            {
                *first = first_time_above(run, guess.hold_ratio * load);
            }
            for l in 1..layers {
                let before = times[l - 1];
                let passed = place.iter().position(|z| *z > fronts[l] + behind_m);
                times[l] = passed
                    .map_or(NO_RUPTURE, |k| time[k].max(before + 2.0 * run.recording.median_interval_s()));
            }
        }
    }
    // Visible releases are start values of the random effects of their recording.
    let differing: Vec<(usize, usize)> = model.varying_parameters().collect();
    for (k, (effect, parameter)) in differing.into_iter().enumerate() {
        let common = model.effects[effect].values[parameter];
        let range = model.effects[effect].info.parameters[parameter];
        for (r, run) in recordings.iter().enumerate() {
            if let Some((z, front)) = run.releases_m.get(k).copied().flatten().zip(fronts.get(k)) {
                let depth_m = z - front;
                model.per_recording[r].varying[k] = depth_m.clamp(range.low, range.high) - common;
            }
        }
    }
    model
}

#[cfg(test)]
mod tests;
