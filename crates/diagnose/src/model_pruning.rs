//! Simplifies and extends a selected model: removes superfluous effects and tries extended forms.

use crate::base_law_fit::with_updated_times;
use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty, likelihood_gain};
use crate::selection_state::Search;
use stylet_identify::fit::{Effort, Fit, Linearization, fit};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{EffectTerm, ParameterRole};
use stylet_stats::parallel::*;
use stylet_tissue::{FitScale, Proposal};

/// Standard deviations by which a determined strength differs from its inactive value.
const MIN_STRENGTH_SD: f64 = 5.0;

impl Search {
    /// Replaces effects by their extended form (such as a second relaxation time constant) if its gain exceeds the BIC penalty. The
    /// extended form is the same cause, so no further gain is required.
    pub(crate) fn use_extended_forms(&mut self, times: &[Vec<f64>]) {
        for k in 0..self.best.model.effects.len() {
            let Some(larger) = self.best.model.effects[k].info.extended else { continue };
            let Proposal::SplitTerm(starts) = larger.proposal else { continue };
            let coarse = self.coarse();
            let values = &self.best.model.effects[k].values;
            let extended = |factors: &&[f64]| {
                let mut model = self.best.model.clone();
                let split: Vec<f64> = values.iter().cycle().zip(*factors).map(|(v, f)| v * f).collect();
                model.effects[k] = EffectTerm::new(larger, &split);
                fit(&model, &coarse, Effort::SHORT)
            };
            let tried: Vec<Fit> = starts.par_iter().filter_map(extended).collect();
            let likeliest = tried.into_iter().min_by(|a, b| a.nats().total_cmp(&b.nats()));
            let full = likeliest
                .and_then(|f| fit(&with_updated_times(f.model, &self.data, times), &self.data, Effort::FULL));
            if let Some(f) = full
                && !effect_at_bound(&f, k)
                && strengths_are_determined(&f, k, &self.data)
                && likelihood_gain(&self.best, &f, &self.data)
                    > bic_penalty(
                        f.model.effect_parameter_count() - self.best.model.effect_parameter_count(),
                        self.data.compared_block_count(),
                    )
            {
                self.accept(f);
            }
        }
    }

    /// Removes effects whose gain is below their penalty.
    pub(crate) fn prune(&mut self) {
        self.drop_confounded_clocks();
        loop {
            let n = self.best.model.effects.len();
            if n < 2 {
                return;
            }
            let reduced: Vec<Fit> = (0..n)
                .into_par_iter()
                .filter_map(|k| fit(&self.best.model.without_effect(k), &self.data, Effort::FULL))
                .collect();
            let surplus = |f: &Fit| {
                likelihood_gain(f, &self.best, &self.data) - required_gain_nats(f, &self.best, &self.data)
            };
            let worst = reduced.into_iter().map(|f| (surplus(&f), f)).min_by(|a, b| a.0.total_cmp(&b.0));
            match worst {
                Some((surplus, f)) if surplus < 0.0 => self.accept(f),
                _ => return,
            }
        }
    }
}

/// Gain (nats) required of the additional parameters of `larger`.
pub fn required_gain_nats(smaller: &Fit, larger: &Fit, data: &FitData) -> f64 {
    let more = larger.model.effect_parameter_count().saturating_sub(smaller.model.effect_parameter_count());
    bic_penalty(more, data.compared_block_count()) + MIN_GAIN_NATS
}

/// Whether each strength of an effect is significant by itself; two terms that replace one could share its strength arbitrarily.
pub(crate) fn strengths_are_determined(f: &Fit, which: usize, data: &FitData) -> bool {
    let linearization = Linearization::new(&f.model, data, &f.residuals);
    let variances = linearization.factor().inverse_diagonal();
    linearization.shared.iter().zip(variances).all(|(n, variance)| match n.role {
        ParameterRole::Effect { effect, parameter } if effect == which => {
            let p = &f.model.effects[which].info.parameters[parameter];
            let off = f.model.effects[which].values[parameter] - p.inactive;
            !p.strength || p.fit_scale() != FitScale::Linear || off.abs() > MIN_STRENGTH_SD * variance.sqrt()
        }
        _ => true,
    })
}

/// Whether a parameter of an effect is at a bound.
pub fn effect_at_bound(f: &Fit, which: usize) -> bool {
    f.model.shared_parameters().iter().any(|n| match n.role {
        ParameterRole::Effect { effect, .. } if effect == which => {
            let x = f.model.get(n.role, 0);
            let near = 1e-6 * (n.high - n.low);
            near.is_finite() && (x <= n.low + near || x >= n.high - near)
        }
        _ => false,
    })
}
