use super::damped_step::order_rupture_times;
use super::nonsmooth::{escape_kink, step_of_improving_parameters};
use super::*;
use crate::likelihood::{ReplayCache, neg_log_posterior, replay};
use crate::model::{NO_RUPTURE, Parameter, ParameterRole as Role, RecordingParameters};
use crate::noise::Noise;
use crate::rupture_likelihood::RuptureEvent;
use crate::test_support::{assert_close, base_model, sampled};
use std::sync::Arc;

/// Two layers from 4 mm on, the first of which ruptures by force after 5 mm of 12 mm.
fn model(recordings: usize) -> Model {
    let layers = [(0.012, 200.0, 3000.0, Some(1.0)), (0.03, 80.0, 3000.0, None)];
    let mut model = base_model(0.004, &layers, (0.3, 0.0), recordings);
    model.free.recording_surface = true;
    model.free.recording_friction = true;
    model
}

/// Data of a model for an insertion at 4 mm/s with a ripple, plus a small unmodelled force.
fn data(truth: &Model, rough_n: f64) -> FitData {
    let recorded = |r: usize| {
        let mut b = sampled(1000, |t| 0.004 * t + 4e-4 * ((2.0 + r as f64) * t).sin(), |_| 0.0);
        let unforced =
            FitData::new(Arc::new(vec![b.clone(); truth.per_recording.len()]), Noise::white(0.01), 0.0);
        let mut f = replay(truth, &unforced, r).expect("a replay").force_n;
        f.iter_mut()
            .enumerate()
            .for_each(|(k, f)| *f += rough_n * (1.7 * (k * k % (89 + 12 * r)) as f64).sin());
        b.force_n = f;
        b
    };
    let blocks = (0..truth.per_recording.len()).map(recorded).collect();
    FitData::new(Arc::new(blocks), Noise::white(0.01), 0.0)
}

fn column(w: &[&[f64]], rows: &[&[f64]]) -> JacobianColumn {
    let of = |x: &[&[f64]]| x.iter().map(|x| x.to_vec()).collect();
    JacobianColumn { innovations: of(w), rupture_rows: of(rows) }
}

#[test]
fn column_products_are_per_recording() {
    let a = column(&[&[1.0, 2.0], &[3.0]], &[&[0.5], &[4.0, 1.0]]);
    let b = column(&[&[2.0, -1.0], &[5.0]], &[&[4.0], &[1.0, 2.0]]);
    assert_eq!((a.dot(&b, 0), a.dot(&b, 1), a.dot(&b, 2), a.dot_all(&b)), (2.0, 21.0, 0.0, 23.0));
}

#[test]
fn rms_uses_compared_blocks_only() {
    let (m, d) = (model(1), data(&model(1), 0.0));
    let mut blocks = (*d.recordings).clone();
    blocks[0].used = (0..blocks[0].len()).map(|k| k < 2).collect();
    let e = vec![(0..blocks[0].len()).map(|k| [3.0, 5.0, 100.0][k.min(2)]).collect()];
    let fit = Fit { model: m, residuals: Residuals { residual_n: e, nats: 7.5, ..Default::default() } };
    assert_close(fit.rms_n(&d.with_recordings(blocks)), 17.0_f64.sqrt());
    assert_eq!((fit.nats(), fit.rms_n(&d.with_recordings(Vec::new()))), (7.5, 0.0));
}

#[test]
fn rupture_times_are_ordered_and_inside_the_recording() {
    let of = |mut rupture_times: Vec<f64>| {
        order_rupture_times(&mut rupture_times, (1.0, 9.0));
        rupture_times
    };
    assert_eq!(of(vec![0.5, 4.0, 3.0, 12.0]), [1.0, 4.0, 4.0, 9.0]);
    assert_eq!(of(vec![2.0, NO_RUPTURE, NO_RUPTURE]), [2.0, NO_RUPTURE, NO_RUPTURE]);
}

