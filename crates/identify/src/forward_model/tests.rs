use super::incremental_replay::ruptures_until_equal;
use super::time_stepper::record_strain;
use super::*;
use crate::model::{EffectTerm, Model};
use crate::motion::JumpAppearance;
use crate::test_support::{base_model, sampled};
use stylet_tissue::{RuptureCriterion, effect_info};

fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-9 * expected.abs().max(1.0), "{actual} for {expected}");
}

/// From 5 mm on: 10 mm of 200 N/m that rupture at 1.2 N, 20 mm of 100 N/m without a puncture force, 30 mm that
/// rupture at 0.5 N.
fn model() -> Model {
    let layers =
        [(0.01, 200.0, 4000.0, Some(1.2)), (0.02, 100.0, 3000.0, None), (0.03, 50.0, 5000.0, Some(0.5))];
    base_model(0.005, &layers, (0.3, 0.1), 1)
}

fn compiled(change: impl Fn(&mut Model)) -> CompiledModel {
    let mut m = model();
    change(&mut m);
    m.compile(0).expect("a law")
}

/// 12 s at 4 mm/s, in blocks of 20 ms.
fn blocks() -> BlockAverages {
    sampled(2400, |t| 0.004 * t, |_| 0.0)
}

fn replayed(rupture_times: &[f64]) -> ReplayResult {
    let (b, mut out) = (blocks(), ReplayResult::default());
    replay_with_ruptures(&compiled(|_| ()), &b, &b.motion_pieces(false, 0.0, None), rupture_times, &mut out);
    out
}

/// Ruptures at 2.003, 9.011 and 11.307 s: spring and friction forces in closed form.
#[test]
fn the_force_at_constant_velocity_agrees_with_the_closed_form() {
    let rupture_times = [2.003, 9.011, 11.307];
    let actual = replayed(&rupture_times);
    let b = blocks();
    let force = |t: f64| {
        let z = 0.004 * t;
        let inside = |from: f64, thick: f64| (z - from).clamp(0.0, thick);
        let rubbed = 0.004
            * (4000.0 * inside(0.005, 0.01) + 3000.0 * inside(0.015, 0.02) + 5000.0 * inside(0.035, 0.03));
        let spring = match rupture_times.iter().filter(|i| **i < t).count() {
            0 => 200.0 * (z - 0.005).max(0.0),
            1 => 100.0 * (z - 0.015).max(0.0),
            2 => 50.0 * (z - 0.035).max(0.0),
            _ => 0.0,
        };
        rubbed + spring
    };
    for k in 0..b.len() {
        let n = 4000;
        let mean = (0..n)
            .map(|i| force(b.start_s[k] + (b.end_s[k] - b.start_s[k]) * (f64::from(i) + 0.5) / f64::from(n)));
        let mean = mean.sum::<f64>() / f64::from(n);
        // Where a layer begins, the middle of the block represents it.
        let bends = [0.005, 0.015, 0.035].iter().any(|z| b.block_at(z / 0.004) == k);
        assert!(
            (actual.force_n[k] - mean).abs() < if bends { 2e-3 } else { 3e-4 },
            "{} for {mean} in {k}",
            actual.force_n[k]
        );
    }
    let [one, two, three] = [actual.ruptures[0], actual.ruptures[1], actual.ruptures[2]];
    // 3.012 mm of 200 N/m, against 1.2 N and 10 mm, at 4 mm/s.
    assert_close(one.elastic_n, 200.0 * 0.003012);
    assert_close(one.force_excess, 200.0 * 0.003012 / 1.2 - 1.0);
    assert_close(one.depth_excess_m, 0.008012 - 0.015);
    assert_close(one.depth_rate_mps, 0.004);
    assert_close(one.force_excess_rate, 200.0 * 0.004 / 1.2);
    assert_eq!((two.force_excess, two.force_excess_rate), (f64::NEG_INFINITY, 0.0));
    assert_close(two.depth_excess_m, 0.004 * 9.011 - 0.035);
    assert_close(three.force_excess, 50.0 * (0.004 * 11.307 - 0.035) / 0.5 - 1.0);
    assert!(actual.ruptures.iter().all(|e| e.ruptured && (e.sample_step_s - 0.005).abs() < 1e-12));
}

