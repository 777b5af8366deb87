//! How strong what is hidden is, and drawn to be.

use std::sync::Arc;
use stylet_diagnose::assumptions_of;
use stylet_diagnose::base_law_fit::{PreparedRecordings, fit_base_law};
use stylet_diagnose::held_out::predict_free_run;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::fit::Fit;
use stylet_identify::likelihood::FitData;
use stylet_own_world::{Drawn, Sketch};
use stylet_tissue::{AnyEffect, Effect, ForceGain};

/// Strength of what is hidden after re-fitting the base law.
fn strength(drawn: &Drawn) -> Option<f64> {
    let case = stylet_own_world::case(drawn);
    let blocks = case.recordings.iter().map(|r| BlockAverages::new(r, &[], BLOCK_S)).collect();
    let (fit, data) =
        fit_base_law(&PreparedRecordings::new(Arc::new(assumptions_of(&case.believed)), blocks, 0.0))?;
    Some(size_of(&fit, &data, drawn))
}

/// Root mean square of what the fitted base law leaves of the force without noise, in standard deviations of the noise.
pub(super) fn size_of(fit: &Fit, data: &FitData, drawn: &Drawn) -> f64 {
    let mut clean = data.clone();
    let mut blocks = clean.recordings.to_vec();
    for (b, f) in blocks.iter_mut().zip(&stylet_own_world::clean_force(drawn)) {
        let mut sums = vec![(0.0, 0.0); b.len()];
        for (f, k) in f.iter().zip(b.sample_block.iter()) {
            sums[*k as usize].0 += f;
            sums[*k as usize].1 += 1.0;
        }
        b.force_n = sums.iter().map(|(s, n)| s / f64::max(*n, 1.0)).collect();
    }
    clean.recordings = Arc::new(blocks);
    let (mut square, mut n) = (0.0, 0.0);
    for r in 0..clean.recording_count() {
        let Some(left) = predict_free_run(&fit.model, &clean, r) else { continue };
        let b = &clean.recordings[r];
        // A rupture early or late by a part of a sample says nothing of an effect.
        let near =
            |k: usize| left.rupture_times_s.iter().any(|t| t.is_finite() && b.block_at(*t).abs_diff(k) <= 1);
        for k in (0..b.len()).filter(|k| b.used[*k] && !near(*k)) {
            square += left.residual_n[k] * left.residual_n[k];
            n += 1.0;
        }
    }
    let mut square = square / f64::max(n, 1.0);
    for e in &drawn.effects {
        if let AnyEffect::ForceSpikes(s) = e {
            square += s.rate_hz / stylet_own_world::SAMPLE_HZ * s.size_n * s.size_n;
        }
    }
    square.sqrt() / drawn.noise_n
}

/// Draws the strengths that a sketch aims at.
#[must_use]
pub fn aim(sketch: &Sketch) -> Drawn {
    let mut drawn = sketch.drawn.clone();
    if drawn.effects.is_empty() {
        return drawn;
    }
    let target = sketch.target / (drawn.effects.len() as f64).sqrt();
    let largest = stylet_own_world::largest_force(&drawn);
    let all = drawn.effects.clone();
    let mut made = Vec::new();
    for effect in all {
        let mut e = effect;
        if e.id() == ForceGain::ID {
            made.push(e);
            continue;
        }
        for _ in 0..4 {
            let one = Drawn { effects: vec![e.clone()], ..drawn.clone() };
            let Some(s) = strength(&one) else { break };
            let factor = target / s.max(1e-3);
            if (0.8..1.25).contains(&factor) {
                break;
            }
            let Some(next) = stylet_own_world::scaled(&e, factor.clamp(0.02, 30.0), largest) else { break };
            e = next;
        }
        made.push(e);
    }
    drawn.effects = made;
    drawn
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use stylet_own_world::{Kind, Motions};
    use stylet_tissue::{ForceSpikes, PeriodicInterference};

    pub(in crate::benchmark::own) fn drawn(effects: Vec<AnyEffect>) -> Drawn {
        Drawn {
            seed: 21,
            effects,
            outside: None,
            noise_n: 0.02,
            ar: [0.0; 2],
            off: 0.1,
            motions: Motions::One,
            scatter: 0.0,
            velocity_noise_mps: 0.0,
        }
    }

    pub(in crate::benchmark::own) fn tone(amplitude_n: f64) -> AnyEffect {
        PeriodicInterference { amplitude_n, frequency_hz: 5.0, phase_rad: 0.3 }.into()
    }

    #[test]
    fn strengths_are_what_the_refitted_base_law_leaves_over_the_noise() {
        let nothing = strength(&drawn(Vec::new())).expect("a fit");
        assert!(nothing < 0.05, "{nothing}");
        // Spikes leave what they are by themselves: so many a second of so much.
        let spikes = ForceSpikes { rate_hz: 0.5, size_n: 0.8 };
        let told = strength(&drawn(vec![spikes.into()])).expect("a fit");
        let wanted = (0.5 / 200.0 * 0.8 * 0.8_f64).sqrt() / 0.02;
        assert!((told / wanted - 1.0).abs() < 0.02, "{told} for {wanted}");
        // A tone that no number of the base law follows, its mean over blocks of 20 ms.
        let of = |a: f64| strength(&drawn(vec![tone(a)])).expect("a fit");
        let (little, much) = (of(0.05), of(0.1));
        let seen = (0.1 * std::f64::consts::PI).sin() / (0.1 * std::f64::consts::PI);
        let wanted = 0.05 / 2.0_f64.sqrt() * seen / 0.02;
        assert!((little / wanted - 1.0).abs() < 0.02, "{little} for {wanted}");
        assert!((much / little - 2.0).abs() < 0.02, "{little} {much}");
    }

    #[test]
    fn strengths_are_drawn_to_the_target_and_what_the_base_law_swallows_is_left() {
        let sketch = |effects: Vec<AnyEffect>, target: f64| Sketch {
            kind: Kind::Single,
            target,
            drawn: drawn(effects),
        };
        for target in [3.0, 8.0] {
            let made = aim(&sketch(vec![tone(0.01)], target));
            let told = strength(&made).expect("a fit");
            assert!((0.8..1.25).contains(&(target / told)), "{told} for {target}");
        }
        let same = aim(&sketch(vec![ForceGain { eps: 0.02 }.into()], 8.0));
        assert_eq!(same.effects[0].parameters(), [0.02]);
        assert!(aim(&sketch(Vec::new(), 8.0)).effects.is_empty());
        // Two share the square of the strength.
        let two = aim(&sketch(vec![tone(0.01), ForceGain { eps: 0.02 }.into()], 8.0));
        let alone = Drawn { effects: vec![two.effects[0].clone()], ..two };
        let told = strength(&alone).expect("a fit") * 2.0_f64.sqrt();
        assert!((0.8..1.25).contains(&(8.0 / told)), "{told}");
    }
}