#[test]
fn parameters_are_clamped_to_the_assumed_tolerances() {
    let mut m = model(1);
    m.tissue.layers[0].stiffness_n_per_m = 500.0;
    m.tissue.layers[1].stiffness_n_per_m = 10.0;
    m.tissue.surface_m = 0.0045;
    clamp_to_bounds(&mut m);
    assert_close(m.tissue.layers[0].stiffness_n_per_m, 260.0);
    assert_close(m.tissue.layers[1].stiffness_n_per_m, 56.0);
    assert_close(m.tissue.surface_m, 0.0045);
}

/// Without ruptures the objective is smooth.
fn smooth() -> (Model, FitData) {
    let mut m = model(2);
    m.rupture_times_s = vec![vec![NO_RUPTURE; 2]; 2];
    m.scatter.rupture_force = 0.1;
    m.scatter.rupture_depth_m = 2e-3;
    let d = data(&m, 0.02);
    // The model is off, and each recording has its own parameters.
    m.tissue.layers[0].stiffness_n_per_m = 196.0;
    m.per_recording = [2e-4, -1e-4]
        .map(|surface_m| RecordingParameters {
            surface_m,
            ln_friction: 10.0 * surface_m,
            ..Default::default()
        })
        .to_vec();
    (m, d)
}

#[test]
fn the_gradient_agrees_with_finite_differences() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    // Some residuals are beyond the Huber threshold, some are not.
    let rough = at.innovations.iter().flatten().filter(|w| w.abs() > 2.5).count();
    assert!(rough > 5 && rough < 400, "{rough}");
    let t = Linearization::new(&m, &d, &at);
    let nats = |role: Role, r: usize, by: f64| {
        let mut moved = m.clone();
        moved.set(role, r, m.get(role, r) + by);
        residuals(&moved, &d).expect("a replay").nats
    };
    let falls =
        |n: &Parameter, r: usize| (nats(n.role, r, -n.step) - nats(n.role, r, n.step)) / (2.0 * n.step);
    let is = |actual: f64, n: &Parameter, r: usize| {
        let expected = falls(n, r);
        assert!(
            (actual - expected).abs() < 0.01 * expected.abs() + 1e-3,
            "{actual} for {expected}, {:?}",
            n.role
        );
    };
    assert!(t.shared.len() >= 5);
    for (k, n) in t.shared.iter().enumerate() {
        is(t.neg_gradient[k], n, 0);
    }
    for r in 0..2 {
        for (o, n) in
            t.per_recording.iter().enumerate().filter(|(_, n)| !matches!(n.role, Role::RuptureTime(_)))
        {
            assert_eq!(t.index_of(o, r), t.shared.len() + r * t.per_recording.len() + o);
            is(t.neg_gradient[t.index_of(o, r)], n, r);
        }
    }
}

#[test]
fn the_normal_matrix_contains_all_columns_and_priors() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let t = Linearization::new(&m, &d, &at);
    let (ns, no) = (t.shared.len(), t.per_recording.len());
    // The parameter at an index of the matrix, and its recording.
    let parameter = |i: usize| if i < ns { (i, None) } else { (ns + (i - ns) % no, Some((i - ns) / no)) };
    for i in 0..ns + 2 * no {
        for j in 0..=i {
            let ((a, ra), (b, rb)) = (parameter(i), parameter(j));
            let products = |r: usize| t.columns[a].dot(&t.columns[b], r);
            let mut expected: f64 = (0..2)
                .filter(|r| ra.is_none_or(|a| a == *r) && rb.is_none_or(|b| b == *r))
                .map(products)
                .sum();
            let sd = if a < ns { t.shared[a].prior_sd } else { t.per_recording[a - ns].prior_sd };
            if i == j && sd.is_finite() {
                expected += 1.0 / (sd * sd);
            }
            let actual = t.normal_matrix.at(i, j);
            assert!((actual - expected).abs() <= 1e-9 * expected.abs(), "{actual} for {expected} at {i} {j}");
        }
    }
    let against = t.products_with(&t.columns[0], 2);
    assert_close(against[1], t.columns[0].dot_all(&t.columns[1]));
    assert_close(against[ns + no], t.columns[ns].dot(&t.columns[0], 1));
    assert_eq!(against.len(), ns + 2 * no);
}