#[test]
fn presliding_friction_reverses_with_the_needle() {
    // Insertion at 4 mm/s to 11.27 mm, in the middle of a block, and retraction at 8 mm/s; the friction is 40
    // N/m over 0.3 mm.
    let (turn_s, c, delta_m) = (2.817, 40.0, 3e-4);
    let z = |t: f64| 0.004 * t.min(turn_s) - 0.008 * (t - turn_s).max(0.0);
    let b = sampled(640, z, |_| 0.0);
    let effect = effect_info("presliding_friction").expect("an effect");
    let model = |m: &mut Model| m.effects.push(EffectTerm::new(effect, &[c, delta_m]));
    let mut out = ReplayResult::default();
    replay_with_ruptures(
        &compiled(model),
        &b,
        &b.motion_pieces(false, 0.0, None),
        &[NO_RUPTURE; 3],
        &mut out,
    );
    for k in (0..b.len()).filter(|k| b.start_s[*k] > turn_s + 0.02) {
        let t = 0.5 * (b.start_s[k] + b.end_s[k]);
        let back = z(turn_s) - z(t);
        let (depth, v) = (z(t) - 0.005, -0.008);
        let bristle = -1.0 + 2.0 * (-back / delta_m).exp();
        let expected = 200.0 * depth + 4000.0 * depth * v + c * bristle * depth;
        // The mean friction over a block of 0.16 mm deviates from that in its middle by about a hundredth.
        let close = 0.02 * (1.0 + bristle) * c * depth + 5e-4;
        assert!((out.force_n[k] - expected).abs() < close, "{} for {expected} N at {t} s", out.force_n[k]);
    }
}

#[test]
fn an_intact_layer_keeps_its_largest_strain() {
    let actual = replayed(&[2.003, NO_RUPTURE, NO_RUPTURE]);
    let [one, two, three] = [actual.ruptures[0], actual.ruptures[1], actual.ruptures[2]];
    assert!(one.ruptured && !two.ruptured && !three.ruptured);
    // To the middle of the last block, at 11.9875 s; the motion is unknown after the last sample.
    assert!((two.depth_excess_m - (0.004 * 11.9875 - 0.035)).abs() < 1e-6);
    assert_eq!((two.depth_rate_mps, two.elastic_n), (0.0, 0.0));
    assert_eq!(
        (three.force_excess, three.depth_excess_m),
        (RuptureEvent::INITIAL.force_excess, RuptureEvent::INITIAL.depth_excess_m)
    );
    let none = replayed(&[NO_RUPTURE; 3]).ruptures[0];
    assert!((none.force_excess - (200.0 * (0.004 * 11.9875 - 0.005) / 1.2 - 1.0)).abs() < 2e-4);
}

#[test]
fn simultaneous_and_final_ruptures_are_applied() {
    let actual = replayed(&[9.2, 9.2, 9.2]);
    assert!(actual.ruptures.iter().all(|e| e.ruptured));
    assert_close(actual.ruptures[2].depth_excess_m, 0.004 * 9.2 - 0.065);
    let end_s = blocks().span_s().1;
    let actual = replayed(&[2.003, 9.011, end_s]);
    assert!(actual.ruptures[2].ruptured);
    assert!((actual.ruptures[2].depth_excess_m - (0.004 * end_s - 0.065)).abs() < 1e-5);
    let late = replayed(&[2.003, 9.011, end_s + 0.001]);
    assert!(!late.ruptures[2].ruptured);
    // A rupture before the recording appears at once.
    let early = replayed(&[-1.0, 9.011, NO_RUPTURE]);
    assert!(early.ruptures[0].ruptured);
    assert!((early.ruptures[0].depth_excess_m - (0.004 * -0.0025 - 0.015)).abs() < 1e-6);
}

