use super::super::group_deviation::Values;
use super::{GroupEstimate, GroupInformation, Observation, RecordingEstimate, estimate_recording};

const GROUP_SD: Values = [2e-3, 0.3, 0.2, 0.1];
const RECORDING_SD: Values = [2e-4, 0.03, 0.04, 0.05];

/// Four independent columns of 50 blocks each: the force is linear in the deviation.
fn force(u: &Values) -> Vec<f64> {
    let scale = [500.0, 2.0, 3.0, 1.0];
    (0..200).map(|k| 1.0 + scale[k / 50] * u[k / 50]).collect()
}

fn estimate(u: &Values, prior_sd: Values) -> RecordingEstimate {
    let (y, used) = (force(u), vec![true; 200]);
    let observed = Observation { force_n: &y, used: &used, weight: 4.0 };
    estimate_recording(&observed, |u| Some(force(u)), prior_sd).expect("an estimate")
}

fn wide() -> Values {
    std::array::from_fn(|k| GROUP_SD[k].hypot(RECORDING_SD[k]))
}

/// A linear model of one column has the precision n s^2 w + 1/sd^2.
#[test]
fn the_estimate_of_a_linear_model_is_shrunk_by_its_prior() {
    let truth = [1e-3, -0.2, 0.1, 0.05];
    let found = estimate(&truth, wide());
    for (k, scale) in [500.0, 2.0, 3.0, 1.0_f64].into_iter().enumerate() {
        let information = 50.0 * scale * scale * 4.0;
        let share = information / (information + wide()[k].powi(-2));
        assert!((found.deviation[k] / truth[k] - share).abs() < 1e-6, "{k}: {}", found.deviation[k]);
    }
}

#[test]
fn many_recordings_move_the_group_and_none_leave_the_prior() {
    let truth = [1e-3, -0.3, 0.2, 0.1];
    let estimates: Vec<RecordingEstimate> = (0..20).map(|_| estimate(&truth, wide())).collect();
    let group = GroupEstimate::new(&estimates.iter().collect::<Vec<_>>(), GROUP_SD, RECORDING_SD);
    for k in 0..4 {
        assert!((group.mean[k] / truth[k] - 1.0).abs() < 0.05, "{k}: {:?}", group.mean);
        assert!(group.sd()[k] < 0.3 * GROUP_SD[k] && group.probability[k] > 0.8, "{group:?}");
    }
    let none = GroupEstimate::new(&[], GROUP_SD, RECORDING_SD);
    assert_eq!(none.mean, [0.0; 4]);
    // Each parameter is in 8 of 15 subsets, which have the probability 1/2 together.
    assert!(none.probability.iter().all(|p| (p - 4.0 / 15.0).abs() < 1e-12), "{none:?}");
    assert!((0..4).all(|k| (none.sd()[k] / GROUP_SD[k] - 1.0).abs() < 1e-12));
}

/// What recordings of one group differ in by themselves is no evidence for another group.
#[test]
fn a_deviation_of_the_size_of_recordings_hardly_moves_the_group() {
    let found = estimate(&RECORDING_SD, wide());
    let group = GroupEstimate::new(&[&found], GROUP_SD, RECORDING_SD);
    for k in 0..4 {
        assert!(group.mean[k].abs() < 0.5 * RECORDING_SD[k] && group.probability[k] < 0.3, "{group:?}");
    }
}

#[test]
fn a_parameter_without_a_spread_does_not_move() {
    let prior = [0.0, wide()[1], 0.0, 0.0];
    let found = estimate(&[1e-3, 0.3, 0.2, 0.2], prior);
    assert_eq!((found.deviation[0], found.deviation[2], found.deviation[3]), (0.0, 0.0, 0.0));
    let group = GroupEstimate::new(&[&found], [0.0, 0.3, 0.0, 0.0], RECORDING_SD);
    assert!(group.mean[1] > 0.25 && group.is_free(1) && !group.is_free(0), "{group:?}");
    assert_eq!((group.mean[0], group.sd()[0], group.draw(&[1.0; 4])[0]), (0.0, 0.0, 0.0));
}

/// With a wide prior, half the information leaves the mean and doubles the variance.
#[test]
fn the_variance_is_inverse_to_the_information() {
    let estimates: Vec<RecordingEstimate> =
        (0..4).map(|_| estimate(&[1e-3, -0.3, 0.2, 0.1], wide())).collect();
    let whole = GroupInformation::new(&estimates.iter().collect::<Vec<_>>(), &RECORDING_SD);
    let very_wide = GROUP_SD.map(|sd| 100.0 * sd);
    let all = GroupEstimate::from_information(&whole, very_wide);
    let half = GroupEstimate::from_information(&whole.times(0.5), very_wide);
    for k in 0..4 {
        assert!((half.full_mean[k] / all.full_mean[k] - 1.0).abs() < 1e-3, "{k}: {half:?}");
        assert!((half.sd()[k] / all.sd()[k] / 2.0_f64.sqrt() - 1.0).abs() < 1e-3, "{k}: {half:?}");
    }
}

/// A rupture that the model places far away attracts no gradient; another start finds it.
#[test]
fn a_far_rupture_is_found() {
    // The force rises over 200 blocks and falls to zero once it exceeds the puncture force.
    let force = |u: &Values| -> Vec<f64> {
        let puncture = 60.0 * libm::exp(u[3]);
        (0..200).map(|k| if f64::from(k) < puncture { f64::from(k) } else { 0.0 }).collect()
    };
    let (y, used) = (force(&[0.0, 0.0, 0.0, 0.7]), vec![true; 200]);
    let observed = Observation { force_n: &y, used: &used, weight: 0.01 };
    let found =
        estimate_recording(&observed, |u| Some(force(u)), [0.0, 0.0, 0.0, 0.37]).expect("an estimate");
    assert!((found.deviation[3] - 0.7).abs() < 0.05, "{found:?}");
}
