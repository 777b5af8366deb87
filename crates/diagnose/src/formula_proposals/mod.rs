//! Proposes formulas for a force that no effect of the library explains.
//!
//! The residual of the final model is regressed on functions of one variable (time, position, velocity, ...), after projection onto the
//! complement of the fitted parameters. Every regression is judged by the nats it gains on recordings that were left out. First, piecewise
//! linear functions of every variable show which one carries the residual; then formulas are built from up to two terms of it
//! (orthogonal matching pursuit: Pati, Rezaiifar and Krishnaprasad 1993). The best ones are fitted together with the model, as custom
//! effects, and predict the held-out recordings. They are effects to try, not a verdict.

mod regression;
mod term;

use crate::diagnosis_json::{CarryingVariable, ProposedFormula, ProposedFormulas, ResidualCurve};
use crate::held_out::{held_out_residuals, pooled_rms};
use regression::{Regression, Solution};
use stylet_identify::fit::{Effort, Fit, fit};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{EffectTerm, Model};
use stylet_stats::normal::Z95;
use stylet_stats::parallel::*;
use stylet_tissue::{AnyEffect, Custom, CustomText, NamedList, ParameterText, Place, Prior};
use term::{Carrier, Factor, NamedValue, Sample, Shape, Variable};

/// Numbers of intervals of the piecewise linear functions: a smooth function, and one that varies quickly.
const INTERVALS: [usize; 2] = [16, 80];
/// Variables, with their factors, from which formulas are built.
const MAX_CARRIERS: usize = 4;
/// Share of the largest gain that a variable must reach for formulas to be built from it.
const MIN_SHARE: f64 = 0.5;
/// Terms of a formula; eight parameters are possible, and a term has at most three.
const MAX_TERMS: usize = 2;
/// Proposals that are returned.
const MAX_PROPOSALS: usize = 5;
/// Smallest gain (nats) of a variable, or of another term, on recordings that were left out.
const MIN_TERM_NATS: f64 = 3.0;
/// Share by which a formula, or its second term, must lower the held-out error.
const MIN_ERROR_GAIN: f64 = 0.02;

/// Formulas for what `model` leaves in the residual, best held-out prediction first, and their effects. `None` with one recording.
pub(crate) fn propose_formulas(
    model: &Fit,
    data: &FitData,
    held_out_n: f64,
    progress: &mut dyn FnMut(&str),
) -> Option<(ProposedFormulas, Vec<AnyEffect>)> {
    if data.recording_count() < 2 {
        return None;
    }
    progress("proposing formulas for the residual");
    // Every block with the noise alone: reweighting would hide the force.
    let plain = data.recordings.iter().map(|b| b.clone().with_unmodelled_sd(Vec::new())).collect();
    let data = &data.with_recordings(plain);
    let model = &fit(&model.model, data, Effort::SHORT)?;
    let regression = Regression::new(model, data);
    let surface_m = model.model.tissue.surface_m;
    let samples: Vec<Vec<Sample>> =
        data.recordings.iter().map(|b| Sample::of_recording(b, surface_m)).collect();
    let ranked = rank_carriers(&regression, data, &samples);
    let best = ranked.first()?;
    let curve = best.curve();
    let carriers: Vec<&Ranked> =
        ranked.iter().filter(|r| r.nats > MIN_SHARE * best.nats).take(MAX_CARRIERS).collect();
    let mut found: Vec<(ProposedFormula, AnyEffect)> = Vec::new();
    for (number, ranked) in carriers.iter().enumerate() {
        let mut best_n = held_out_n;
        for (formula, fit) in fitted_formulas(model, data, &samples, ranked, number) {
            let error_n = pooled_rms(&held_out_residuals(&fit, data), data);
            if error_n >= (1.0 - MIN_ERROR_GAIN) * best_n {
                continue;
            }
            // A text that is refused, such as one whose strength has vanished, is no proposal.
            if let Ok(effect) = Custom::from_text(&formula.text()) {
                found.push((formula.report(error_n), effect.into()));
                best_n = error_n;
            }
        }
    }
    found.sort_by(|a, b| a.0.held_out_n.total_cmp(&b.0.held_out_n));
    found.truncate(MAX_PROPOSALS);
    let (proposals, effects) = found.into_iter().unzip();
    // Every variable once, with its best factor.
    let first =
        |(k, r): &(usize, &Ranked)| ranked[..*k].iter().all(|o| o.carrier.variable != r.carrier.variable);
    let variables = ranked.iter().enumerate().filter(first).map(|(_, r)| r.report()).collect();
    Some((ProposedFormulas { variables, curve, proposals }, effects))
}

