//! Tests the held-out loss without a term of a model; recordings are the independent units.

use super::cross_validation::{PHASE_NAMES, PredictionScore};
use stylet_stats::student_t;

/// Relative growth of the held-out error without an effect from which the effect is kept, if significant. It covers selection bias: models
/// without the effect had fewer start values.
pub(super) const MIN_EFFECT_LOSS: f64 = 0.05;
/// Significance level for reporting an effect by held-out loss. Stick-slip, delayed puncture and release are tested, so a set has about 1 %
/// false positives.
const FALSE_POSITIVE_LEVEL: f64 = 0.005;

/// Probability that errors `without` a term exceed those `with` it (one-sided paired t test over
/// recordings).
pub(super) fn paired_confidence(without: &[f64], with: &[f64]) -> f64 {
    let differences: Vec<f64> =
        without.iter().zip(with).map(|(a, b)| a - b).filter(|d| d.is_finite()).collect();
    if differences.len() < 2 {
        return f64::from(u8::from(!without.is_empty() && differences.is_empty()));
    }
    let error = stylet_stats::sd(&differences) / (differences.len() as f64).sqrt();
    student_t::cdf(stylet_stats::mean(&differences) / error.max(1e-9), differences.len() as f64 - 1.0)
}

/// Relative loss per recording `without` a term: difference of the squared errors, each phase scaled by its mean square over all
/// recordings. This is the likelihood of phase-wise noise: the time of a puncture is more random than a hold.
pub(super) fn relative_losses(
    without: &[Option<PredictionScore>],
    with: &[Option<PredictionScore>],
) -> Vec<f64> {
    let mut left = [(0.0, 0.0); PHASE_NAMES.len()];
    for s in with.iter().flatten() {
        for (sum, part) in left.iter_mut().zip(s.phase_squares) {
            *sum = (sum.0 + part.0, sum.1 + part.1);
        }
    }
    let one = |(without, with): (&Option<PredictionScore>, &Option<PredictionScore>)| match (without, with) {
        (_, None) => 0.0,
        (None, _) => f64::INFINITY,
        (Some(without), Some(with)) => {
            let samples: f64 = with.phase_squares.iter().map(|p| p.1).sum();
            let more = |k: usize| {
                let square = left[k].0 / f64::max(left[k].1, 1.0);
                if square > 0.0 {
                    (without.phase_squares[k].0 - with.phase_squares[k].0) / square
                } else {
                    0.0
                }
            };
            (0..PHASE_NAMES.len()).map(more).sum::<f64>() / samples.max(1.0)
        }
    };
    without.iter().zip(with).map(one).collect()
}

/// Whether the mean loss is at least `min_loss` and exceeds one standard error over the recordings.
pub(super) fn exceeds_standard_error(losses: &[f64], min_loss: f64) -> bool {
    exceeds(losses, min_loss, 1.0)
}

/// Whether an effect is significant in a one-sided t test, which accounts for the uncertain standard error of few recordings.
pub(super) fn is_significant(losses: &[f64]) -> bool {
    let dof = losses.len().saturating_sub(1).max(1) as f64;
    exceeds(losses, MIN_EFFECT_LOSS, student_t::quantile(1.0 - FALSE_POSITIVE_LEVEL, dof))
}

/// Whether the mean loss is at least `min_loss` and exceeds `standard_errors` standard errors.
fn exceeds(losses: &[f64], min_loss: f64, standard_errors: f64) -> bool {
    let mean = stylet_stats::mean(losses);
    let error = stylet_stats::sd(losses) / (losses.len() as f64).sqrt();
    // The relative loss of squares is twice that of RMS errors.
    mean >= 2.0 * min_loss && (mean == f64::INFINITY || mean > standard_errors * error)
}

#[cfg(test)]
mod tests {
    use super::{
        MIN_EFFECT_LOSS, exceeds_standard_error, is_significant, paired_confidence, relative_losses,
    };
    use crate::repeated_insertions::cross_validation::PredictionScore;

