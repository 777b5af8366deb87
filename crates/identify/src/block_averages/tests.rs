use super::*;
use crate::motion::JumpTiming;
use crate::test_support::sampled;

fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-9 * expected.abs().max(1e-3), "{actual} for {expected}");
}

fn assert_all_close(actual: &[f64], expected: impl IntoIterator<Item = f64>) {
    let expected: Vec<f64> = expected.into_iter().collect();
    assert_eq!(actual.len(), expected.len());
    actual.iter().zip(expected).for_each(|(actual, expected)| assert_close(*actual, expected));
}

/// Constant velocity; the force at these times (s).
fn recorded(t: Vec<f64>, force: impl Fn(f64) -> f64) -> Recording {
    let z = t.iter().map(|t| 0.002 * t).collect();
    let f = t.iter().map(|t| force(*t)).collect();
    Recording::new(t, z, f).expect("a recording")
}

fn even(n: usize) -> Vec<f64> {
    (0..n).map(|k| k as f64 * 0.005).collect()
}

/// Blocks of four samples at 200 Hz.
fn of(t: Vec<f64>, force: impl Fn(f64) -> f64) -> BlockAverages {
    BlockAverages::new(&recorded(t, force), &[], BLOCK_S)
}

/// The same with one velocity jump.
fn with_jump(b: &BlockAverages, at_s: f64, between_s: f64, doubt_s: f64) -> BlockAverages {
    let jump = JumpTiming {
        time_s: at_s,
        sample_mid_s: between_s,
        time_sd_s: doubt_s,
        position_m: 0.002 * at_s,
        velocity_mps: [0.002, 0.0],
    };
    let mut motion = (*b.motion).clone();
    motion.jumps = vec![jump];
    BlockAverages { motion: Arc::new(motion), ..b.clone() }
}

#[test]
fn a_block_is_the_mean_of_its_samples_and_ends_midway_to_the_next() {
    // Sample times up to a millisecond off the regular ones.
    let off = [0.0, 0.0, 0.0, 0.001, -0.001, 0.0, 0.0];
    let t: Vec<f64> = even(43).iter().enumerate().map(|(k, t)| t + off[k % 7]).collect();
    let force = |t: f64| 1.0 + (40.0 * t).sin();
    let b = of(t.clone(), force);
    assert_eq!((b.len(), b.samples_per_block, b.is_empty()), (11, 4, false));
    assert_close(b.sample_step_s, 0.005);
    let ends: Vec<f64> = (1..11).map(|k| 0.5 * (t[4 * k - 1] + t[4 * k])).collect();
    assert_all_close(&b.start_s, [-0.0025].into_iter().chain(ends.iter().copied()));
    assert_all_close(&b.end_s, ends.iter().copied().chain([t[42] + 0.0025]));
    assert_all_close(
        &b.force_n,
        t.chunks(4).map(|t| t.iter().map(|t| force(*t)).sum::<f64>() / t.len() as f64),
    );
    // Three of four samples are more than half of a block.
    assert_eq!(b.used, [true; 11]);
    assert_eq!(b.memory_reset, core::array::from_fn::<bool, 11, _>(|k| k == 0));
    assert_eq!(*b.sample_block, (0..43).map(|k| k / 4).collect::<Vec<u32>>());
    assert_close(b.span_s().0, -0.0025);
    assert_close(b.span_s().1, t[42] + 0.0025);
    assert_eq!(
        (b.block_at(-1.0), b.block_at(ends[4]), b.block_at(ends[4] - 1e-6), b.block_at(9.0)),
        (0, 5, 4, 11)
    );
    // Two of four samples are not; a block of one sample is used.
    assert_eq!(of(even(42), force).used[10..], [false]);
    let single = BlockAverages::new(&recorded(even(20), force), &[], 0.001);
    assert_eq!((single.samples_per_block, single.len()), (1, 20));
    assert!(single.used.iter().all(|u| *u));
    let none = BlockAverages { start_s: Vec::new(), end_s: Vec::new(), ..single };
    assert_eq!((none.len(), none.is_empty(), none.span_s()), (0, true, (0.0, 0.0)));
}

