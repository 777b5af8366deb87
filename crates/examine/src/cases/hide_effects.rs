//! Adds hidden effects, rich-law effects and unmodelled shapes to a case and scales them to a target strength.

use super::case_definition::CaseSetup;
use super::case_id::{CaseId, Hide, World};
use super::custom_effect::CustomEffect;
use super::draw_effect::{self, EffectContext};
use super::effect_strength::{RefitTerms, max_force_n, unexplained_rms_n};
use super::rich_world_effects::{self, RICH_EFFECTS};
use super::unmodelled_shapes::{UNMODELLED_SHAPES, UnmodelledShape};
use crate::simulator::effect::{Effect, IDS};
use crate::simulator::rich_world::RichEffects;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use std::sync::Arc;

/// Steps that scale an effect to its target strength.
const SCALING_STEPS: usize = 5;

/// Whether a tissue can have an effect: boundaries need two layers, puncture effects a layer that is punctured.
fn can_hold(effect: &Effect, setup: &CaseSetup) -> bool {
    let punctured = setup.truth.layers.iter().any(|l| l.puncture_n.is_some());
    match effect {
        Effect::BoundaryShift { .. } => setup.truth.layers.len() > 1,
        Effect::RateDependentPuncture { .. } => punctured,
        _ => true,
    }
}

/// Whether two effects can be distinguished when both are present: they differ, and belong to different families.
fn are_distinguishable(a: &Effect, b: &Effect) -> bool {
    const FAMILIES: [&[&str]; 4] = [
        &["coulomb_friction", "stribeck_friction", "presliding_friction"],
        &["boundary_shift", "position_scale"],
        &["low_pass_lag", "time_delay"],
        &["force_bias", "position_dependent_force"],
    ];
    a.id() != b.id() && !FAMILIES.iter().any(|f| f.contains(&a.id()) && f.contains(&b.id()))
}

/// Instrument faults.
const INSTRUMENT_FAULTS: [&str; 10] = [
    "force_gain",
    "force_bias",
    "force_drift",
    "zero_step",
    "position_dependent_force",
    "periodic_interference",
    "saturation",
    "quantisation",
    "time_delay",
    "low_pass_lag",
];

fn effect_index(id: &str) -> usize {
    IDS.iter().position(|x| *x == id).unwrap_or(0)
}

/// Hides the effects that the identifier requests; together they leave a residual of `target_n` in N.
pub fn hide_effects(rng: &mut ChaCha8Rng, id: &CaseId, setup: &mut CaseSetup, target_n: f64) {
    let largest = max_force_n(setup);
    let sd = setup.noise.sd_n;
    let truth = setup.truth.clone();
    let case = EffectContext {
        tissue: &truth,
        largest_n: largest,
        rate_hz: setup.amounts.rate_hz,
        coefficients: setup.amounts.coefficients,
        size: id.size,
    };
    if id.world == World::Rich {
        hide_rich_effects(rng, id, setup, target_n);
    }
    let count = match id.hide {
        Hide::One | Hide::Two | Hide::Three if id.world == World::Rich => 0,
        Hide::Clean | Hide::Outside | Hide::Custom => 0,
        Hide::One | Hide::Mixed | Hide::Instrument => 1,
        Hide::Two => 2,
        Hide::Three => 3,
    };
    let each = target_n / f64::from(count.max(1) as u32).sqrt();
    for k in 0..count {
        let effect = (0..200u64).find_map(|turn| {
            let which = match (id.hide, k) {
                // Every effect equally often; one that does not fit is replaced by the next.
                (Hide::Instrument, _) => {
                    let n = INSTRUMENT_FAULTS.len();
                    effect_index(INSTRUMENT_FAULTS[(item_index(id, n) + turn as usize) % n])
                }
                (Hide::Mixed, _) if id.world == World::Rich => {
                    let n = INSTRUMENT_FAULTS.len() - 1;
                    effect_index(INSTRUMENT_FAULTS[1 + (item_index(id, n) + turn as usize) % n])
                }
                (_, 0) => (item_index(id, IDS.len()) + turn as usize) % IDS.len(),
                _ => rng.random_range(0..IDS.len()),
            };
            let e = draw_effect::draw_effect(rng, which, &case);
            // Among several effects a force gain could not be identified.
            let lone = matches!(id.hide, Hide::One | Hide::Instrument);
            let seen = lone || !matches!(e, Effect::ForceGain { .. });
            (seen && can_hold(&e, setup) && setup.effects.iter().all(|o| are_distinguishable(o, &e)))
                .then_some(e)
        });
        let Some(effect) = effect else { continue };
        setup.effects.push(scaled_to_target(setup, effect, each, largest));
    }
    if id.hide == Hide::Outside || (id.hide == Hide::Mixed && id.world == World::Plain) {
        let mut u = [0.0; 6];
        u.iter_mut().for_each(|x| *x = rng.random());
        let kind = item_index(id, UNMODELLED_SHAPES.len());
        let mut shape = UnmodelledShape::new(kind, u, sd);
        for _ in 0..2 {
            let left = unexplained_rms_n(setup, &[], Some(&shape), RefitTerms::Common);
            shape = shape.scaled_to((shape.size_n * target_n / left.max(1e-6)).min(5.0));
        }
        setup.shape = Some(shape);
    }
    setup.strength_sd = match (&setup.shape, count) {
        (None, 0) if setup.rich == RichEffects::default() => 0.0,
        (Some(shape), 0) => unexplained_rms_n(setup, &[], Some(shape), RefitTerms::Common) / sd,
        _ => unexplained_rms_n(setup, &setup.effects, None, RefitTerms::Nothing) / sd,
    };
}

