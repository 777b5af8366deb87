use super::super::tests::{assert_close, bent, from_knots};
use super::super::{MAX_EXACT_SD_MPS, VelocityJump};
use super::*;

/// A piece with its block, limits, mean position and velocity.
fn is(piece: &MotionPiece, block: u32, (from_s, to_s): (f64, f64), z_m: f64, v_mps: f64) {
    assert_eq!(piece.block, block);
    assert_close(piece.start_s, from_s);
    assert_close(piece.end_s, to_s);
    assert_close(piece.position_m, z_m);
    assert_close(piece.velocity_mps, v_mps);
    assert!(piece.acceleration_mps2.abs() < 1e-9, "{piece:?}");
}

fn pieces(m: &Motion, spans: &[(f64, f64)], shown: JumpAppearance) -> Vec<MotionPiece> {
    // Sample midpoints every 0.1 s.
    m.pieces(spans.iter().copied(), shown, |t| 0.1 * (10.0 * t).floor() + 0.05)
}

#[test]
fn pieces_without_delay_cut_jumps_between_samples() {
    let m = bent();
    let spans = [(-0.1, 0.1), (0.3, 0.5), (0.5, 0.7), (0.7, 0.77), (1.15, 1.25)];
    let actual = pieces(&m, &spans, JumpAppearance::BetweenSamples);
    assert_eq!(actual.len(), 6);
    // Before the first sample position and velocity are those of the first one.
    is(&actual[0], 0, (-0.1, 0.1), 0.25 * 0.2, 2.0);
    is(&actual[1], 1, (0.3, 0.5), 0.8, 2.0);
    // The jump appears midway between its samples.
    is(&actual[2], 2, (0.5, 0.55), 1.05, 2.0);
    is(&actual[3], 2, (0.55, 0.7), 0.965, -1.0);
    is(&actual[4], 3, (0.7, 0.77), 0.855, -1.0);
    is(&actual[5], 4, (1.15, 1.25), 0.5 * (0.415 + 0.39), -1.0);
    // A span that ends at a jump is not cut.
    let actual = pieces(&m, &[(0.4, 0.55), (0.55, 0.6)], JumpAppearance::BetweenSamples);
    assert_eq!(actual.len(), 2);
    is(&actual[1], 1, (0.55, 0.6), 1.015, -1.0);
    // Nor is one that ends within a millionth of its length; the same for reversals.
    let cuts = |m: &Motion, from_s: f64, to_s: f64| {
        pieces(m, &[(from_s, to_s)], JumpAppearance::BetweenSamples).len() - 1
    };
    let t: Vec<f64> = (0..=12).map(|k| 0.1 * f64::from(k)).collect();
    let v: Vec<f64> = t.iter().map(|t| 1.0 - 1.8 * t).collect();
    let turn = from_knots(&t, &[0.0; 13], &v, &[], 0.0, 0.0);
    for m in [&m, &turn] {
        for (share, expected) in [(3e-7, 0), (3e-6, 1)] {
            assert_eq!(cuts(m, 0.55 - 0.2 * share, 0.75), expected);
            assert_eq!(cuts(m, 0.35, 0.55 + 0.2 * share), expected);
            assert_eq!(cuts(m, 0.55 - 0.02 * share, 0.57), expected);
        }
    }
}

#[test]
fn pieces_with_delay_show_the_earlier_motion() {
    let m = bent();
    let actual = pieces(&m, &[(0.3, 0.5), (0.5, 0.7), (0.7, 0.9)], JumpAppearance::Delayed(0.04));
    assert_eq!(actual.len(), 4);
    is(&actual[0], 0, (0.3, 0.5), 0.72, 2.0);
    is(&actual[1], 1, (0.5, 0.57), 2.0 * 0.495, 2.0);
    is(&actual[2], 1, (0.57, 0.7), 1.06 - 0.065, -1.0);
    is(&actual[3], 2, (0.7, 0.9), 1.06 - 0.23, -1.0);
    // Without a delay the exact time appears.
    let actual = pieces(&m, &[(0.5, 0.7)], JumpAppearance::Delayed(0.0));
    is(&actual[0], 0, (0.5, 0.53), 1.03, 2.0);
    is(&actual[1], 0, (0.53, 0.7), 1.06 - 0.085, -1.0);
}

#[test]
fn delayed_jumps_between_samples_extend_either_side() {
    let m = bent();
    let spans = [(0.3, 0.5), (0.5, 0.7), (0.7, 0.9)];
    let placed = |late_s: f64, placed_s: f64| {
        pieces(&m, &spans, JumpAppearance::DelayedBetweenSamples { delay_s: late_s, jump_delay_s: placed_s })
    };
    // It jumps at 0.57 s, which appears at 0.55 s: the retraction is longer than in fact.
    let actual = placed(0.04, 0.04);
    assert_eq!(actual.len(), 4);
    is(&actual[0], 0, (0.3, 0.5), 0.72, 2.0);
    is(&actual[1], 1, (0.5, 0.55), 2.0 * 0.485, 2.0);
    is(&actual[2], 1, (0.55, 0.7), 1.06 - (0.625 - 0.57), -1.0);
    is(&actual[3], 2, (0.7, 0.9), 1.06 - (0.8 - 0.57), -1.0);
    // It jumps at 0.54 s: the insertion is longer.
    let actual = placed(0.01, 0.01);
    is(&actual[1], 1, (0.5, 0.55), 2.0 * 0.515, 2.0);
    is(&actual[2], 1, (0.55, 0.7), 1.06 - (0.625 - 0.54), -1.0);
    // The placement may use another delay.
    let actual = placed(0.01, 0.08);
    assert_eq!(actual.len(), 4);
    is(&actual[1], 1, (0.5, 0.65), 2.0 * 0.565, 2.0);
    is(&actual[2], 1, (0.65, 0.7), 1.06 - (0.675 - 0.54), -1.0);
}