#[test]
fn the_free_law_ruptures_by_force_or_at_the_interface() {
    let b = blocks();
    let actual = free_rupture_times(&compiled(|_| ()), &b.motion_pieces(false, 0.0, None));
    // 1.2 N at 200 N/m are 6 mm; the second layer has its far interface at 35 mm, the third 0.5 N at 10 mm.
    for (actual, place) in actual.iter().zip([0.011, 0.035, 0.045]) {
        assert!((actual - place / 0.004).abs() < 1e-6, "{actual}");
    }
    // At a varying velocity.
    let trajectory = |t: f64| 0.004 * t + 0.0015 * (2.0 * t).sin();
    let rippled = sampled(2400, trajectory, |_| 0.0);
    let actual = free_rupture_times(&compiled(|_| ()), &rippled.motion_pieces(false, 0.0, None));
    for (actual, place) in actual.iter().zip([0.011, 0.035, 0.045]) {
        assert!((trajectory(*actual) - place).abs() < 2e-7, "{actual}: {} for {place}", trajectory(*actual));
    }
    let stiff = compiled(|m| m.tissue.layers[2].puncture_n = Some(5.0));
    assert_eq!(free_rupture_times(&stiff, &b.motion_pieces(false, 0.0, None))[2], NO_RUPTURE);
}

#[test]
fn the_largest_strain_of_a_layer_is_kept() {
    let mut events = [RuptureEvent::INITIAL; 2];
    let mut seen = |layer: usize, elastic_n: f64, puncture_n: f64, tip_m: f64| {
        record_strain(&mut events, &RuptureCriterion { layer, elastic_n, puncture_n, tip_m, far_m: 0.02 });
        events.map(|e| (e.force_excess, e.depth_excess_m))
    };
    let none = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    let actual = seen(2, 0.9, 1.2, 0.03);
    assert_eq!(actual[0], none);
    assert_close(actual[1].0, -0.25);
    assert_close(actual[1].1, 0.01);
    assert_eq!(seen(2, 0.3, 1.2, 0.01), actual);
    assert_close(seen(2, 1.5, 1.2, 0.01)[1].0, 0.25);
    // Without a puncture force only the depth counts; unknown layers are ignored.
    assert_close(seen(1, 9.0, f64::INFINITY, 0.021)[0].1, 0.001);
    assert_eq!(seen(1, 9.0, 0.0, 0.021)[0].0, f64::NEG_INFINITY);
    let before = seen(1, 0.0, f64::INFINITY, 0.0);
    assert_eq!(seen(3, 9.0, 1.0, 9.0), before);
}

/// Pieces of one second at 2 mm/s; acceleration in the fifth one, retraction at the end.
fn by_seconds() -> Vec<MotionPiece> {
    let piece = |k: u32, z_m: f64, v_mps: f64, a_mps2: f64| {
        let from_s = f64::from(k);
        MotionPiece {
            block: k,
            start_s: from_s,
            end_s: from_s + 1.0,
            position_m: z_m,
            velocity_mps: v_mps,
            acceleration_mps2: a_mps2,
        }
    };
    (0..10)
        .map(|k| match k {
            4 => piece(k, 0.009, 0.002, 0.008),
            8.. => piece(k, 0.02, -0.006, 0.0),
            _ => piece(k, 0.001 + 0.002 * f64::from(k), 0.002, 0.0),
        })
        .collect()
}

