//! The numbers of a law with intervals: how they change when runs are left out.

use crate::diagnosis_json::{BaseParameter, Estimate};
use crate::repeated_insertions::cross_validation::HeldOutPrediction;
use crate::repeated_insertions::multistart_fit::SetFit;
use std::collections::BTreeMap;
use stylet_identify::model::{Model, ParameterRole};
use stylet_stats::{sd, student_t};
use stylet_tissue::Tissue;

/// A number so near to its bound (share of the range, at most this much) stands at it.
const NEAR: f64 = 1e-3;

/// One number of a law.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterEstimate {
    /// Effect, or `layer.1` for a base parameter, `layer.0` for the stack.
    pub owner: String,
    /// Its path.
    pub path: String,
    /// Value.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether it stands where it may not go further: nothing is known beyond.
    pub at_bound: bool,
}

impl ParameterEstimate {
    /// Value and interval.
    #[must_use]
    pub fn estimate(&self) -> Estimate {
        Estimate { value: self.value, low: self.low, high: self.high }
    }
}

/// Whether a number stands where it may not go further.
pub(super) fn is_at_bound(model: &Model, role: ParameterRole) -> bool {
    model.shared_parameters().iter().find(|n| n.role == role).is_some_and(|n| {
        let (x, near) = (model.get(role, 0), NEAR * (n.high - n.low).min(1.0));
        x <= n.low + near || x >= n.high - near
    })
}

/// Values by owner and path, with bounds of the paths and whether they are reached.
fn values(model: &Model) -> Vec<(String, String, f64, bool)> {
    let reached = |role: ParameterRole| is_at_bound(model, role);
    let mut out = Vec::new();
    let mut tell =
        |owner: String, path: &str, value: f64, bound: bool| out.push((owner, path.to_owned(), value, bound));
    tell("layer.0".to_owned(), "surface_m", model.tissue.surface_m, reached(ParameterRole::Surface));
    for (l, layer) in model.tissue.layers.iter().enumerate() {
        let owner = format!("layer.{}", l + 1);
        tell(
            owner.clone(),
            "front_m",
            model.tissue.front_m(l),
            l > 0 && reached(ParameterRole::Thickness(l - 1)),
        );
        tell(
            owner.clone(),
            "stiffness_n_per_m",
            layer.stiffness_n_per_m,
            reached(ParameterRole::Stiffness(l)),
        );
        tell(
            owner.clone(),
            "friction_ns_per_m2",
            layer.friction_ns_per_m2,
            reached(ParameterRole::Friction(l)),
        );
        if let Some(force) = layer.puncture_n {
            tell(owner, "puncture_n", force, reached(ParameterRole::Puncture(l)));
        }
    }
    let many = |id: &str| model.effects.iter().filter(|c| c.info.id == id).count() > 1;
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for (effect, choice) in model.effects.iter().enumerate() {
        let id = choice.info.id;
        let k = seen.entry(id).or_insert(0);
        for (parameter, p) in choice.info.parameters.iter().enumerate() {
            let path = if many(id) { format!("{k}.{}", p.path) } else { p.path.to_owned() };
            let like = model.tied.iter().find(|b| b.effect == effect && b.parameter == parameter);
            let role =
                ParameterRole::Effect { effect: like.and_then(|b| b.tied_to).unwrap_or(effect), parameter };
            tell(id.to_owned(), &path, choice.values[parameter], !p.integer && reached(role));
        }
        *k += 1;
    }
    out
}

/// The numbers of a law with their 95 % intervals by the jackknife over runs (Quenouille, Tukey): how they change when runs are
/// left out, which counts what one law cannot say about all of them.
#[must_use]
pub fn jackknife_estimates(fitted: &SetFit, out: &[HeldOutPrediction]) -> Vec<ParameterEstimate> {
    let others: Vec<_> = out.iter().filter_map(|o| o.population.as_ref()).map(|p| values(&p.model)).collect();
    let n = others.len() as f64;
    values(&fitted.fit.model)
        .into_iter()
        .enumerate()
        .map(|(i, (owner, path, value, at_bound))| {
            let all: Vec<f64> = others.iter().filter_map(|o| o.get(i)).map(|o| o.2).collect();
            // The sample variance divides by n - 1; the jackknife's is (n - 1)/n times the sum of squares.
            let error = sd(&all) * (n - 1.0) / n.sqrt();
            let reach = student_t::quantile(0.975, (n - 1.0).max(1.0)) * error;
            let reach = if reach.is_finite() { reach } else { value.abs() };
            ParameterEstimate { owner, path, value, low: value - reach, high: value + reach, at_bound }
        })
        .collect()
}

