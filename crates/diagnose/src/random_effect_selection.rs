//! Numbers of each recording's own: a surface touched a little higher or lower, a needle more or less slippery.
//!
//! Like the geometry they are no causes. They enter when they gain more than as many fitted numbers cost, and leave when
//! an effect has taken their work over.

use crate::model_comparison::{MIN_GAIN_NATS, bic_penalty, likelihood_gain};
use rayon::prelude::*;
use stylet_identify::fit::{Effort, Fit, fit, fit_if_below};
use stylet_identify::likelihood::FitData;
use stylet_identify::model::{FreeParameters, Model, RecordingParameters};
use stylet_identify::noise::NoiseSource;

/// Nats that numbers of each recording's own have to gain per number, for they take from every shared number.
fn price(free: FreeParameters, data: &FitData) -> f64 {
    let kinds = usize::from(free.recording_surface) + usize::from(free.recording_friction);
    let numbers = kinds * data.recording_count().saturating_sub(1);
    bic_penalty(numbers, data.compared_block_count()) + MIN_GAIN_NATS * kinds as f64
}

/// A model with other numbers of each recording's own.
fn with(model: &Model, own_surface: bool, own_friction: bool) -> Model {
    let mut m = model.clone();
    m.free = FreeParameters { recording_surface: own_surface, recording_friction: own_friction, ..m.free };
    for own in &mut m.per_recording {
        *own = RecordingParameters {
            surface_m: if own_surface { own.surface_m } else { 0.0 },
            ln_friction: if own_friction { own.ln_friction } else { 0.0 },
            ..*own
        };
    }
    m
}

/// The best choice of what each recording has of its own, with the noise that it leaves.
#[must_use]
pub fn select_random_effects(best: Fit, data: FitData) -> (Fit, FitData) {
    if data.recording_count() < 2 {
        return (best, data);
    }
    let now = best.model.free;
    let choices: Vec<(bool, bool)> = [(false, false), (true, false), (false, true), (true, true)]
        .into_iter()
        .filter(|c| *c != (now.recording_surface, now.recording_friction))
        .collect();
    let own = |f: &Fit| f.nats() + price(f.model.free, &data);
    let fits: Vec<Fit> = choices
        .par_iter()
        .filter_map(|c| {
            let m = with(&best.model, c.0, c.1);
            fit_if_below(
                &m,
                &data,
                Effort { max_iterations: 6, min_gain_nats: 0.3 },
                own(&best) - price(m.free, &data),
            )
        })
        .collect();
    let Some(other) = fits.into_iter().min_by(|a, b| own(a).total_cmp(&own(b))) else { return (best, data) };
    if own(&other) >= own(&best) {
        return (best, data);
    }
    // Under the noise that the larger of both leaves.
    let kinds =
        |f: &Fit| usize::from(f.model.free.recording_surface) + usize::from(f.model.free.recording_friction);
    let paid = price(other.model.free, &data) - price(now, &data);
    let gained = if kinds(&other) >= kinds(&best) {
        likelihood_gain(&best, &other, &data)
    } else {
        -likelihood_gain(&other, &best, &data)
    };
    if !gained.exceeds(paid) {
        return (best, data);
    }
    let data = data.with_estimated_noise(&other.residuals.residual_n, NoiseSource::Detrended);
    let settled = fit(&other.model, &data, Effort::FULL).unwrap_or(other);
    (settled, data)
}

#[cfg(test)]
mod tests {
    use super::{price, select_random_effects, with};
    use crate::test_fixtures::{assumed_layers, fit_from_truth, simulated_recordings};
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::fit::{Effort, fit};
    use stylet_identify::likelihood::FitData;
    use stylet_identify::model::{FreeParameters, Model, RecordingParameters};
    use stylet_identify::noise::{Noise, NoiseSource};
    use stylet_record::Recording;

    #[test]
    fn numbers_of_their_own_cost_one_less_than_there_are_recordings_and_four_nats_a_kind() {
        let t: Vec<f64> = (0..400).map(|k| f64::from(k) / 100.0).collect();
        let z = t.iter().map(|t| 1e-3 * t).collect();
        let r = Recording::new(t, z, vec![0.0; 400]).expect("a recording");
        let data =
            FitData::new(Arc::new(vec![BlockAverages::new(&r, &[], BLOCK_S); 4]), Noise::white(0.02), 0.0);
        let each = 0.5 * (data.compared_block_count() as f64).ln();
        for (own_surface, own_friction, wanted) in [
            (false, false, 0.0),
            (true, false, 3.0 * each + 4.0),
            (false, true, 3.0 * each + 4.0),
            (true, true, 6.0 * each + 8.0),
        ] {
            let free = FreeParameters {
                recording_surface: own_surface,
                recording_friction: own_friction,
                ..FreeParameters::default()
            };
            assert!((price(free, &data) - wanted).abs() < 1e-9, "{} for {wanted}", price(free, &data));
        }
    }

    #[test]
    fn what_is_no_more_of_their_own_is_nothing() {
        let belief = assumed_layers(&[]);
        let mut m = Model::base(belief, 2);
        m.free.thickness = true;
        m.per_recording[1] = RecordingParameters { surface_m: 2e-3, ln_friction: 0.3, varying: [0.7; 8] };
        for (surface, friction) in [(false, false), (true, false), (false, true), (true, true)] {
            let out = with(&m, surface, friction);
            assert_eq!(
                (out.free.recording_surface, out.free.recording_friction, out.free.thickness),
                (surface, friction, true)
            );
            let wanted = RecordingParameters {
                surface_m: if surface { 2e-3 } else { 0.0 },
                ln_friction: if friction { 0.3 } else { 0.0 },
                varying: [0.7; 8],
            };
            assert_eq!(out.per_recording[1], wanted);
        }
    }

    /// What each insertion gets of its own where its surface was moved by so much, from a law that grants both kinds of numbers or none.
    fn chosen(moved_m: &[f64], granted: bool) -> (bool, bool) {
        let at: Vec<[f64; 2]> = moved_m.iter().zip([4e-3, 5e-3, 6e-3]).map(|(m, v)| [v, *m]).collect();
        let runs = simulated_recordings(&[], &at);
        let f = fit_from_truth(&[], &runs.iter().collect::<Vec<_>>());
        let begun = with(&f.fit.model, granted, granted);
        let begun = fit(&begun, &f.data, Effort::FULL).expect("a fit");
        let data = f.data.with_estimated_noise(&begun.residuals.residual_n, NoiseSource::Detrended);
        let begun = fit(&begun.model, &data, Effort::FULL).expect("a fit");
        let free = select_random_effects(begun, data).0.model.free;
        (free.recording_surface, free.recording_friction)
    }

    #[test]
    fn insertions_get_a_surface_of_their_own_where_it_differs() {
        assert_eq!(chosen(&[8e-4, -8e-4, 0.0], false), (true, false));
        assert_eq!(chosen(&[8e-4, -8e-4, 0.0], true), (true, false));
    }

    #[test]
    fn insertions_that_do_not_differ_get_nothing_of_their_own() {
        assert_eq!((chosen(&[0.0; 3], true), chosen(&[0.0; 3], false)), ((false, false), (false, false)));
    }

    #[test]
    fn one_insertion_alone_has_nothing_to_differ_from() {
        assert_eq!((chosen(&[8e-4], true), chosen(&[8e-4], false)), ((true, true), (false, false)));
    }
}