/// A carrier with the piecewise linear function that gains most.
struct Ranked {
    carrier: Carrier,
    range: (f64, f64),
    nats: f64,
    knots: Vec<f64>,
    solution: Solution,
}

impl Ranked {
    fn report(&self) -> CarryingVariable {
        CarryingVariable {
            variable: self.carrier.variable.name().to_owned(),
            factor: self.carrier.factor.times("f"),
            gain_nats: self.nats,
        }
    }

    fn curve(&self) -> ResidualCurve {
        let around = |sign: f64| {
            let both = self.solution.coefficients.iter().zip(&self.solution.standard_errors);
            both.map(|(x, e)| x + sign * Z95 * e).collect()
        };
        ResidualCurve {
            variable: self.carrier.variable.name().to_owned(),
            unit: self.carrier.variable.unit(),
            factor: self.carrier.factor.times("f"),
            x: self.knots.clone(),
            value: self.solution.coefficients.clone(),
            low: around(-1.0),
            high: around(1.0),
        }
    }
}

/// Carriers that gain on recordings that were left out, largest gain first.
fn rank_carriers(regression: &Regression, data: &FitData, samples: &[Vec<Sample>]) -> Vec<Ranked> {
    let mut ranked: Vec<Ranked> = Vec::new();
    for variable in Variable::ALL {
        let of_factor = |factor: &Factor| {
            let carrier = Carrier { variable, factor: *factor };
            let range = range_of(carrier, data, samples)?;
            let tried = INTERVALS.iter().filter_map(|count| {
                let step = (range.1 - range.0) / *count as f64;
                let knots: Vec<f64> = (0..=*count).map(|k| range.0 + k as f64 * step).collect();
                let hats = knots.par_iter().map(|knot| {
                    let hat = |x: f64| (1.0 - ((x.clamp(range.0, range.1) - knot) / step).abs()).max(0.0);
                    regression.column(&values(carrier, samples, hat))
                });
                let columns: Vec<_> = hats.collect();
                let solution = regression.solve(&columns)?;
                Some(Ranked { carrier, range, nats: solution.held_out_nats, knots, solution })
            });
            tried.max_by(|a, b| a.nats.total_cmp(&b.nats))
        };
        ranked.extend(Factor::ALL.iter().filter_map(of_factor).filter(|r| r.nats > MIN_TERM_NATS));
    }
    ranked.sort_by(|a, b| b.nats.total_cmp(&a.nats));
    ranked
}

/// Range of the variable over the compared blocks where the factor is not zero, without the outermost per mille on either side.
fn range_of(carrier: Carrier, data: &FitData, samples: &[Vec<Sample>]) -> Option<(f64, f64)> {
    let blocks = data.recordings.iter().zip(samples).flat_map(|(b, s)| b.used.iter().zip(s));
    let mut x: Vec<f64> = blocks
        .filter(|(used, _)| **used)
        .map(|(_, s)| carrier.of(s))
        .filter(|(_, factor)| *factor != 0.0)
        .map(|(x, _)| x)
        .collect();
    x.sort_unstable_by(f64::total_cmp);
    let out = x.len() / 1000;
    let (low, high) = (*x.get(out)?, *x.get(x.len().checked_sub(out + 1)?)?);
    (high > low).then_some((low, high))
}

/// A function of the carrier's variable, times its factor, per block.
fn values(carrier: Carrier, samples: &[Vec<Sample>], function: impl Fn(f64) -> f64) -> Vec<Vec<f64>> {
    let of = |s: &Sample| {
        let (x, factor) = carrier.of(s);
        factor * function(x)
    };
    samples.iter().map(|s| s.iter().map(of).collect()).collect()
}