/// Hides one of the caller's effects, each equally often, with a residual of about `target_n` in N.
pub(super) fn hide_custom_effect(
    rng: &mut ChaCha8Rng,
    id: &CaseId,
    custom: &[Arc<dyn CustomEffect>],
    setup: &mut CaseSetup,
    target_n: f64,
) {
    if custom.is_empty() {
        return;
    }
    let mut effect = custom[item_index(id, custom.len())].with_random_parameters(&mut || rng.random());
    let mut left_n = 0.0;
    for _ in 0..=SCALING_STEPS {
        setup.custom = Some(Arc::clone(&effect));
        left_n = unexplained_rms_n(setup, &[], None, RefitTerms::Nothing);
        let factor = (target_n / left_n.max(1e-9)).clamp(0.05, 20.0);
        if (0.87..1.15).contains(&factor) {
            break;
        }
        effect = effect.scaled(factor);
    }
    setup.strength_sd = left_n / setup.noise.sd_n;
}

/// Draws the rich-law effects of a case and scales them to the target strength.
fn hide_rich_effects(rng: &mut ChaCha8Rng, id: &CaseId, setup: &mut CaseSetup, target_n: f64) {
    let count = match id.hide {
        Hide::One | Hide::Mixed => 1,
        Hide::Two => 2,
        Hide::Three => 3,
        Hide::Clean | Hide::Outside | Hide::Instrument | Hide::Custom => 0,
    };
    let truth = setup.truth.clone();
    let mut all = RichEffects::default();
    for k in 0..count {
        let turn = if k == 0 { 0 } else { rng.random_range(1..RICH_EFFECTS.len()) };
        let which = (item_index(id, RICH_EFFECTS.len()) + turn) % RICH_EFFECTS.len();
        let mut one = RichEffects::default();
        rich_world_effects::add_rich_effect(rng, which, &truth, id.size, &mut one);
        for _ in 0..SCALING_STEPS {
            setup.rich = one;
            let left = unexplained_rms_n(setup, &[], None, RefitTerms::Nothing);
            let factor = (target_n / f64::from(count).sqrt() / left.max(1e-9)).clamp(0.05, 20.0);
            match rich_world_effects::scaled(&one, factor) {
                Some(next) if !(0.87..1.15).contains(&factor) && next != one => one = next,
                _ => break,
            }
        }
        all = rich_world_effects::combine(&all, &one);
    }
    setup.rich = all;
}

/// Names of everything that a case can hide: the effects of the library and the shapes outside it.
#[must_use]
pub fn hidden_names() -> Vec<&'static str> {
    IDS.iter().chain(&UNMODELLED_SHAPES).copied().collect()
}

/// One of [`hidden_names`] by its name.
#[must_use]
pub fn hidden_name(name: &str) -> Option<&'static str> {
    hidden_names().into_iter().find(|t| *t == name)
}

/// The first effect or shape that the identifier requests; `None` for clean cases and for those with effects of the rich law. If the
/// stack cannot have the effect, the next of the list is hidden instead.
#[must_use]
pub fn intended_effect(id: &CaseId) -> Option<&'static str> {
    match id.hide {
        Hide::Clean | Hide::Custom => None,
        Hide::Outside => Some(UNMODELLED_SHAPES[item_index(id, UNMODELLED_SHAPES.len())]),
        Hide::Instrument => Some(INSTRUMENT_FAULTS[item_index(id, INSTRUMENT_FAULTS.len())]),
        _ if id.world == World::Rich => None,
        _ => Some(IDS[item_index(id, IDS.len())]),
    }
}