#[test]
fn excluded_samples_do_not_count_and_disable_a_block_from_one_half_on() {
    let excluded = [1, 8, 9, 12, 13, 14, 15, 40];
    let exclude: Vec<bool> = (0..43).map(|k| excluded.contains(&k)).collect();
    let b = BlockAverages::new(&recorded(even(43), |t| 200.0 * t), &exclude, BLOCK_S);
    let used: Vec<usize> = (0..b.len()).filter(|k| b.used[*k]).collect();
    // Two of the last three samples remain, more than half.
    assert_eq!(used, [0, 1, 4, 5, 6, 7, 8, 9, 10]);
    assert_all_close(&b.force_n[..5], [1.5, 5.5, 10.25, 0.0, 17.5]);
    // Sample 41 represents the excluded one before it.
    assert_close(b.force_n[10], 124.0 / 3.0);
    let restart: Vec<usize> = (0..b.len()).filter(|k| b.memory_reset[*k]).collect();
    assert_eq!(restart, [0, 3, 4]);
}

#[test]
fn short_gaps_are_filled_with_blocks_that_are_not_compared() {
    let t = |gap_s: f64| -> Vec<f64> {
        even(40).iter().enumerate().map(|(k, t)| if k < 19 { *t } else { t + gap_s - 0.005 }).collect()
    };
    let b = of(t(0.1), |t| 3.0 + t);
    // Samples 16 to 18, then 0.095 s in five blocks, then four samples each.
    assert_eq!(b.len(), 5 + 5 + 6);
    let edges: Vec<f64> = (0..=5).map(|k| 0.0925 + 0.019 * f64::from(k)).collect();
    assert_all_close(&b.start_s[5..10], edges[..5].iter().copied());
    assert_all_close(&b.end_s[5..10], edges[1..].iter().copied());
    assert_all_close(&b.force_n[4..10], [3.085; 6]);
    let actual: Vec<bool> = (0..16).map(|k| !(5..10).contains(&k)).collect();
    assert_eq!(b.used[..15], actual[..15]);
    assert!(!b.used[15]);
    let restart: Vec<usize> = (0..16).filter(|k| b.memory_reset[*k]).collect();
    assert_eq!(restart, [0, 6, 7, 8, 9, 10]);
    assert_close(b.start_s[10], 0.1875);
    assert_eq!((b.sample_block[18], b.sample_block[19], b.sample_block[23]), (4, 10, 11));
    // Up to two seconds, without the half intervals at either end.
    assert_eq!(of(t(2.004), |t| t).len(), 11 + 100);
    let open = of(t(2.006), |t| t);
    assert_eq!(open.len(), 11);
    assert_eq!((0..11).filter(|k| open.memory_reset[*k]).collect::<Vec<_>>(), [0, 5]);
    // Less than 1.8 intervals is not a gap.
    assert_eq!(of(t(0.0089), |t| t).len(), 10);
    // Samples missing for longer than a block leave a gap.
    assert_eq!(of(t(0.0239), |t| t).len(), 11);
    assert_eq!(of(t(0.0241), |t| t).len(), 11 + 1);
}

/// The remaining samples stay in the blocks they would otherwise be in, and the noise memory continues.
#[test]
fn a_few_missing_samples_do_not_move_the_blocks() {
    let missing = [5, 11, 12, 19, 20, 21, 30, 39];
    let t = even(43).into_iter().enumerate().filter(|(k, _)| !missing.contains(k)).map(|(_, t)| t);
    let (b, whole) = (of(t.collect(), |t| 200.0 * t), of(even(43), |t| 200.0 * t));
    assert_all_close(&b.start_s, whole.start_s.iter().copied());
    assert_all_close(&b.end_s, whole.end_s.iter().copied());
    // A linear force keeps its mean when samples are missing inside, and half of the error when they are
    // missing at an end.
    assert_all_close(&b.force_n[1..6], [5.5, 9.25, 13.75, 17.25, 22.25]);
    assert_eq!((0..11).filter(|k| !b.used[*k]).collect::<Vec<_>>(), [5]);
    assert_eq!((0..11).filter(|k| b.memory_reset[*k]).collect::<Vec<_>>(), [0, 6]);
}

