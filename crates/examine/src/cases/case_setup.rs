//! Draws the setup of a case from its identifier. The draw is repeated until the hidden effects have the required strength and
//! are distinguishable.

use super::case_definition::CaseSetup;
use super::case_id::{CaseId, Hide, Size};
use super::custom_effect::CustomEffect;
use super::distinguishable_effects::{is_clear_of_ruptures, is_identified_by_ruptures};
use super::draw_effect;
use super::draw_motion::{self, log_uniform, uniform};
use super::draw_tissue;
use super::hide_effects::{hide_custom_effect, hide_effects};
use super::misspecification_amounts::MisspecificationAmounts;
use crate::simulator::rich_world::RichEffects;
use crate::simulator::sensor_noise::SensorNoise;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use std::sync::Arc;

/// Largest number of draws of a case whose effect misses the required strength.
const ATTEMPTS: u64 = 6;

/// Draws everything but the noise realisation. `custom` are the effects of which a case with [`Hide::Custom`] hides one; without any it
/// hides nothing.
#[must_use]
pub fn set_up_case(id: &CaseId, custom: &[Arc<dyn CustomEffect>]) -> CaseSetup {
    let (low, high) = strength_range_sd(id.size);
    let mut kept: Option<(f64, CaseSetup)> = None;
    for attempt in 0..ATTEMPTS {
        let setup = attempt_at(id, custom, attempt);
        let drawn_with_number = setup.rich.foundation.is_some() || setup.rich.damage.is_some();
        let free = id.hide == Hide::Clean
            || drawn_with_number
            || setup.effects.iter().any(draw_effect::has_size_parameter);
        let off = if !is_clear_of_ruptures(&setup) || !is_identified_by_ruptures(&setup, id.size) {
            f64::INFINITY
        } else if free {
            0.0
        } else if setup.strength_sd < 0.95 * low {
            low / setup.strength_sd
        } else if setup.strength_sd > 1.3 * high {
            setup.strength_sd / high
        } else {
            0.0
        };
        if kept.as_ref().is_none_or(|k| off < k.0) {
            kept = Some((off, setup));
        }
        if off == 0.0 {
            break;
        }
    }
    kept.map_or_else(|| attempt_at(id, custom, 0), |k| k.1)
}

/// Least and largest strength of a size, in noise standard deviations.
#[must_use]
pub fn strength_range_sd(size: Size) -> (f64, f64) {
    match size {
        Size::Faint => (0.15, 0.5),
        Size::Medium => (0.5, 5.0),
        Size::Strong => (5.0, 15.0),
    }
}

fn attempt_at(id: &CaseId, custom: &[Arc<dyn CustomEffect>], attempt: u64) -> CaseSetup {
    let mut rng = ChaCha8Rng::seed_from_u64(id.case_seed());
    rng.set_stream(1 + attempt);
    let amounts = MisspecificationAmounts::of(id.wrong, id.severity);
    // A separate generator, so that the number of layers does not shift the later draws.
    let mut stack_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let assumed = draw_tissue::draw_assumed_tissue(&mut stack_rng, amounts.stack);
    let truth =
        draw_tissue::draw_true_tissue(&mut ChaCha8Rng::seed_from_u64(rng.random()), &assumed, &amounts);
    let mut path_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let noise = noise(&mut ChaCha8Rng::seed_from_u64(rng.random()), &amounts);
    let mut rng = ChaCha8Rng::seed_from_u64(rng.random());
    // The motion ends slightly beyond the assumed layers.
    let (start_m, depth_m) = (-amounts.air_m, 1.03 * assumed.end_m() + 3e-3);
    let hurry = if amounts.rate_hz > 2000.0 { 2.0 } else { 1.0 };
    let paths = if id.hide == Hide::Instrument {
        draw_motion::draw_repeats(&mut path_rng, start_m, depth_m)
    } else {
        draw_motion::draw_motions(&mut path_rng, amounts.recordings, start_m, depth_m, hurry)
    };
    let mut setup = CaseSetup {
        amounts,
        assumed,
        truth,
        paths,
        noise,
        world: id.world,
        rich: RichEffects::default(),
        effects: Vec::new(),
        custom: None,
        shape: None,
        strength_sd: 0.0,
    };
    let (low, high) = strength_range_sd(id.size);
    // Slightly inside the range, so that the last step of the search need not be exact.
    let target = log_uniform(&mut rng, 1.1 * low, 0.9 * high) * setup.noise.sd_n;
    if id.hide == Hide::Custom {
        hide_custom_effect(&mut rng, id, custom, &mut setup, target);
    } else {
        hide_effects(&mut rng, id, &mut setup, target);
    }
    if setup.amounts.guess > 1.0 {
        setup.assumed = draw_tissue::draw_guessed_tissue(&mut rng, &setup.assumed, &setup.amounts);
    }
    setup
}

fn noise(rng: &mut ChaCha8Rng, amounts: &MisspecificationAmounts) -> SensorNoise {
    let sd_n = uniform(rng, 0.015, 0.025);
    let rho = [0.0, 0.5, 0.9][rng.random_range(0..3)];
    let middle = if rng.random::<bool>() { 50.0 } else { 60.0 };
    SensorNoise {
        sd_n,
        ar: amounts.ar.unwrap_or([rho, 0.0]),
        tails: amounts.tails,
        growing: amounts.growing,
        wander_n: amounts.wander * sd_n,
        hum: (amounts.hum > 0.0).then_some((amounts.hum * sd_n, middle)),
        spikes: None,
    }
}