#[test]
fn a_piece_has_the_acceleration() {
    // v = 1 + 3 t, linear everywhere.
    let t: Vec<f64> = (0..20).map(|k| 0.1 * f64::from(k)).collect();
    let v: Vec<f64> = t.iter().map(|t| 1.0 + 3.0 * t).collect();
    // Noisy positions: the velocity does not belong to them.
    let m = from_knots(&t, &[0.25; 20], &v, &[], 1e-3, 0.0);
    for p in pieces(&m, &[(0.23, 0.61), (0.61, 0.75), (1.0, 1.1)], JumpAppearance::BetweenSamples) {
        assert!((p.acceleration_mps2 - 3.0).abs() < 1e-9, "{p:?}");
        assert_close(p.velocity_mps, 1.0 + 1.5 * (p.start_s + p.end_s));
        assert_close(p.position_m, 0.25);
        assert_close(p.at(p.start_s).1, 1.0 + 3.0 * p.start_s);
        assert_close(p.at(p.end_s).0, 0.25 + p.velocity_mps * 0.5 * (p.end_s - p.start_s));
    }
}

#[test]
fn the_mean_velocity_of_exact_positions_is_exact_for_a_cubic_motion() {
    let position = |t: f64| 2.0 * t * t - t * t * t;
    let t: Vec<f64> = (0..20).map(|k| 0.1 * f64::from(k)).collect();
    let z: Vec<f64> = t.iter().map(|t| position(*t)).collect();
    let v: Vec<f64> = t.iter().map(|t| 4.0 * t - 3.0 * t * t).collect();
    let m = from_knots(&t, &z, &v, &[], 0.0, 0.0);
    for p in pieces(&m, &[(0.23, 0.61), (0.61, 0.75), (1.0, 1.1)], JumpAppearance::BetweenSamples) {
        assert_close(p.velocity_mps, (position(p.end_s) - position(p.start_s)) / (p.end_s - p.start_s));
    }
}

#[test]
fn reversals_cut_pieces() {
    let t: Vec<f64> = (0..=12).map(|k| 0.1 * f64::from(k)).collect();
    let of = |v: &dyn Fn(f64) -> f64, sd: f64| {
        let v: Vec<f64> = t.iter().map(|t| v(*t)).collect();
        from_knots(&t, &[0.0; 13], &v, &[], sd, 0.0)
    };
    // 1 m/s at first, zero at 5/11 s.
    let slowing = of(&|t| 1.0 - 2.2 * t, 0.0);
    assert_eq!(slowing.reversals_s.len(), 1);
    assert_close(slowing.reversals_s[0].0, 1.0 / 2.2);
    assert_close(slowing.reversals_s[0].1, 0.45);
    // Sampled in the middle, delayed at the exact time.
    let cut = |shown: JumpAppearance| {
        let actual = pieces(&slowing, &[(0.3, 0.4), (0.4, 0.6)], shown);
        assert_eq!(actual.iter().map(|p| p.block).collect::<Vec<_>>(), [0, 1, 1]);
        actual[1].end_s
    };
    assert_close(cut(JumpAppearance::BetweenSamples), 0.45);
    assert_close(cut(JumpAppearance::Delayed(0.02)), 1.0 / 2.2 + 0.02);
    assert_close(cut(JumpAppearance::DelayedBetweenSamples { delay_s: 0.02, jump_delay_s: 0.06 }), 0.55);
    // One reversal each way.
    let swinging = of(&|t| (core::f64::consts::TAU * (t + 0.03)).cos(), 0.0);
    let middles: Vec<f64> = swinging.reversals_s.iter().map(|t| t.1).collect();
    assert_eq!(middles.len(), 2);
    assert_close(middles[0], 0.25);
    assert_close(middles[1], 0.75);
    // None without a sign change, in a hold, or at a jump; none from noisy positions.
    assert!(of(&|t| 1.0 - 0.8 * t, 0.0).reversals_s.is_empty());
    assert!(of(&|_| 0.0, 0.0).reversals_s.is_empty());
    assert!(bent().reversals_s.is_empty());
    assert_eq!(of(&|t| 1.0 - 2.2 * t, MAX_EXACT_SD_MPS).reversals_s.len(), 1);
    assert!(of(&|t| 1.0 - 2.2 * t, 1.01 * MAX_EXACT_SD_MPS).reversals_s.is_empty());
    // A jump elsewhere does not hide it.
    let jump = |sample: usize| VelocityJump {
        next_sample: sample,
        time_s: 0.1 * sample as f64 - 0.05,
        position_m: 0.0,
        velocity_mps: [1.0, 0.9],
        position_sd_m: 0.0,
    };
    let both = |sample: usize| {
        let v: Vec<f64> = t.iter().map(|t| 1.0 - 2.2 * t).collect();
        from_knots(&t, &[0.0; 13], &v, &[jump(sample)], 0.0, 0.0)
    };
    assert_eq!([4, 5, 6].map(|sample| both(sample).reversals_s.len()), [1, 0, 1]);
    // What lies after a span does not cut it: a jump at 0.35 s and a reversal at 0.45 s.
    let actual = pieces(&both(4), &[(0.0, 0.3), (0.3, 0.5)], JumpAppearance::BetweenSamples);
    let ends: Vec<f64> = actual.iter().map(|p| p.end_s).collect();
    assert_eq!(ends.len(), 4);
    ends.iter().zip([0.3, 0.35, 0.45, 0.5]).for_each(|(actual, expected)| assert_close(*actual, expected));
}