/// Within a margin of the jump, or within its timing uncertainty.
#[test]
fn a_block_with_a_sample_at_a_velocity_jump_is_excluded() {
    let t = even(40);
    let b = of(t.clone(), |t| t);
    let left_out = |at_s: f64, doubt_s: f64| -> Vec<usize> {
        let mut b = with_jump(&b, at_s, at_s, doubt_s);
        b.exclude_jump_blocks(&t);
        (0..b.len()).filter(|k| !b.used[*k]).collect()
    };
    // Sample 18 at 0.09 s is in block 4, which spans 0.0775 to 0.0975 s.
    assert_eq!(left_out(0.09, 0.0), [4]);
    assert_eq!(left_out(0.09 + 0.00014, 0.0), [4]);
    assert_eq!(left_out(0.09 - 0.00014, 0.0), [4]);
    assert_eq!(left_out(0.09 + 0.00016, 0.0), [0_usize; 0]);
    assert_eq!(left_out(0.09 - 0.00016, 0.0), [0_usize; 0]);
    assert_eq!(left_out(0.0925, 0.0024), [0_usize; 0]);
    assert_eq!(left_out(0.0925, 0.0026), [4]);
    // All existing blocks within the uncertainty.
    assert_eq!(left_out(0.0775, 0.003), [3, 4]);
    assert_eq!(left_out(0.0775, 0.021), [2, 3, 4, 5]);
    assert_eq!(left_out(0.19, 0.03), [8, 9]);
    // In a recording: the needle stops at sample 60, in block 15.
    let b = sampled(400, |t| 0.002 * t.min(0.3), |_| 0.0);
    assert_eq!((0..100).filter(|k| !b.used[*k]).collect::<Vec<_>>(), [15]);
}