    #[test]
    fn confidence_is_a_one_sided_paired_t_probability() {
        let (without, with) = ([0.5, 0.7, 0.4, 0.9], [0.45, 0.5, 0.42, 0.6]);
        let d: [f64; 4] = std::array::from_fn(|k| without[k] - with[k]);
        let mean = d.iter().sum::<f64>() / 4.0;
        let sd = (d.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 3.0).sqrt();
        let wanted = stylet_stats::student_t::cdf(mean / (sd / 2.0), 3.0);
        assert!((paired_confidence(&without, &with) - wanted).abs() < 1e-12);
        let more: Vec<f64> = without.iter().copied().chain([f64::INFINITY]).collect();
        assert!((paired_confidence(&more, &[&with[..], &[0.5]].concat()) - wanted).abs() < 1e-12);
        assert_eq!(paired_confidence(&[f64::INFINITY; 3], &with[..3]), 1.0);
        assert_eq!((paired_confidence(&[], &[]), paired_confidence(&[0.5], &[0.4])), (0.0, 0.0));
        // Two recordings suffice: worse by 1 and by 3 is 2 with a standard error of 1.
        assert_eq!(paired_confidence(&[1.5, 3.5], &[0.5, 0.5]), stylet_stats::student_t::cdf(2.0, 1.0));
    }

    /// By hand: 4 and 1 N² of 100 samples each in loading and hold on the mean of two recordings.
    #[test]
    fn losses_are_scaled_by_the_residual_of_each_phase() {
        let of = |loading: f64, hold: f64| {
            let parts = [(loading, 100.0), (0.0, 0.0), (0.0, 0.0), (hold, 100.0), (0.0, 0.0)];
            Some(PredictionScore { phase_squares: parts, ..PredictionScore::default() })
        };
        let with = [of(300.0, 150.0), of(500.0, 50.0)];
        let result = relative_losses(&[of(340.0, 150.0), of(500.0, 60.0)], &with);
        assert!((result[0] - 40.0 / 4.0 / 200.0).abs() < 1e-12 && (result[1] - 10.0 / 200.0).abs() < 1e-12);
        assert_eq!(relative_losses(&[None, with[1].clone()], &with), [f64::INFINITY, 0.0]);
        assert_eq!(relative_losses(&[with[0].clone(), None], &[None, with[1].clone()])[0], 0.0);
    }

    #[test]
    fn a_loss_must_exceed_its_threshold_and_standard_error() {
        let about = |mean: f64, standard_errors: f64| -> Vec<f64> {
            // The standard error of the mean of these five is sqrt(0.5).
            let scale = mean / standard_errors / 0.5_f64.sqrt();
            [-2.0, -1.0, 0.0, 1.0, 2.0].map(|x| mean + scale * x).to_vec()
        };
        for (mean, standard_errors, wanted) in
            [(0.2, 1.1, true), (0.2, 0.9, false), (0.101, 9.0, true), (0.099, 9.0, false), (-0.2, 9.0, false)]
        {
            assert_eq!(
                exceeds_standard_error(&about(mean, standard_errors), MIN_EFFECT_LOSS),
                wanted,
                "{mean} {standard_errors}"
            );
        }
        assert!(
            exceeds_standard_error(&[0.0, f64::INFINITY, 0.0], MIN_EFFECT_LOSS)
                && !exceeds_standard_error(&[], MIN_EFFECT_LOSS)
        );
        assert!(
            exceeds_standard_error(&about(0.03, 9.0), 0.01)
                && !exceeds_standard_error(&about(0.03, 9.0), MIN_EFFECT_LOSS)
        );
    }

    /// Student's distribution, one-sided level 0.005: 4.604 with 4 and 2.977 with 14 degrees of freedom.
    #[test]
    fn a_significant_loss_exceeds_the_student_quantile() {
        let about = |mean: f64, standard_errors: f64, half: i32| -> Vec<f64> {
            let shape: Vec<f64> = (-half..=half).map(f64::from).collect();
            let error = stylet_stats::sd(&shape) / (shape.len() as f64).sqrt();
            shape.iter().map(|x| mean + mean / standard_errors / error * x).collect()
        };
        for (half, standard_errors) in [(2, 4.604), (7, 2.977)] {
            assert!(is_significant(&about(0.2, standard_errors + 0.01, half)), "{half}");
            assert!(!is_significant(&about(0.2, standard_errors - 0.01, half)), "{half}");
            assert!(!is_significant(&about(0.099, 99.0, half)), "{half}");
        }
        // A former false positive of five recordings.
        assert!(
            !is_significant(&about(0.114, 2.5, 2))
                && exceeds_standard_error(&about(0.114, 2.5, 2), MIN_EFFECT_LOSS)
        );
        assert!(is_significant(&[0.0, f64::INFINITY]) && !is_significant(&[]) && !is_significant(&[0.9]));
    }
}