/// The base parameters among the numbers, beside what was believed.
#[must_use]
pub fn base_parameters(told: &[ParameterEstimate], believed: &Tissue) -> Vec<BaseParameter> {
    told.iter()
        .filter_map(|t| {
            let layer: usize = t.owner.strip_prefix("layer.")?.parse().ok()?;
            let of = |f: &dyn Fn(&stylet_tissue::Layer) -> f64| {
                layer.checked_sub(1).and_then(|l| believed.layers.get(l)).map_or(0.0, f)
            };
            let assumed = match t.path.as_str() {
                "surface_m" => believed.surface_m,
                "front_m" => believed.front_m(layer.saturating_sub(1)),
                "stiffness_n_per_m" => of(&|l| l.stiffness_n_per_m),
                "friction_ns_per_m2" => of(&|l| l.friction_ns_per_m2),
                _ => of(&|l| l.puncture_n.unwrap_or(0.0)),
            };
            Some(BaseParameter {
                layer,
                name: t.path.clone(),
                assumed,
                value: t.value,
                low: t.low,
                high: t.high,
                changed: !(t.low <= assumed && assumed <= t.high),
                at_bound: t.at_bound,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{base_parameters, jackknife_estimates, values};
    use crate::repeated_insertions::cross_validation::HeldOutPrediction;
    use crate::repeated_insertions::multistart_fit::SetFit;
    use crate::repeated_insertions::population_prediction::Population;
    use crate::repeated_insertions::population_prediction::QUANTILES;
    use std::sync::Arc;
    use stylet_identify::fit::Fit;
    use stylet_identify::likelihood::{FitData, Residuals};
    use stylet_identify::model::{Assumptions, EffectTerm, Model, TiedParameter};
    use stylet_identify::noise::Noise;
    use stylet_stats::student_t;
    use stylet_tissue::{AnyEffect, DelayedPuncture, Effect, Layer, ReleaseDepth, Tissue};

    fn tissue() -> Tissue {
        let layer = |d: f64, k: f64, f: Option<f64>| Layer {
            name: String::new(),
            thickness_m: d,
            stiffness_n_per_m: k,
            friction_ns_per_m2: 4000.0,
            puncture_n: f,
        };
        Tissue { surface_m: 0.002, layers: vec![layer(0.02, 150.0, Some(1.1)), layer(0.03, 220.0, None)] }
    }

    fn model() -> Model {
        let belief = Assumptions {
            tissue: tissue(),
            known_effects: Vec::new(),
            tolerance: vec![0.5; 2],
            thickness_tolerance: vec![0.1; 2],
            surface_tolerance_m: 0.01,
        };
        Model::base(Arc::new(belief), 1)
    }

    fn fitted(model: Model) -> SetFit {
        let residuals =
            Residuals { residual_n: Vec::new(), innovations: Vec::new(), ruptures: Vec::new(), nats: 0.0 };
        let data = FitData::new(Arc::new(Vec::new()), Noise::white(1.0), 0.0);
        SetFit { fit: Fit { model, residuals }, data, drop_times_s: Vec::new(), starts: (1, 1) }
    }

    /// Quenouille and Tukey: `(n - 1)/n` times the sum of squares about the mean, Student's with one less than there are.
    #[test]
    fn intervals_are_those_of_the_jackknife_over_runs() {
        let left = [148.0, 155.0, 151.0, 158.0];
        let out: Vec<HeldOutPrediction> = left
            .iter()
            .map(|k| {
                let mut law = model();
                law.tissue.layers[0].stiffness_n_per_m = *k;
                law.tissue.layers[0].thickness_m = 0.02 + (k - 153.0) * 1e-5;
                HeldOutPrediction {
                    population: Some(Population {
                        model: law,
                        residual_n: [0.0; 4],
                        residual_quantiles_n: [[0.0; QUANTILES]; 4],
                        air_quantiles_n: [0.0; QUANTILES],
                        recordings: 3,
                        days: 1,
                        parameter_information: None,
                    }),
                    ..HeldOutPrediction::default()
                }
            })
            .chain([HeldOutPrediction::default()])
            .collect();
        let told = jackknife_estimates(&fitted(model()), &out);
        let of = |owner: &str, path: &str| {
            told.iter().find(|t| t.owner == owner && t.path == path).expect("a number")
        };
        let k = of("layer.1", "stiffness_n_per_m");
        let sum: f64 = left.iter().map(|x| (x - 153.0_f64).powi(2)).sum();
        let reach = student_t::quantile(0.975, 3.0) * (sum * 3.0 / 4.0).sqrt();
        assert!((k.value - 150.0).abs() < 1e-12);
        assert!(
            (k.high - 150.0 - reach).abs() < 1e-9 && (150.0 - k.low - reach).abs() < 1e-9,
            "{k:?} for {reach}"
        );
        // The face behind moves with the thickness.
        let front = of("layer.2", "front_m");
        assert!((front.value - 0.022).abs() < 1e-12 && (front.high - 0.022 - reach * 1e-5).abs() < 1e-12);
        let same = of("layer.2", "stiffness_n_per_m");
        assert_eq!((same.low, same.high), (220.0, 220.0));
        assert_eq!((k.estimate().low, k.estimate().value, k.estimate().high), (k.low, k.value, k.high));
        // One run left out tells nothing: the interval is as wide as the number.
        let one = jackknife_estimates(&fitted(model()), &out[..1]);
        let k = one.iter().find(|t| t.path == "stiffness_n_per_m").expect("a number");
        assert_eq!((k.low, k.high), (0.0, 300.0));
    }

    #[test]
    fn numbers_are_told_in_the_order_of_the_law_with_their_owners() {
        let mut m = model();
        let effects: [AnyEffect; 3] = [
            ReleaseDepth { layer: 1, depth_m: 1e-3 }.into(),
            DelayedPuncture { layer: 1, force_n: 2.0, exponent: 9.0 }.into(),
            ReleaseDepth { layer: 2, depth_m: 2e-3 }.into(),
        ];
        m.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
        let all = values(&m);
        let names: Vec<String> = all.iter().map(|(o, p, _, _)| format!("{o} {p}")).collect();
        assert_eq!(
            names,
            [
                "layer.0 surface_m",
                "layer.1 front_m",
                "layer.1 stiffness_n_per_m",
                "layer.1 friction_ns_per_m2",
                "layer.1 puncture_n",
                "layer.2 front_m",
                "layer.2 stiffness_n_per_m",
                "layer.2 friction_ns_per_m2",
                "release_depth 0.layer",
                "release_depth 0.depth_m",
                "delayed_puncture layer",
                "delayed_puncture force_n",
                "delayed_puncture exponent",
                "release_depth 1.layer",
                "release_depth 1.depth_m",
            ]
        );
        let numbers: Vec<f64> = all.iter().map(|v| v.2).collect();
        assert_eq!(numbers[..8], [0.002, 0.002, 150.0, 4000.0, 1.1, 0.022, 220.0, 4000.0]);
        assert_eq!(numbers[8..], [1.0, 1e-3, 1.0, 2.0, 9.0, 2.0, 2e-3]);
        assert!(all.iter().all(|v| !v.3), "{all:?}");
    }

    #[test]
    fn a_number_stands_at_its_bound_within_a_thousandth_of_the_range() {
        let m = model();
        for (path, at) in [
            ("surface_m", 0),
            ("stiffness_n_per_m", 2),
            ("friction_ns_per_m2", 3),
            ("puncture_n", 4),
            ("front_m", 5),
        ] {
            let role = match path {
                "surface_m" => stylet_identify::model::ParameterRole::Surface,
                "stiffness_n_per_m" => stylet_identify::model::ParameterRole::Stiffness(0),
                "friction_ns_per_m2" => stylet_identify::model::ParameterRole::Friction(0),
                "puncture_n" => stylet_identify::model::ParameterRole::Puncture(0),
                _ => stylet_identify::model::ParameterRole::Thickness(0),
            };
            let n = m.shared_parameters().into_iter().find(|n| n.role == role).expect("free");
            let near = 1e-3 * (n.high - n.low).min(1.0);
            for (x, reached) in [
                (n.low + 0.9 * near, true),
                (n.low + 1.1 * near, false),
                (n.high - 0.9 * near, true),
                (n.high - 1.1 * near, false),
            ] {
                let mut moved = m.clone();
                moved.set(role, 0, x);
                let all = values(&moved);
                assert_eq!(all[at].3, reached, "{path} at {x} of {} to {}", n.low, n.high);
                // The first front is no thickness.
                assert!(!all[1].3);
            }
        }
        // A number that goes with another one's stands where that one stands.
        let mut m = model();
        let waits =
            |force_n: f64, layer| -> AnyEffect { DelayedPuncture { layer, force_n, exponent: 9.0 }.into() };
        m.effects = [waits(2.0, 1), waits(2.0, 2)]
            .iter()
            .map(|e| EffectTerm::new(e.info(), &e.parameters()))
            .collect();
        m.tied = vec![TiedParameter { effect: 1, parameter: 2, tied_to: Some(0) }];
        let high = m.effects[0].info.parameters[2].high;
        assert!(high.is_finite());
        m.effects[0].values[2] = high;
        let at = |m: &Model, path: &str| values(m).into_iter().find(|v| v.1 == path).map(|v| v.3);
        assert_eq!(
            (at(&m, "0.exponent"), at(&m, "1.exponent"), at(&m, "1.force_n")),
            (Some(true), Some(true), Some(false))
        );
        // Its other numbers stand for themselves.
        m.effects[0].values[1] = m.effects[0].info.parameters[1].low;
        assert_eq!((at(&m, "0.force_n"), at(&m, "1.force_n")), (Some(true), Some(false)));
        assert_eq!(at(&m, "0.layer"), Some(false), "which layer is no number of a fit");
    }

    #[test]
    fn base_parameters_stand_beside_what_was_believed() {
        let mut law = model();
        law.tissue.surface_m = 0.003;
        law.tissue.layers[0].stiffness_n_per_m = 190.0;
        let out: Vec<HeldOutPrediction> = [-1.0, 1.0]
            .iter()
            .map(|x| {
                let mut other = law.clone();
                other.tissue.layers[0].stiffness_n_per_m += 2.5 * x;
                other.tissue.layers[1].stiffness_n_per_m += 2.5 * x;
                HeldOutPrediction {
                    population: Some(Population {
                        model: other,
                        residual_n: [0.0; 4],
                        residual_quantiles_n: [[0.0; QUANTILES]; 4],
                        air_quantiles_n: [0.0; QUANTILES],
                        recordings: 3,
                        days: 1,
                        parameter_information: None,
                    }),
                    ..HeldOutPrediction::default()
                }
            })
            .collect();
        let mut m = law.clone();
        m.effects = vec![EffectTerm::new(ReleaseDepth { layer: 1, depth_m: 1e-3 }.info(), &[1.0, 1e-3])];
        let base = base_parameters(&jackknife_estimates(&fitted(m), &out), &tissue());
        let told: Vec<(usize, &str, f64, bool)> =
            base.iter().map(|b| (b.layer, b.name.as_str(), b.assumed, b.changed)).collect();
        assert_eq!(
            told,
            [
                (0, "surface_m", 0.002, true),
                (1, "front_m", 0.002, true),
                (1, "stiffness_n_per_m", 150.0, true),
                (1, "friction_ns_per_m2", 4000.0, false),
                (1, "puncture_n", 1.1, false),
                (2, "front_m", 0.022, true),
                (2, "stiffness_n_per_m", 220.0, false),
                (2, "friction_ns_per_m2", 4000.0, false),
            ]
        );
        let k = &base[2];
        // Two that differ by 5: half of that is the error, Student's with one degree of freedom.
        let reach = student_t::quantile(0.975, 1.0) * 2.5;
        assert!((k.value - 190.0).abs() < 1e-12 && (k.high - 190.0 - reach).abs() < 1e-9, "{k:?}");
        assert!(reach > 30.0 && reach < 40.0);
    }
}