#[test]
fn coarsened_blocks_average_whole_groups_and_do_not_span_gaps() {
    // 36 samples, three seconds of nothing, 32 samples: nine blocks and eight.
    let t: Vec<f64> = even(68).iter().enumerate().map(|(k, t)| if k < 36 { *t } else { t + 3.0 }).collect();
    let exclude: Vec<bool> = (0..68).map(|k| (12..16).contains(&k)).collect();
    let b = BlockAverages::new(&recorded(t, |t| (9.0 * t).cos()), &exclude, BLOCK_S);
    assert_eq!(b.len(), 17);
    let fine = b.motion_pieces(true, 0.0, None);
    let c = b.coarsened(4);
    let groups = [(0, 4), (4, 8), (8, 9), (9, 13), (13, 17)];
    assert_eq!((c.len(), c.samples_per_block), (5, 16));
    assert_all_close(&c.start_s, groups.map(|g| b.start_s[g.0]));
    assert_all_close(&c.end_s, groups.map(|g| b.end_s[g.1 - 1]));
    assert_all_close(
        &c.force_n,
        groups.map(|g| b.force_n[g.0..g.1].iter().sum::<f64>() / (g.1 - g.0) as f64),
    );
    // The first group contains a block that is not compared, the third is incomplete.
    assert_eq!(c.used, [false, true, false, true, true]);
    assert_eq!(c.memory_reset, [true, true, false, true, false]);
    assert_eq!((c.abs_force_n.len(), c.extra_sd_n.len()), (5, 5));
    // Motion pieces follow the coarser blocks.
    for pieces in [c.motion_pieces(false, 0.0, None), c.motion_pieces(true, 0.0, None)] {
        assert_eq!(pieces.iter().map(|p| p.block).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
        assert_all_close(&pieces.iter().map(|p| p.end_s).collect::<Vec<_>>(), c.end_s.iter().copied());
    }
    assert_eq!(fine.len(), 17);
}

#[test]
fn force_magnitude_is_smoothed_over_a_tenth_of_a_second() {
    // Blocks of 30 ms: two on each side.
    let b = BlockAverages::new(&recorded(even(66), |t| (20.0 * t).sin()), &[], 0.03);
    assert_eq!((b.len(), b.samples_per_block), (11, 6));
    let around = |k: usize| -> Vec<f64> {
        (0..11).filter(|i: &usize| i.abs_diff(k) <= 2).map(|i| b.force_n[i]).collect()
    };
    assert_all_close(
        &b.abs_force_n,
        (0..11).map(|k| (around(k).iter().sum::<f64>() / around(k).len() as f64).abs()),
    );
    // At least one block on each side.
    let long = BlockAverages::new(&recorded(even(200), |t| t), &[], 0.2);
    assert_all_close(&long.abs_force_n[..2], [0.5 * (long.force_n[0] + long.force_n[1]), long.force_n[1]]);
}

#[test]
fn a_block_mean_with_a_velocity_jump_is_uncertain_by_one_sampling_interval() {
    let force = |t: f64| if t < 0.096 { 1.0 } else { 3.0 };
    let b = of(even(40), force);
    let doubts = |at_s: f64, between_s: f64| {
        let mut b = with_jump(&b, at_s, between_s, 0.0);
        b.derive_columns();
        b.extra_sd_n
    };
    // A quarter of 2 N, uniformly distributed; block 4 ends at 0.0975 s.
    let at = |block: usize| (0..10).map(move |k| if k == block { 0.5 * 0.289 } else { 0.0 });
    assert_all_close(&doubts(0.0, 0.096), at(4));
    assert_all_close(&doubts(0.096, 0.098), at(5));
    // At either end the jump height is unknown.
    for between_s in [0.0, 0.19, 0.5] {
        assert_all_close(&doubts(0.096, between_s), [0.0; 10]);
    }
    // The same at a break; in coarser blocks still one sampling interval.
    let fell = of(even(40), force).with_break_times(vec![0.09]);
    assert_all_close(&fell.extra_sd_n, at(4));
    assert_all_close(&fell.with_delayed_jump_uncertainty(0.01).extra_sd_n, at(4));
    let coarse = of(even(80), force).with_break_times(vec![0.09]).coarsened(3);
    assert_close(coarse.extra_sd_n[1], 2.0 / 12.0 * 0.289);
    // The larger of two jumps counts.
    let mut two = with_jump(&b, 0.0, 0.09, 0.0);
    two.add_jump_uncertainty(0.09);
    two.extra_sd_n[4] *= 3.0;
    two.add_jump_uncertainty(0.09);
    assert_close(two.extra_sd_n[4], 1.5 * 0.289);
}

#[test]
fn unmodelled_force_adds_to_the_uncertainty_of_a_block_mean() {
    let force = |t: f64| if t < 0.09 { 1.0 } else { 3.0 };
    let left: Vec<f64> = (0..10).map(|k| 0.1 * f64::from(k)).collect();
    let b = of(even(40), force).with_unmodelled_sd(left.clone());
    assert_all_close(&b.extra_sd_n, left.clone());
    // The larger of both at a break; the unmodelled part averages as independent noise.
    let fell = b.clone().with_break_times(vec![0.09]);
    assert_all_close(&fell.extra_sd_n, left.iter().map(|l| l.max(if *l == 0.4 { 0.5 * 0.289 } else { 0.0 })));
    assert_close(b.coarsened(2).extra_sd_n[1], (0.04_f64 + 0.09).sqrt() / 2.0);
    assert_all_close(
        &fell.with_unmodelled_sd(vec![0.0; 10]).with_break_times(Vec::new()).extra_sd_n,
        [0.0; 10],
    );
}

#[test]
fn a_delayed_force_is_uncertain_where_jump_and_sample_coincide() {
    let b = of(even(60), |t| 100.0 * t * t);
    let size = |k: usize| (b.force_n[k + 1] - b.force_n[k - 1]).abs() / 4.0 * 0.289;
    let late = |doubt_s: f64, late_s: f64| -> Vec<usize> {
        let seen = with_jump(&b, 0.06, 0.062, doubt_s).with_delayed_jump_uncertainty(late_s);
        let actual: Vec<usize> = (0..15).filter(|k| seen.extra_sd_n[*k] > 0.0).collect();
        actual.iter().for_each(|k| assert_close(seen.extra_sd_n[*k], size(*k)));
        actual
    };
    // Between samples it is in block 3, as without a delay.
    assert_eq!(late(0.0, 0.0772), [3]);
    // Around 0.1375 s, between samples at 0.135 and 0.14, the end of block 6: certain until the uncertainty
    // reaches a sample.
    assert_eq!(late(0.0024, 0.0775), [3]);
    assert_eq!(late(0.0026, 0.0775), [3, 6, 7]);
    // A sample closer than 3 % of an interval may have either velocity.
    assert_eq!(late(0.0, 0.08 + 0.00014), [3, 7]);
    assert_eq!(late(0.0, 0.08 - 0.00014), [3, 7]);
    assert_eq!(late(0.0, 0.08 + 0.00016), [3]);
    assert_eq!(late(0.0, 0.08 - 0.00016), [3]);
}

#[test]
fn sample_midpoints_exclude_gaps_and_ends() {
    let t: Vec<f64> = even(20).iter().map(|t| if *t < 0.048 { *t } else { t + 0.1 }).collect();
    let b = of(t, |t| t);
    assert_close(b.sample_midpoint_s(0.0131), 0.0125);
    assert_close(b.sample_midpoint_s(0.0149), 0.0125);
    assert_close(b.sample_midpoint_s(0.0151), 0.0175);
    // In a gap and outside of the recording the time itself is used.
    for at_s in [0.0799, -0.003, 0.2] {
        assert_close(b.sample_midpoint_s(at_s), at_s);
    }
    assert_close(b.sample_midpoint_s(0.0), 0.0025);
}

#[test]
fn motion_is_cut_where_jumps_appear_in_the_force() {
    let b = sampled(120, |t| 0.002 * t.min(0.3013), |_| 0.0);
    let cut = |smeared: bool, late_s: f64, placed: Option<f64>| {
        let pieces = b.motion_pieces(smeared, late_s, placed);
        let ends: Vec<f64> =
            pieces.windows(2).filter(|p| p[0].block == p[1].block).map(|p| p[0].end_s).collect();
        assert_eq!((pieces.len(), ends.len()), (31, 1));
        (ends[0], pieces.iter().find(|p| p.end_s == ends[0]).map_or(0.0, |p| p.velocity_mps))
    };
    let is = |(at_s, v): (f64, f64), expected: f64| {
        assert!((at_s - expected).abs() < 1e-5 && (v - 0.002).abs() < 1e-7, "{at_s} for {expected}, {v}");
    };
    is(cut(false, 0.0, None), 0.3025);
    is(cut(false, 0.0, Some(0.02)), 0.3025);
    is(cut(true, 0.0, None), 0.3013);
    is(cut(true, 0.0, Some(0.02)), 0.3013);
    for smeared in [false, true] {
        is(cut(smeared, 0.0271, None), 0.3284);
    }
    is(cut(true, 0.0271, Some(0.0271)), 0.3284);
    is(cut(false, 0.0271, Some(0.0271)), 0.3275);
    is(cut(false, 0.0271, Some(0.0301)), 0.3325);
}

#[test]
fn sample_residuals_interpolate_block_residuals_linearly() {
    let b = of(even(48), |t| 2.0 - 30.0 * t);
    let e: Vec<f64> = (0..12).map(|k| 0.3 + 0.01 * f64::from(k)).collect();
    // The middle of block k is at sample 4 k + 1.5.
    assert_all_close(&b.sample_residuals(&e), (0..48).map(|i| 0.3 + 0.01 * (f64::from(i) - 1.5) / 4.0));
    // A sample's own deviation is added.
    let mut raw = (*b.sample_force_n).clone();
    raw[21] += 0.7;
    let spiked = BlockAverages { sample_force_n: Arc::new(raw), ..b.clone() };
    let actual: Vec<f64> =
        spiked.sample_residuals(&e).iter().zip(b.sample_residuals(&e)).map(|(a, b)| a - b).collect();
    assert_all_close(&actual, (0..48).map(|i| if i == 21 { 0.7 } else { 0.0 }));
    // The slope is the one between the neighbouring means.
    let mut bent = e.clone();
    bent[5] += 0.4;
    let actual = b.sample_residuals(&bent);
    for (i, off) in [(16, -1.5), (17, -0.5), (18, 0.5), (19, 1.5)] {
        assert_close(actual[i], 0.3 + 0.01 * (i as f64 - 1.5) / 4.0 + 0.4 / 8.0 * off);
    }
    assert_close(actual[20], 0.3 + 0.01 * 18.5 / 4.0 + 0.4);
}

#[test]
fn within_block_deviation_excludes_the_largest_tenth() {
    // In block k samples alternate by k + 1 mN, in two of twenty blocks by a hundred times as much.
    let size = |k: usize| 0.001 * (k + 1) as f64 * if k == 3 || k == 11 { 100.0 } else { 1.0 };
    let force = |t: f64| {
        let i = (t / 0.005).round() as usize;
        0.5 + size(i / 4) * if i.is_multiple_of(2) { 1.0 } else { -1.0 }
    };
    let b = of(even(80), force);
    let calm: f64 = (0..20).filter(|k| *k != 3 && *k != 11).map(|k| size(k) * size(k)).sum();
    assert!((b.within_block_sd_n() - (calm / 18.0).sqrt()).abs() < 1e-9, "{}", b.within_block_sd_n());
    // One more sample is a block without a spread; one that follows the course of the means changes
    // nothing.
    let more = of(even(81), |t| if t > 0.398 { 0.5 } else { force(t) });
    assert!((more.within_block_sd_n() - b.within_block_sd_n()).abs() < 1e-9);
    assert_eq!(BlockAverages::new(&recorded(even(80), force), &[], 0.001).within_block_sd_n(), 0.0);
    // A force that rises by 20 N/s changes by 0.3 N within a block without adding noise.
    let rising = of(even(80), |t| force(t) + 20.0 * t);
    assert!(
        (rising.within_block_sd_n() - b.within_block_sd_n()).abs() < 1e-9,
        "{}",
        rising.within_block_sd_n()
    );
}