/// Index of the item, out of `n`, that the case hides. Within a misspecification row each item comes once in `n` cases, in an order
/// shuffled per round by the seed. Rows start at different positions of that order (a cyclic Latin square with shuffled rows), so that
/// a few cases of all rows cover every item about equally often. The severity does not enter: the same insertion is examined at
/// every severity.
fn item_index(id: &CaseId, n: usize) -> usize {
    let round = id.index / n as u64;
    let world = if id.world == World::Plain { 0 } else { 0x6a09_e667_f3bc_c909 };
    let order = shuffled(id.seed ^ world ^ round.wrapping_mul(0x9e37_79b9_7f4a_7c15), n);
    let starts = shuffled(id.seed ^ world ^ n as u64 ^ 0xbb67_ae85_84ca_a73b, n);
    let start = starts[id.wrong as usize % n];
    order[((id.index % n as u64) as usize + start) % n]
}

/// The numbers `0..n`, shuffled by the seed.
fn shuffled(seed: u64, n: usize) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut order: Vec<usize> = (0..n).collect();
    for k in (1..n).rev() {
        order.swap(k, rng.random_range(0..=k));
    }
    order
}

/// Scales an effect to the target strength, as closely as plausible parameters allow.
fn scaled_to_target(setup: &CaseSetup, effect: Effect, target_n: f64, largest_n: f64) -> Effect {
    let mut effect = effect;
    for _ in 0..SCALING_STEPS {
        let left = unexplained_rms_n(setup, &[effect], None, RefitTerms::Nothing);
        let factor = (target_n / left.max(1e-9)).clamp(0.05, 20.0);
        if (0.87..1.15).contains(&factor) {
            break;
        }
        match draw_effect::scaled(&effect, factor, largest_n) {
            Some(next) if next != effect => effect = next,
            _ => break,
        }
    }
    effect
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::case_id::{Severity, Size, Wrong};
    use crate::cases::case_setup::set_up_case;
    use stylet_stats::parallel::*;

    fn id(wrong: Wrong, hide: Hide, index: u64) -> CaseId {
        CaseId {
            world: World::Plain,
            wrong,
            severity: Severity::Large,
            hide,
            size: Size::Strong,
            seed: 77,
            index,
        }
    }

    /// How often each of `n` things is drawn in `cases` of every row.
    fn counts(n: usize, cases: u64) -> Vec<usize> {
        let mut of = vec![0; n];
        for wrong in Wrong::ALL {
            (0..cases).for_each(|k| of[item_index(&id(*wrong, Hide::One, k), n)] += 1);
        }
        of
    }

    #[test]
    fn in_every_row_each_thing_comes_once_a_round() {
        for n in [IDS.len(), UNMODELLED_SHAPES.len(), RICH_EFFECTS.len(), INSTRUMENT_FAULTS.len()] {
            for wrong in Wrong::ALL {
                for round in 0..2 {
                    let from = round * n as u64;
                    let mut drawn: Vec<usize> =
                        (from..from + n as u64).map(|k| item_index(&id(*wrong, Hide::One, k), n)).collect();
                    drawn.sort_unstable();
                    assert_eq!(drawn, (0..n).collect::<Vec<_>>(), "{wrong}, round {round}");
                }
            }
        }
    }

    #[test]
    fn the_same_number_of_another_row_hides_something_else() {
        // A few cases of every row hold every effect and every shape, each about as often.
        for n in [IDS.len(), UNMODELLED_SHAPES.len()] {
            for cases in [1, 2, 4, 7] {
                let of = counts(n, cases);
                let mean = (Wrong::ALL.len() as u64 * cases) as f64 / n as f64;
                assert!(of.iter().all(|c| (*c as f64 - mean).abs() <= cases as f64), "{n}, {cases}: {of:?}");
            }
            assert!(counts(n, 2).iter().all(|c| *c > 0));
        }
    }

    #[test]
    fn all_effects_and_all_outside_shapes_are_hidden_in_two_cases_of_every_row() {
        let first = |what: usize, n: usize| {
            let mut all = Wrong::ALL.iter().flat_map(|w| [(*w, 0), (*w, 1)]);
            all.find(|(wrong, k)| item_index(&id(*wrong, Hide::One, *k), n) == what)
        };
        (0..IDS.len() + UNMODELLED_SHAPES.len()).into_par_iter().for_each(|k| {
            let (hide, what, n) = match k.checked_sub(IDS.len()) {
                None => (Hide::One, k, IDS.len()),
                Some(shape) => (Hide::Outside, shape, UNMODELLED_SHAPES.len()),
            };
            let (wrong, index) = first(what, n).expect("one of the cases");
            let id = id(wrong, hide, index);
            let setup = set_up_case(&id, &[]);
            let hidden =
                setup.effects.first().map(Effect::id).or(setup.shape.as_ref().map(UnmodelledShape::name));
            let wanted = if hide == Hide::One { IDS[what] } else { UNMODELLED_SHAPES[what] };
            assert_eq!(hidden, Some(wanted), "{wrong} {index}");
            assert_eq!(intended_effect(&id), hidden, "{wrong} {index}");
        });
    }
}