#[test]
fn a_difference_appears_where_the_needle_first_reaches_it() {
    let pieces = by_seconds();
    let first = |was: &CompiledModel, now: &CompiledModel, rupture_times: [&[f64]; 2]| {
        let replay_cache =
            IncrementalReplay { rupture_times_s: rupture_times[0].to_vec(), ..IncrementalReplay::default() };
        replay_cache.first_difference(was, now, &pieces, rupture_times[1])
    };
    let plain = compiled(|_| ());
    let never: [&[f64]; 2] = [&[NO_RUPTURE; 3]; 2];
    assert_eq!(first(&plain, &plain, never), 10);
    // Surfaces (mm) of two laws: the nearer one counts, minus 0.01 mm.
    let at = |mm: f64| compiled(|m| m.tissue.surface_m = mm * 1e-3);
    let reached = |mm: f64| {
        let actual = [first(&at(mm), &at(mm + 0.5), never), first(&at(mm + 0.5), &at(mm), never)];
        assert_eq!(actual[0], actual[1]);
        actual[0]
    };
    assert_eq!((reached(3.9), reached(4.009), reached(4.011)), (1, 1, 2));
    // The fifth piece extends 1 mm beyond its middle by its velocity and 2 mm by its acceleration.
    assert_eq!((reached(8.02), reached(12.009), reached(12.011)), (4, 4, 6));
    // A retraction begins further in.
    assert_eq!((reached(16.1), reached(23.0), reached(23.02)), (8, 8, 10));
    // A stiffness: behind its front, and from the rupture of the previous layer on.
    let stiffer = compiled(|m| m.tissue.layers[1].stiffness_n_per_m = 111.0);
    assert_eq!(first(&plain, &stiffer, never), 7);
    let rupture_times: [&[f64]; 2] = [&[2.5, NO_RUPTURE, NO_RUPTURE]; 2];
    assert_eq!(first(&plain, &stiffer, rupture_times), 1);
    assert_eq!(first(&plain, &compiled(|m| m.tissue.layers[0].stiffness_n_per_m = 111.0), rupture_times), 2);
    // A rupture time that moved: from the piece before the earlier one.
    let moved = |a: f64, b: f64| first(&plain, &plain, [&[a, 9.5, NO_RUPTURE], &[b, 9.5, NO_RUPTURE]]);
    assert_eq!([moved(3.4, 6.2), moved(6.2, 3.4), moved(6.2, NO_RUPTURE), moved(0.3, 0.4)], [2, 2, 5, 0]);
    // Effects that move the tip, or the position scale: from the start.
    let soft = compiled(|m| m.effects.push(bending()));
    let soft_too = compiled(|m| {
        m.effects.push(bending());
        m.tissue.layers[2].stiffness_n_per_m = 77.0;
    });
    assert_eq!(first(&soft, &soft_too, never), 0);
    assert_eq!(first(&soft, &soft, never), 10);
}

/// A needle of 900 N/m.
fn bending() -> EffectTerm {
    EffectTerm::new(effect_info("needle_compliance").expect("in the library"), &[900.0])
}

#[test]
fn laws_are_equal_after_the_last_ruptured_layer_that_differs() {
    let plain = compiled(|_| ());
    let with = |change: &dyn Fn(&mut Model)| ruptures_until_equal(&plain, &compiled(change));
    assert_eq!(with(&|_| ()), 0);
    for layer in 0..3 {
        assert_eq!(with(&|m| m.tissue.layers[layer].stiffness_n_per_m *= 1.1), layer + 1);
        assert_eq!(with(&|m| m.tissue.layers[layer].puncture_n = Some(0.77)), layer + 1);
        assert_eq!(with(&|m| m.tissue.layers[layer].friction_ns_per_m2 *= 1.1), usize::MAX);
        assert_eq!(with(&|m| m.tissue.layers[layer].thickness_m *= 1.1), usize::MAX);
    }
    assert_eq!(with(&|m| m.tissue.surface_m *= 1.1), usize::MAX);
    let soft = |layer: f64| {
        compiled(|m| {
            m.effects.push(bending());
            m.tissue.layers[0].stiffness_n_per_m = layer;
        })
    };
    assert_eq!(ruptures_until_equal(&soft(200.0), &soft(201.0)), usize::MAX);
}

#[test]
fn a_break_cuts_a_piece_where_the_tip_reaches_it() {
    let mut m = compiled(|_| ());
    m.break_positions_m = vec![0.0055, 0.0042, 0.006, 0.02];
    let piece = MotionPiece {
        block: 0,
        start_s: 2.0,
        end_s: 3.0,
        position_m: 0.005,
        velocity_mps: 0.002,
        acceleration_mps2: 0.0,
    };
    let mut broken = vec![false; 4];
    // From 4 to 6 mm: one after the other, the nearest first.
    assert_close(next_break(&m, &piece, 2.0, &mut broken), 2.1);
    assert_eq!(broken, [false, true, false, false]);
    assert_close(next_break(&m, &piece, 2.1, &mut broken), 2.75);
    assert_eq!(broken, [true, true, false, false]);
    // At the very end of the piece nothing is cut.
    assert_eq!(next_break(&m, &piece, 2.75, &mut broken), NO_RUPTURE);
    assert_eq!(broken, [true, true, true, false]);
    assert_eq!(next_break(&m, &piece, 2.75, &mut broken), NO_RUPTURE);
    assert_eq!(broken, [true, true, true, false]);
    // Passed already: at once.
    m.break_positions_m = vec![0.003];
    assert_eq!(next_break(&m, &piece, 2.25, &mut [false]), 2.25);
    let back = MotionPiece { velocity_mps: -0.002, ..piece };
    assert_eq!(next_break(&m, &back, 2.25, &mut [false]), 2.25);
    // In true positions, where recorded ones differ.
    m.break_positions_m = vec![0.0045];
    m.true_over_recorded = 0.9;
    assert_close(next_break(&m, &piece, 2.0, &mut [false]), 2.5);
}

