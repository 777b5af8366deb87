use super::*;
use crate::block_averages::BLOCK_S;
use crate::model::RecordingParameters;
use crate::test_support::{assert_close, base_model};
use stylet_record::Recording;

/// A layer that ruptures by force after 5 mm, at 9 mm; two recordings of different lengths at 4 mm/s.
fn given() -> (Model, FitData) {
    let mut model = base_model(0.004, &[(0.02, 200.0, 3000.0, Some(1.0))], (0.3, 0.1), 2);
    model.free.recording_surface = true;
    model.rupture_times_s = vec![vec![2.2], vec![2.3]];
    model.scatter.rupture_force = 0.05;
    let recorded = |n: usize| {
        let t: Vec<f64> = (0..n).map(|k| k as f64 * 0.005).collect();
        let z = t.iter().map(|t| 0.004 * t).collect();
        let f = t.iter().map(|t| 0.9 * (t - 1.0).max(0.0) + 0.01 * (90.0 * t).sin()).collect();
        let exclude: Vec<bool> = (0..n).map(|k| (40..52).contains(&k)).collect();
        BlockAverages::new(&Recording::new(t, z, f).expect("a recording"), &exclude, BLOCK_S)
    };
    (model, FitData::new(Arc::new(vec![recorded(800), recorded(600)]), Noise::white(0.05), 0.0))
}

#[test]
fn subsets_and_noise_models_of_recordings() {
    let (_, d) = given();
    assert_eq!((d.recording_count(), d.compared_block_count()), (2, 200 + 150 - 2 * 3));
    let second = d.subset(&[1]);
    assert_eq!(
        (second.recording_count(), second.recordings[0].len(), second.compared_block_count()),
        (1, 150, 147)
    );
    let e = vec![0.1; 150];
    let w = d.whiten(1, &e);
    for (k, w) in w.iter().enumerate() {
        assert_close(*w, if (10..13).contains(&k) { 0.0 } else { 2.0 });
    }
    assert_eq!(second.whiten(0, &e), w);
    let coloured = d.unwhiten(1, &w);
    assert!(
        coloured
            .iter()
            .enumerate()
            .all(|(k, e)| (e - if (10..13).contains(&k) { 0.0 } else { 0.1 }).abs() < 1e-12)
    );
    assert_close(d.with_noise(Noise::white(0.2)).whiten(1, &e)[0], 0.5);
    // The estimated noise is bounded below.
    let actual = FitData { floor_n: 0.3, ..d.clone() }
        .with_estimated_noise(&[vec![0.01; 200], vec![0.01; 150]], NoiseSource::Residual);
    assert_eq!(actual.noise.bins.iter().map(|b| b.sd_n).fold(1.0, f64::min), 0.3);
    assert_eq!(actual.floor_n, 0.3);
}

#[test]
fn cost_is_counted_in_replayed_blocks() {
    let (m, d) = given();
    let cost = |of: &dyn Fn()| {
        let before = d.blocks_replayed();
        of();
        d.blocks_replayed() - before
    };
    assert_eq!(cost(&|| assert!(replay(&m, &d, 0).is_some())), 200);
    assert_eq!(cost(&|| assert!(residuals(&m, &d).is_some())), 350);
    assert_eq!(cost(&|| d.count_replayed(7)), 7);
    let cache = ReplayCache::new(&m, &d, 1).expect("a trail");
    assert_eq!(cost(&|| assert!(ReplayCache::new(&m, &d, 1).is_some())), 150);
    assert_eq!(cost(&|| assert!(cache.replay(&m, &d, 1).is_some())), 75);
    assert_eq!(cost(&|| assert!(cache.nats_with_ruptures(&m, &d, 1, &[2.0]).is_finite())), 75);
    // Under another noise the counter is shared.
    let other = d.with_noise(Noise::white(1.0));
    other.count_replayed(5);
    assert_eq!(other.blocks_replayed(), d.blocks_replayed());
}

#[test]
fn the_log_posterior_sums_residuals_ruptures_and_priors() {
    let (mut m, d) = given();
    m.per_recording =
        [1e-4, -3e-4].map(|surface_m| RecordingParameters { surface_m, ..Default::default() }).to_vec();
    m.tissue.layers[0].stiffness_n_per_m = 230.0;
    m.tissue.surface_m = 0.005;
    let left = residuals(&m, &d).expect("a replay");
    // Stiffness off by 15 % of 30 %, surface by half of its tolerance, two surface offsets between
    // recordings.
    let stiffness = 0.5 * (0.15_f64 / 0.3).powi(2);
    let surface = 0.5 * 0.5_f64.powi(2);
    let own: f64 = [1e-4, 3e-4].iter().map(|x| 0.5 * (x / m.scatter.surface_m).powi(2)).sum();
    assert_close(prior_nats(&m), stiffness + surface + own);
    let events: f64 = (0..2).map(|r| evaluate_rupture(&left.ruptures[r][0], &m.scatter).nats).sum();
    assert_close(rupture_nats(&m, &left), events);
    let mut sum = 0.0;
    for r in 0..2 {
        let f = replay(&m, &d, r).expect("a replay").force_n;
        for k in 0..d.recordings[r].len() {
            assert_close(left.residual_n[r][k], d.recordings[r].force_n[k] - f[k]);
            if d.recordings[r].used[k] {
                let w: f64 = (left.residual_n[r][k] / 0.05).abs();
                sum += if w < 2.5 { 0.5 * w * w } else { 2.5 * (w - 1.25) };
            }
        }
    }
    assert_close(left.nats, sum + events + stiffness + surface + own);
    assert_close(neg_log_posterior(&m, &left), left.nats);
}

#[test]
fn nats_at_other_rupture_times_agree_with_a_full_replay() {
    let (m, d) = given();
    let d = d.subset(&[0]);
    let m = m.subset(&[0]);
    let mut cache = ReplayCache::new(&m, &d, 0).expect("a trail");
    let at = |t: f64| {
        let there = Model { rupture_times_s: vec![vec![t]], ..m.clone() };
        residuals(&there, &d).expect("a replay").nats - prior_nats(&there)
    };
    for stand in [2.2, 3.0] {
        cache.rebase(&d, 0, &[stand]);
        for t in [1.5, 2.2, 2.21, 3.4, NO_RUPTURE] {
            assert_close(cache.nats_with_ruptures(&m, &d, 0, &[t]), at(t));
        }
    }
    // 1 N at 200 N/m: 9 mm at 4 mm/s.
    assert!((cache.free_rupture_times()[0] - 2.25).abs() < 1e-6);
    let moved = Model { rupture_times_s: vec![vec![2.5]], ..m.clone() };
    assert_eq!(
        cache.replay(&moved, &d, 0).expect("a replay").force_n,
        replay(&moved, &d, 0).expect("a replay").force_n
    );
}
