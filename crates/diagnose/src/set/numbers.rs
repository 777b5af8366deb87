//! The numbers of a law with intervals: how they change when runs are left out.

use crate::outcome::{BaseParameter, Estimate};
use crate::set::fitted::Fitted;
use crate::set::left_out::Out;
use std::collections::BTreeMap;
use stylet_identify::model::{Model, Role};
use stylet_stats::{sd, student};
use stylet_tissue::Tissue;

/// A number so near to its bound (share of the range, at most this much) stands at it.
const NEAR: f64 = 1e-3;

/// One number of a law.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
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

impl Told {
    /// Value and interval.
    #[must_use]
    pub fn estimate(&self) -> Estimate {
        Estimate { value: self.value, low: self.low, high: self.high }
    }
}

/// Values by owner and path, with bounds of the paths and whether they are reached.
fn values(model: &Model) -> Vec<(String, String, f64, bool)> {
    let reached = |role: Role| {
        model.shared().iter().find(|n| n.role == role).is_some_and(|n| {
            let (x, near) = (model.get(role, 0), NEAR * (n.high - n.low).min(1.0));
            x <= n.low + near || x >= n.high - near
        })
    };
    let mut out = Vec::new();
    let mut tell =
        |owner: String, path: &str, value: f64, bound: bool| out.push((owner, path.to_owned(), value, bound));
    tell("layer.0".to_owned(), "surface_m", model.tissue.surface_m, reached(Role::Surface));
    for (l, layer) in model.tissue.layers.iter().enumerate() {
        let owner = format!("layer.{}", l + 1);
        tell(owner.clone(), "front_m", model.tissue.front_m(l), l > 0 && reached(Role::Thickness(l - 1)));
        tell(owner.clone(), "stiffness_n_per_m", layer.stiffness_n_per_m, reached(Role::Stiffness(l)));
        tell(owner.clone(), "friction_ns_per_m2", layer.friction_ns_per_m2, reached(Role::Friction(l)));
        if let Some(force) = layer.puncture_n {
            tell(owner, "puncture_n", force, reached(Role::Puncture(l)));
        }
    }
    let many = |id: &str| model.effects.iter().filter(|c| c.info.id == id).count() > 1;
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for (effect, choice) in model.effects.iter().enumerate() {
        let id = choice.info.id;
        let k = seen.entry(id).or_insert(0);
        for (parameter, p) in choice.info.parameters.iter().enumerate() {
            let path = if many(id) { format!("{k}.{}", p.path) } else { p.path.to_owned() };
            let like = model.bound.iter().find(|b| b.effect == effect && b.parameter == parameter);
            let role = Role::Effect { effect: like.and_then(|b| b.like).unwrap_or(effect), parameter };
            tell(id.to_owned(), &path, choice.values[parameter], !p.whole && reached(role));
        }
        *k += 1;
    }
    out
}

/// The numbers of a law with their 95 % intervals by the jackknife over runs (Quenouille, Tukey): how they change when runs are
/// left out, which counts what one law cannot say about all of them.
#[must_use]
pub fn estimates(fitted: &Fitted, out: &[Out]) -> Vec<Told> {
    let others: Vec<_> = out.iter().filter_map(|o| o.population.as_ref()).map(|p| values(&p.law)).collect();
    let n = others.len() as f64;
    values(&fitted.fit.model)
        .into_iter()
        .enumerate()
        .map(|(i, (owner, path, value, at_bound))| {
            let all: Vec<f64> = others.iter().filter_map(|o| o.get(i)).map(|o| o.2).collect();
            // The sample variance divides by n - 1; the jackknife's is (n - 1)/n times the sum of squares.
            let error = if all.len() > 1 { sd(&all) * (n - 1.0) / n.sqrt() } else { f64::NAN };
            let reach = student::quantile(0.975, (n - 1.0).max(1.0)) * error;
            let reach = if reach.is_finite() { reach } else { value.abs() };
            Told { owner, path, value, low: value - reach, high: value + reach, at_bound }
        })
        .collect()
}

/// The base parameters among the numbers, beside what was believed.
#[must_use]
pub fn base_parameters(told: &[Told], believed: &Tissue) -> Vec<BaseParameter> {
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