#[test]
fn breaks_happen_once_and_in_order() {
    let mut m = compiled(|_| ());
    m.break_positions_m = vec![0.0055, 0.0042, 0.02];
    let piece = |from_s: f64, z_m: f64, v_mps: f64| MotionPiece {
        block: 0,
        start_s: from_s,
        end_s: from_s + 1.0,
        position_m: z_m + 0.5 * v_mps,
        velocity_mps: v_mps,
        acceleration_mps2: 0.0,
    };
    // From 4 to 5 mm, back, and to 6 mm.
    let actual =
        break_times(&m, &[piece(2.0, 0.004, 0.001), piece(3.0, 0.005, -0.001), piece(4.0, 0.004, 0.002)]);
    assert_eq!(actual.len(), 2);
    assert_close(actual[0], 2.2);
    assert_close(actual[1], 4.75);
}

/// With pieces of 20 ms there is a checkpoint every 0.48 s: rupture times at, next to and between them.
#[test]
fn incremental_replay_with_moved_ruptures_equals_a_full_replay() {
    let b = blocks();
    let pieces = b.motion_pieces(false, 0.0, None);
    let law = compiled(|_| ());
    let saved_s: Vec<f64> = pieces.iter().step_by(CHECKPOINT_PIECES).map(|p| p.start_s).collect();
    for k in [5, 9, 14] {
        let border = saved_s[k];
        let was = [border, border + 1.7, border + 1.9];
        let replay_cache = IncrementalReplay::new(&law, &b, &pieces, &was);
        for layer in 0..3 {
            for off in [-0.6, -0.48, -0.01, 0.01, 0.47, 0.48, 0.49, 0.96] {
                let mut now = was;
                now[layer] += off;
                if now[1] < now[0] || now[2] < now[1] {
                    continue;
                }
                let mut whole = ReplayResult::default();
                replay_with_ruptures(&law, &b, &pieces, &now, &mut whole);
                let part = replay_cache.replay_neighbour(&law, &law, &b, &pieces, &now);
                assert!(
                    part.force_n == whole.force_n && part.ruptures == whole.ruptures,
                    "{k} {layer} {off}"
                );
            }
        }
    }
}

/// A threshold that grows with the velocity: where the needle slows down it falls below the force, and the
/// layer ruptures at exactly that force.
#[test]
fn a_layer_ruptures_where_its_threshold_falls_below_the_force() {
    // A tenth per factor e in velocity: 1.2 N at 1 mm/s, about 1.36 N at 4 mm/s.
    let faster = EffectTerm::new(effect_info("rate_dependent_puncture").expect("in the library"), &[0.1]);
    let law = compiled(|m| m.effects.push(faster.clone()));
    // At 4 mm/s into the first layer until its spring holds a force between both thresholds; then at 1 mm/s.
    let held = 1.28;
    let slow_s = (0.005 + held / 200.0) / 0.004;
    let z = |t: f64| if t < slow_s { 0.004 * t } else { 0.004 * slow_s + 0.001 * (t - slow_s) };
    let b = sampled(1200, z, |_| 0.0);
    let pieces = b.motion.pieces(
        b.start_s.iter().copied().zip(b.end_s.iter().copied()),
        JumpAppearance::Delayed(0.0),
        |t| t,
    );
    let event = |at_s: f64| {
        let mut out = ReplayResult::default();
        replay_with_ruptures(&law, &b, &pieces, &[at_s, NO_RUPTURE, NO_RUPTURE], &mut out);
        out.ruptures[0]
    };
    let jump_s = b.motion.jumps[0].time_s;
    assert!((jump_s - slow_s).abs() < 1e-6);
    assert_eq!(event(jump_s).force_excess, 0.0);
    // Also within a sampling interval before the jump, but not further away.
    assert_eq!(event(slow_s - 0.002).force_excess, 0.0);
    assert!(event(slow_s - 0.012).force_excess < -0.01 && event(slow_s + 0.3).force_excess > 0.01);
}