#[test]
fn a_derivative_costs_half_a_replay() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let before = d.blocks_replayed();
    let t = Linearization::new(&m, &d, &at);
    let blocks = d.recordings[0].len() as u64;
    assert_eq!(
        d.blocks_replayed() - before,
        2 * blocks + (t.shared.len() + t.per_recording.len()) as u64 * 2 * (blocks / 2)
    );
}

#[test]
fn a_wide_difference_is_symmetric() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let surface = |n: &Parameter| (n.role == Role::Surface).then_some(1e-3);
    let plain = Linearization::new(&m, &d, &at);
    let wide = Linearization::new(&m, &d, &at).with_wide_differences(&m, &d, &at, &surface);
    let moved = |by: f64| {
        let mut other = m.clone();
        other.set(Role::Surface, 0, m.get(Role::Surface, 0) + by);
        plain.difference(&m, &d, &at, &other).expect("a column")
    };
    let (up, down) = (moved(1e-3), moved(-1e-3));
    for (k, n) in wide.shared.iter().enumerate() {
        if n.role != Role::Surface {
            assert_eq!(wide.columns[k].innovations, plain.columns[k].innovations);
            continue;
        }
        for r in 0..2 {
            for i in 0..up.innovations[r].len() {
                let expected = (up.innovations[r][i] - down.innovations[r][i]) / 2e-3;
                assert!(
                    (wide.columns[k].innovations[r][i] - expected).abs() < 1e-6 * expected.abs().max(1.0)
                );
            }
        }
        assert_close(
            wide.normal_matrix.at(k, k),
            wide.columns[k].dot_all(&wide.columns[k]) + 1.0 / (n.prior_sd * n.prior_sd),
        );
        assert_ne!(wide.normal_matrix.at(k, k), plain.normal_matrix.at(k, k));
    }
}

#[test]
fn a_fit_recovers_the_simulated_parameters() {
    let mut truth = model(2);
    truth.tissue.layers[0].stiffness_n_per_m = 215.0;
    truth.tissue.layers[1].friction_ns_per_m2 = 2700.0;
    truth.tissue.surface_m = 0.0043;
    truth.per_recording =
        [4e-4, -4e-4].map(|surface_m| RecordingParameters { surface_m, ..Default::default() }).to_vec();
    // At the law's own rupture times.
    truth.rupture_times_s = vec![vec![NO_RUPTURE; 2]; 2];
    let own =
        |r: usize| ReplayCache::new(&truth, &data(&truth, 0.0), r).expect("a trail").free_rupture_times();
    truth.rupture_times_s = vec![own(0), own(1)];
    let d = data(&truth, 0.002);
    let mut m = model(2);
    m.rupture_times_s =
        [(0, -0.021), (1, 0.027)].map(|(r, by)| vec![truth.rupture_times_s[r][0] + by, NO_RUPTURE]).to_vec();
    let found = fit(&m, &d, Effort::FULL).expect("a fit");
    let is = |actual: f64, expected: f64, within: f64| {
        assert!((actual - expected).abs() < within, "{actual} for {expected}")
    };
    let tissue = &found.model.tissue;
    is(tissue.layers[0].stiffness_n_per_m, 215.0, 2.0);
    is(tissue.layers[1].friction_ns_per_m2, 2700.0, 200.0);
    for (r, own) in found.model.per_recording.iter().enumerate() {
        is(tissue.surface_m + own.surface_m, 0.0043 + truth.per_recording[r].surface_m, 3e-5);
        is(found.model.rupture_times_s[r][0], truth.rupture_times_s[r][0], 1e-3);
        assert_eq!(found.model.rupture_times_s[r][1], NO_RUPTURE);
    }
    assert!(found.rms_n(&d) < 0.003, "{}", found.rms_n(&d));
    // Stopped early where the gain is too small; never worse than the start.
    let least = fit_if_below(&m, &d, Effort::FULL, -1e9).expect("a fit").nats();
    assert!(least >= found.nats() && least < residuals(&m, &d).expect("a replay").nats);
    // A parameter outside its bounds stays at the bound.
    let mut far = truth.clone();
    far.tissue.layers[0].stiffness_n_per_m = 300.0;
    let bound = fit(&m, &data(&far, 0.002), Effort::FULL).expect("a fit");
    assert_close(bound.model.tissue.layers[0].stiffness_n_per_m, 260.0);
}

