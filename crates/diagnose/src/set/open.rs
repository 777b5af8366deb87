//! What recordings leave open of the law itself.
//!
//! Around the best fit the nats are a bowl: its curvature tells how far the numbers may be off, and with which others (Laplace). Numbers
//! of days are among them, so that a number which only differs from day to day, like the rate of a hold, is as open as the days leave
//! it. Laws draw their bowls with kinks; a draw that costs more nats than its bowl allows is taken back towards the fit.

use crate::set::fitted::Fitted;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use stylet_identify::fit::Tangent;
use stylet_identify::model::{Model, Number, Role};
use stylet_identify::objective::residuals;

/// Laws that are drawn, each together with its mirror image at the fit, so that their mean stays there.
const LAWS: u64 = 16;
/// A draw is halved so many times at most.
const HALVED: usize = 6;
/// Nats that are no matter.
const SLACK: f64 = 0.5;

/// Laws as likely as the fit leaves them.
#[derive(Clone, Debug)]
pub struct Open {
    numbers: Vec<Number>,
    /// Steps of the numbers from the fit.
    steps: Vec<Vec<f64>>,
}

impl Open {
    /// What a fit leaves open.
    #[must_use]
    pub fn of(fitted: &Fitted) -> Self {
        let (model, data) = (&fitted.fit.model, &fitted.data);
        let tangent = Tangent::new(model, data, &fitted.fit.residuals);
        // Ruptures stay where they were seen: a derivative sees the block alone in which one lies.
        let (shared, own) = (tangent.shared.len(), tangent.own.len());
        let timed =
            |i: &usize| *i >= shared && matches!(tangent.own[(i - shared) % own].role, Role::Instant(_));
        let size = shared + own * data.recordings();
        let places: Vec<usize> = (0..size).filter(|i| !timed(i)).collect();
        let factor = tangent.matrix.part(&places).factor();
        let stands = fitted.fit.nats();
        let moved = |step: &[f64], share: f64| {
            let mut out = model.clone();
            move_by(&mut out, &tangent.shared, step, share, 0);
            for r in 0..data.recordings() {
                let at = tangent.place(0, r);
                move_by(&mut out, &tangent.own, step.get(at..).unwrap_or_default(), share, r);
            }
            out
        };
        let one = |k: u64| {
            let mut rng = ChaCha8Rng::seed_from_u64(k);
            let z: Vec<f64> = (0..factor.size()).map(|_| StandardNormal.sample(&mut rng)).collect();
            let bowl: f64 = 0.5 * z.iter().map(|z| z * z).sum::<f64>();
            let mut step = vec![0.0; size];
            places.iter().zip(factor.back(&z)).for_each(|(i, x)| step[*i] = x);
            let mut share = 1.0;
            for _ in 0..HALVED {
                let costs = |share: f64| {
                    residuals(&moved(&step, share), data).map_or(f64::INFINITY, |r| r.nats - stands)
                };
                if costs(share).max(costs(-share)) <= bowl + SLACK {
                    return step[..shared].iter().map(|x| share * x).collect();
                }
                share *= 0.5;
            }
            vec![0.0; shared]
        };
        let steps = (0..LAWS).into_par_iter().map(one).collect();
        Self { numbers: tangent.shared.clone(), steps }
    }

    /// Moves a model to the `k`-th law.
    pub fn draw(&self, k: usize, model: &mut Model) {
        let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        if let Some(step) = self.steps.get(k / 2 % self.steps.len().max(1)) {
            move_by(model, &self.numbers, step, sign, 0);
        }
    }
}

/// Moves the numbers of a recording by a share of a step, within their bounds.
fn move_by(model: &mut Model, numbers: &[Number], step: &[f64], share: f64, r: usize) {
    for (n, step) in numbers.iter().zip(step) {
        let x = model.get(n.role, r);
        if x.is_finite() && step.is_finite() {
            model.set(n.role, r, (x + share * step).clamp(n.low, n.high));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{LAWS, Open};
    use crate::made;
    use crate::set::Insertion;
    use stylet_identify::fit::Tangent;
    use stylet_identify::model::Role;

    #[test]
    fn laws_scatter_about_the_fit_as_its_curvature_says() {
        let runs = made::insertions(&[], &[[0.008, 0.0], [0.016, 1e-4], [0.008, -1e-4]]);
        let runs: Vec<&Insertion> = runs.iter().collect();
        let fitted = made::settled(&[], &runs);
        let model = &fitted.fit.model;
        let open = Open::of(&fitted);
        let tangent = Tangent::new(model, &fitted.data, &fitted.fit.residuals);
        // But for the instants, which come last of a recording's own two.
        let places: Vec<usize> = (0..tangent.factor().size())
            .filter(|i| *i < tangent.shared.len() || (i - tangent.shared.len()) % 3 < 2)
            .collect();
        assert!(tangent.own.len() == 3 && tangent.own[2].role == Role::Instant(0));
        let variances = tangent.matrix.part(&places).factor().inverse_diagonal();
        for (i, n) in tangent.shared.iter().enumerate().filter(|(i, _)| variances[*i].is_finite()) {
            let stands = model.get(n.role, 0);
            let moved: Vec<f64> = (2..2 + 2 * LAWS as usize)
                .map(|k| {
                    let mut m = model.clone();
                    open.draw(k, &mut m);
                    m.get(n.role, 0) - stands
                })
                .collect();
            // Each with its mirror image.
            assert!(moved.iter().sum::<f64>().abs() < 1e-6 * stands.abs().max(1e-3), "{:?}", n.role);
            let square = moved.iter().map(|x| x * x).sum::<f64>() / moved.len() as f64;
            let ratio = (square / variances[i]).sqrt();
            assert!((0.6..1.4).contains(&ratio), "{:?}: {ratio}", n.role);
        }
        // The same every time.
        let (mut a, mut b) = (model.clone(), model.clone());
        open.draw(5, &mut a);
        Open::of(&fitted).draw(5, &mut b);
        assert_eq!(a.tissue, b.tissue);
    }
}