/// A formula with its parameters.
#[derive(Clone)]
struct Formula {
    name: String,
    carrier: Carrier,
    terms: Vec<String>,
    parameters: Vec<NamedValue>,
}

impl Formula {
    /// The force as a formula.
    fn force(&self) -> String {
        self.carrier.factor.times(&self.terms.join(" + "))
    }

    /// The formula as a custom effect.
    fn text(&self) -> CustomText {
        let parameters = self.parameters.iter().map(|p| {
            let strength = p.prior.is_none();
            // A strength may have either sign.
            let prior = p.prior.unwrap_or(Prior::Normal { mean: 0.0, sd: 3.0 * p.value.abs() });
            let text = ParameterText {
                start: p.value,
                value: None,
                prior: Some(prior),
                unit: p.unit.clone(),
                inactive: strength.then_some(0.0),
                meaning: String::new(),
            };
            (p.name.clone(), text)
        });
        let path = self.carrier.variable == Variable::Path;
        let state = path.then(|| ("path".to_owned(), "dpath/dt = abs(v)".to_owned()));
        CustomText {
            name: self.name.clone(),
            place: Place::Tip,
            force: Some(self.force()),
            parameters: NamedList(parameters.collect()),
            state: NamedList(state.into_iter().collect()),
            source: String::new(),
        }
    }

    /// Fits the formula as the last effect of a model, and takes over the fitted values.
    fn fit(&mut self, model: &Model, data: &FitData) -> Option<Fit> {
        let effect = Custom::from_text(&self.text()).ok()?;
        let term = EffectTerm::new(effect.entry(), effect.values());
        let fitted = fit(&model.with_effect(term), data, Effort::FULL)?;
        let values = &fitted.model.effects.last()?.values;
        for (parameter, value) in self.parameters.iter_mut().zip(values) {
            parameter.value = *value;
        }
        Some(fitted)
    }

    fn report(&self, held_out_n: f64) -> ProposedFormula {
        ProposedFormula {
            name: self.name.clone(),
            formula: self.force(),
            variable: self.carrier.variable.name().to_owned(),
            parameters: self.parameters.iter().map(|p| (p.name.clone(), p.value)).collect(),
            complexity: self.parameters.len(),
            held_out_n,
        }
    }
}

/// Formulas of one, two, ... terms of a carrier, each the extension of the one before that gains most, fitted with the model.
fn fitted_formulas(
    model: &Fit,
    data: &FitData,
    samples: &[Vec<Sample>],
    ranked: &Ranked,
    number: usize,
) -> Vec<(Formula, Fit)> {
    let carrier = ranked.carrier;
    let mut shapes = Shape::all(ranked.range.0, ranked.range.1);
    let mut formula = Formula { name: String::new(), carrier, terms: Vec::new(), parameters: Vec::new() };
    let mut out: Vec<(Formula, Fit)> = Vec::new();
    for k in 1..=MAX_TERMS {
        let regression = Regression::new(out.last().map_or(model, |last| &last.1), data);
        let tried: Vec<Option<(Shape, Solution)>> = shapes
            .par_iter()
            .map(|shape| {
                let functions = shape.functions();
                let columns: Vec<_> =
                    functions.iter().map(|f| regression.column(&values(carrier, samples, f))).collect();
                regression.solve(&columns).map(|solution| (*shape, solution))
            })
            .collect();
        let best = tried.into_iter().flatten().max_by(|a, b| a.1.held_out_nats.total_cmp(&b.1.held_out_nats));
        let Some((shape, solution)) = best.filter(|b| b.1.held_out_nats > MIN_TERM_NATS) else { break };
        // A second term of the same form without shape parameters would be the same function.
        shapes.retain(|s| *s != shape);
        let (term, parameters) = shape.formula(k, carrier, &solution.coefficients);
        formula.name = format!("proposal_{}", number * MAX_TERMS + k);
        formula.terms.push(term);
        formula.parameters.extend(parameters);
        let Some(fitted) = formula.fit(&model.model, data) else { break };
        out.push((formula.clone(), fitted));
    }
    out
}