/// A parameter whose perturbed model cannot be replayed.
#[test]
fn a_missing_column_counts_as_zero() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let mut t = Linearization::new(&m, &d, &at);
    let first = t.columns[1].clone();
    t.columns[0] = JacobianColumn::default();
    t.assemble(&m, 2);
    assert_close(t.normal_matrix.at(0, 0), 1.0 / (t.shared[0].prior_sd * t.shared[0].prior_sd));
    assert_eq!((t.normal_matrix.at(1, 0), t.products_with(&first, 2)[0]), (0.0, 0.0));
    assert_close(t.products_with(&first, 2)[1], first.dot_all(&first));
    assert!(t.products_with(&JacobianColumn::default(), 2).iter().all(|x| *x == 0.0));
}

#[test]
fn a_step_is_extrapolated_to_the_minimum_of_the_parabola() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let t = Linearization { neg_gradient: vec![2.0, 4.0], ..Linearization::new(&m, &d, &at) };
    // It falls by ten; a step to the minimum has gained half of that.
    let share = |gained: f64| extrapolation_factor(&t, &[1.0, 2.0], gained);
    assert_eq!(share(5.0), None);
    assert_eq!(share(6.1), None);
    assert_close(share(7.5).expect("further"), 2.0);
    assert_close(share(8.5).expect("further"), 10.0 / 3.0);
    assert_eq!([share(9.0), share(10.0), share(12.0)], [Some(4.0); 3]);
}

/// Unmodelled effects make most blocks outliers, which count linearly but enter the linearization as squares.
#[test]
fn a_fit_with_many_outliers_converges_in_a_few_steps() {
    let (mut m, _) = smooth();
    m.per_recording = vec![RecordingParameters::default(); 2];
    let d = data(&m, 0.15);
    m.tissue.layers[0].stiffness_n_per_m = 170.0;
    m.tissue.layers[0].friction_ns_per_m2 = 3600.0;
    let to = |iterations: usize| {
        fit(&m, &d, Effort { max_iterations: iterations, min_gain_nats: 1e-6 }).expect("a fit").nats()
    };
    let (end, few) = (to(100), to(4));
    assert!(few - end < 1.0 && to(1) - end > 100.0, "{few} {end} {}", to(1));
}

/// A linearization across a kink has the wrong sign for one parameter; the others continue.
#[test]
fn parameters_with_valid_derivatives_move_without_one_at_a_kink() {
    let (mut m, d) = smooth();
    m.tissue.layers[0].stiffness_n_per_m = 190.0;
    m.tissue.layers[0].friction_ns_per_m2 = 3300.0;
    let at = Fit { residuals: residuals(&m, &d).expect("a replay"), model: m.clone() };
    let mut t = Linearization::new(&m, &d, &at.residuals);
    let stiff = t.shared.iter().position(|n| n.role == Role::Stiffness(0)).expect("free");
    t.neg_gradient[stiff] *= -1e3;
    let along = damped_step(&m, &d, &t, FIRST_DAMPING, |_| true).expect("a step");
    let left = residuals(&apply_step(&m, &d, &t, &along, 1.0), &d).expect("a replay");
    assert!(left.nats > at.nats());
    let next = step_of_improving_parameters(&at, &d, &t).expect("the others gain");
    assert_eq!(next.tissue.layers[0].stiffness_n_per_m, 190.0);
    assert!(next.tissue.layers[0].friction_ns_per_m2 != 3300.0);
    assert!(residuals(&next, &d).expect("a replay").nats < at.nats() - 1.0);
    // At the minimum nothing changes.
    let plain = fit(&m, &d, Effort::FULL).expect("a fit");
    assert!(escape_kink(&plain, &d).is_none());
    let past = fit_nonsmooth(&m, &d, Effort::FULL).expect("a fit");
    assert_eq!(past.nats(), plain.nats());
}

#[test]
fn a_rupture_time_moves_by_at_most_a_block_and_a_half() {
    let mut truth = model(1);
    truth.rupture_times_s = vec![vec![2.513, NO_RUPTURE]];
    let d = data(&truth, 0.0);
    let mut m = truth.clone();
    m.rupture_times_s = vec![vec![2.39, NO_RUPTURE]];
    m.tissue.layers[0].stiffness_n_per_m = 180.0;
    let at = residuals(&m, &d).expect("a replay");
    let t = Linearization::new(&m, &d, &at);
    let next = apply_step(&m, &d, &t, &damped_step(&m, &d, &t, 1e-4, |_| true).expect("a step"), 1.0);
    let by = next.rupture_times_s[0][0] - 2.39;
    assert!(by.abs() <= 0.03 + 1e-12, "{by}");
    // Nothing moves without a gradient.
    assert!(
        damped_step(
            &m,
            &d,
            &Linearization {
                neg_gradient: vec![0.0; t.neg_gradient.len()],
                ..Linearization::new(&m, &d, &at)
            },
            1e-4,
            |_| { true }
        )
        .is_none()
    );
}

#[test]
fn scatter_is_the_rms_of_the_per_recording_parameters() {
    let (mut m, d) = smooth();
    m.per_recording = [(3e-4, 0.03), (-4e-4, 0.04)]
        .map(|(surface_m, friction)| RecordingParameters {
            surface_m,
            ln_friction: friction,
            ..Default::default()
        })
        .to_vec();
    let mut at = residuals(&m, &d).expect("a replay");
    let mut actual = m.clone();
    update_scatter(&mut actual, &mut at);
    assert_close(actual.scatter.surface_m, (0.5_f64 * 25e-8).sqrt());
    assert_close(actual.scatter.ln_friction, (0.5_f64 * 25e-4).sqrt());
    assert_close(at.nats, neg_log_posterior(&actual, &at));
    // Bounded below; unchanged when they are given or the random effects are not free.
    let mut common = m.clone();
    common.per_recording = vec![RecordingParameters::default(); 2];
    update_scatter(&mut common, &mut at);
    assert_eq!((common.scatter.surface_m, common.scatter.ln_friction), (1e-6, 1e-4));
    let mut steady = Model { fixed_scatter: true, ..m.clone() };
    update_scatter(&mut steady, &mut at);
    assert_close(at.nats, neg_log_posterior(&steady, &at));
    assert_eq!(
        (steady.scatter.surface_m, steady.scatter.ln_friction),
        (m.scatter.surface_m, m.scatter.ln_friction)
    );
    m.free.recording_surface = false;
    m.free.recording_friction = false;
    let mut bound = m.clone();
    update_scatter(&mut bound, &mut at);
    assert_eq!(
        (bound.scatter.surface_m, bound.scatter.ln_friction),
        (m.scatter.surface_m, m.scatter.ln_friction)
    );
}

/// Two layers in four recordings: the force shows the rupture of the first, nothing shows that of the second.
#[test]
fn a_layer_without_visible_ruptures_does_not_reduce_the_scatter() {
    let (m, d) = smooth();
    let at = residuals(&m, &d).expect("a replay");
    let event = |force: f64| RuptureEvent {
        force_excess: force,
        depth_excess_m: -0.01,
        ruptured: true,
        sample_step_s: 0.01,
        ..RuptureEvent::INITIAL
    };
    let actual = |events: Vec<Vec<RuptureEvent>>, steady: bool| {
        let layers = events[0].len();
        let mut at = Residuals { ruptures: events, ..at.clone() };
        let mut assumptions = (*m.assumed).clone();
        assumptions.tissue.layers.resize(layers, assumptions.tissue.layers[0].clone());
        assumptions.tolerance.resize(layers, 0.3);
        assumptions.thickness_tolerance.resize(layers, 0.1);
        let mut model = Model { fixed_scatter: steady, ..Model::base(Arc::new(assumptions), 4) };
        update_scatter(&mut model, &mut at);
        model.scatter.rupture_force
    };
    let forces = [-0.2, -0.1, 0.1, 0.2];
    let (first, both): (Vec<_>, Vec<_>) =
        forces.map(|f| (vec![event(f)], vec![event(f), event(1e-6)])).into_iter().unzip();
    let alone = actual(first.clone(), true);
    assert!((0.09..0.3).contains(&alone), "{alone}");
    assert_eq!((actual(first, false), actual(both, true)), (alone, alone));
}
