//! A case: what is believed, what is true, and what was measured.

use super::amounts::Amounts;
use super::draw;
use super::hidden::{self, For};
use super::id::{CaseId, Hide, Size, World};
use super::ingredients::{self, INGREDIENTS};
use super::outside::{SHAPES, Shape};
use super::paths::{self, between, log_between};
use super::strength::{Beside, largest_n, left_n, look};
use crate::reality::effect::{Effect, IDS};
use crate::reality::insertion::{Insertion, Strange, insert};
use crate::reality::law::Law;
use crate::reality::motion::Path;
use crate::reality::noise::{Noise, NoiseSource};
use crate::reality::plain::Plain;
use crate::reality::rich::{Ingredients, Rich};
use crate::reality::sensor::Instrument;
use crate::reality::tissue::Tissue;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use stylet_record::Recording;

/// Steps of the simulation are at most this long in s: 5 kHz.
const STEP_S: f64 = 2e-4;
/// ... and at least two to a sample.
const STEPS_PER_SAMPLE: f64 = 2.0;
/// A case that misses the strength aimed at is drawn anew so many times.
const ATTEMPTS: u64 = 6;
/// The least distance in m from a rupture at which a membrane breaks: nearer ones are one event to anybody.
const MEMBRANE_APART_M: f64 = 2e-3;

/// Everything about a case but the noise.
#[derive(Clone, Debug)]
pub struct Setup {
    /// How much is wrong.
    pub amounts: Amounts,
    /// The stack as it is believed.
    pub believed: Tissue,
    /// The stack as it is.
    pub truth: Tissue,
    /// The motions.
    pub paths: Vec<Path>,
    /// The noise.
    pub noise: Noise,
    /// The law that the tissue follows.
    pub world: World,
    /// Ingredients of the rich law.
    pub rich: Ingredients,
    /// What of the library is hidden.
    pub effects: Vec<Effect>,
    /// What else is.
    pub shape: Option<Shape>,
    /// Strength of all that is hidden, in noise standard deviations.
    pub strength_sd: f64,
}

impl Setup {
    /// The law of a tissue in this world. The rich law knows no effects of the library but those of tool and sensor.
    #[must_use]
    pub fn law(&self, tissue: &Tissue, effects: &[Effect]) -> Box<dyn Law> {
        match self.world {
            World::Plain => Box::new(Plain::new(tissue, effects)),
            World::Rich => Box::new(Rich::new(tissue, &self.rich)),
        }
    }
}

/// One recording under its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// Such as a file's name.
    pub name: String,
    /// The columns.
    pub recording: Recording,
}

/// What an engine is given.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// The case's name; it says nothing about the truth that the recordings do not.
    pub name: String,
    /// The believed scenario (RON, SPEC section 8).
    pub believed_ron: String,
    /// What was measured.
    pub recordings: Vec<Named>,
}

/// A case with its truth.
#[derive(Clone, Debug)]
pub struct Case {
    /// Which.
    pub id: CaseId,
    /// What is hidden, and how it was measured.
    pub setup: Setup,
    /// What an engine is given.
    pub question: Question,
    /// What each recording met, without noise.
    pub there: Vec<Insertion>,
}

/// Draws everything but the noise.
#[must_use]
pub fn set_up(id: &CaseId) -> Setup {
    let (low, high) = range_sd(id.size);
    let mut kept: Option<(f64, Setup)> = None;
    for attempt in 0..ATTEMPTS {
        let setup = attempt_at(id, attempt);
        let drawn_with_number = setup.rich.foundation.is_some() || setup.rich.damage.is_some();
        let free = id.hide == Hide::Clean || drawn_with_number || setup.effects.iter().any(hidden::by_size);
        let off = if !clear_of_ruptures(&setup) || !told_by_ruptures(&setup, id.size) {
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
    kept.map_or_else(|| attempt_at(id, 0), |k| k.1)
}

/// The strengths that a size stands for, in noise standard deviations.
#[must_use]
pub fn range_sd(size: Size) -> (f64, f64) {
    match size {
        Size::Faint => (0.15, 0.5),
        Size::Medium => (0.5, 5.0),
        Size::Strong => (5.0, 15.0),
    }
}

fn attempt_at(id: &CaseId, attempt: u64) -> Setup {
    let mut rng = ChaCha8Rng::seed_from_u64(id.own_seed());
    rng.set_stream(1 + attempt);
    let amounts = Amounts::of(id.wrong, id.grade);
    // The number of layers must not shift the draws behind it.
    let mut stack_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let believed = draw::believed(&mut stack_rng, amounts.stack);
    let truth = draw::true_tissue(&mut ChaCha8Rng::seed_from_u64(rng.random()), &believed, &amounts);
    let mut path_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let noise = noise(&mut ChaCha8Rng::seed_from_u64(rng.random()), &amounts);
    let mut rng = ChaCha8Rng::seed_from_u64(rng.random());
    // The robot goes a little beyond where the stack is believed to end.
    let (start_m, depth_m) = (-amounts.air_m, 1.03 * believed.end_m() + 3e-3);
    let hurry = if amounts.rate_hz > 2000.0 { 2.0 } else { 1.0 };
    let paths = if id.hide == Hide::Instrument {
        paths::repeats(&mut path_rng, start_m, depth_m)
    } else {
        paths::drawn(&mut path_rng, amounts.recordings, start_m, depth_m, hurry)
    };
    let mut setup = Setup {
        amounts,
        believed,
        truth,
        paths,
        noise,
        world: id.world,
        rich: Ingredients::default(),
        effects: Vec::new(),
        shape: None,
        strength_sd: 0.0,
    };
    let (low, high) = range_sd(id.size);
    // A little inside, so that the last step of the search need not be exact.
    let target = log_between(&mut rng, 1.1 * low, 0.9 * high) * setup.noise.sd_n;
    hide(&mut rng, id, &mut setup, target);
    setup
}

fn noise(rng: &mut ChaCha8Rng, amounts: &Amounts) -> Noise {
    let sd_n = between(rng, 0.015, 0.025);
    let rho = [0.0, 0.5, 0.9][rng.random_range(0..3)];
    let middle = if rng.random::<bool>() { 50.0 } else { 60.0 };
    Noise {
        sd_n,
        ar: amounts.ar.unwrap_or([rho, 0.0]),
        tails: amounts.tails,
        growing: amounts.growing,
        wander_n: amounts.wander * sd_n,
        hum: (amounts.hum > 0.0).then_some((amounts.hum * sd_n, middle)),
        spikes: None,
    }
}

/// Effects that a tissue of one layer cannot have, or that cannot be told apart from one another when together.
fn fits(effect: &Effect, setup: &Setup) -> bool {
    let punctured = setup.truth.layers.iter().any(|l| l.puncture_n.is_some());
    match effect {
        Effect::BoundaryShift { .. } => setup.truth.layers.len() > 1,
        Effect::RateDependentPuncture { .. } => punctured,
        _ => true,
    }
}

/// Pairs of which one contains the other, or that are one and the same for the base law.
fn apart(a: &Effect, b: &Effect) -> bool {
    const FAMILIES: [&[&str]; 3] = [
        &["coulomb_friction", "stribeck_friction", "presliding_friction"],
        &["boundary_shift", "position_scale"],
        &["low_pass_lag", "time_delay"],
    ];
    a.id() != b.id() && !FAMILIES.iter().any(|f| f.contains(&a.id()) && f.contains(&b.id()))
}

/// Instrument faults, as issue and data sheets name them.
const INSTRUMENT: [&str; 8] = [
    "force_gain",
    "force_bias",
    "force_drift",
    "periodic_interference",
    "saturation",
    "quantisation",
    "time_delay",
    "low_pass_lag",
];

fn number_of(id: &str) -> usize {
    IDS.iter().position(|x| *x == id).unwrap_or(0)
}

fn hide(rng: &mut ChaCha8Rng, id: &CaseId, setup: &mut Setup, target_n: f64) {
    let largest = largest_n(setup);
    let sd = setup.noise.sd_n;
    let truth = setup.truth.clone();
    let case = For {
        tissue: &truth,
        largest_n: largest,
        rate_hz: setup.amounts.rate_hz,
        coefficients: setup.amounts.coefficients,
        size: id.size,
    };
    if id.world == World::Rich {
        enrich(rng, id, setup, target_n);
    }
    let count = match id.hide {
        Hide::One | Hide::Two | Hide::Three if id.world == World::Rich => 0,
        Hide::Clean | Hide::Outside => 0,
        Hide::One | Hide::Beside | Hide::Instrument => 1,
        Hide::Two => 2,
        Hide::Three => 3,
    };
    let each = target_n / f64::from(count.max(1) as u32).sqrt();
    for k in 0..count {
        let effect = (0..200u64).find_map(|turn| {
            let which = match (id.hide, k) {
                // Every effect equally often; where one does not fit, the next.
                (Hide::One, _) => (shuffled(id.seed, id.index, IDS.len()) + turn as usize) % IDS.len(),
                (Hide::Instrument, _) => number_of(INSTRUMENT[(id.index + turn) as usize % INSTRUMENT.len()]),
                (Hide::Beside, _) if id.world == World::Rich => {
                    number_of(INSTRUMENT[1 + (id.index + turn) as usize % (INSTRUMENT.len() - 1)])
                }
                (Hide::Beside, _) => (id.index as usize * 7 + turn as usize) % IDS.len(),
                (_, 0) => (shuffled(id.seed, id.index, IDS.len()) + turn as usize) % IDS.len(),
                _ => rng.random_range(0..IDS.len()),
            };
            let e = hidden::draw(rng, which, &case);
            // Where several are asked for, none is one that nobody can see.
            let lone = matches!(id.hide, Hide::One | Hide::Instrument);
            let seen = lone || !matches!(e, Effect::ForceGain { .. });
            (seen && fits(&e, setup) && setup.effects.iter().all(|o| apart(o, &e))).then_some(e)
        });
        let Some(effect) = effect else { continue };
        setup.effects.push(strengthened(setup, effect, each, largest));
    }
    if id.hide == Hide::Outside || (id.hide == Hide::Beside && id.world == World::Plain) {
        let mut u = [0.0; 6];
        u.iter_mut().for_each(|x| *x = rng.random());
        let kind = id.index as usize % SHAPES.len();
        let mut shape = Shape::new(kind, u, sd);
        for _ in 0..2 {
            let left = left_n(setup, &[], Some(&shape), Beside::Common);
            shape = shape.sized((shape.size_n * target_n / left.max(1e-6)).min(5.0));
        }
        setup.shape = Some(shape);
    }
    setup.strength_sd = match (&setup.shape, count) {
        (None, 0) if setup.rich == Ingredients::default() => 0.0,
        (Some(shape), 0) => left_n(setup, &[], Some(shape), Beside::Common) / sd,
        _ => left_n(setup, &setup.effects, None, Beside::Nothing) / sd,
    };
}

/// How many ingredients of the rich law a case has, and they.
fn enrich(rng: &mut ChaCha8Rng, id: &CaseId, setup: &mut Setup, target_n: f64) {
    let count = match id.hide {
        Hide::One | Hide::Beside => 1,
        Hide::Two => 2,
        Hide::Three => 3,
        Hide::Clean | Hide::Outside | Hide::Instrument => 0,
    };
    let truth = setup.truth.clone();
    let mut all = Ingredients::default();
    for k in 0..count {
        let turn = if k == 0 { 0 } else { rng.random_range(1..INGREDIENTS.len()) };
        let which = (shuffled(id.seed, id.index, INGREDIENTS.len()) + turn) % INGREDIENTS.len();
        let mut one = Ingredients::default();
        ingredients::add(rng, which, &truth, id.size, &mut one);
        for _ in 0..5 {
            setup.rich = one;
            let left = left_n(setup, &[], None, Beside::Nothing);
            let factor = (target_n / f64::from(count).sqrt() / left.max(1e-9)).clamp(0.05, 20.0);
            match ingredients::scaled(&one, factor) {
                Some(next) if !(0.87..1.15).contains(&factor) && next != one => one = next,
                _ => break,
            }
        }
        all = ingredients::together(&all, &one);
    }
    setup.rich = all;
}

/// A permutation of `0..n` that changes with every round: the `index`-th entry.
fn shuffled(seed: u64, index: u64, n: usize) -> usize {
    let round = index / n as u64;
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ round.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let mut order: Vec<usize> = (0..n).collect();
    for k in (1..n).rev() {
        order.swap(k, rng.random_range(0..=k));
    }
    order[(index % n as u64) as usize]
}

/// The effect at the strength aimed at, as nearly as plausible numbers allow.
fn strengthened(setup: &Setup, effect: Effect, target_n: f64, largest_n: f64) -> Effect {
    let mut effect = effect;
    for _ in 0..5 {
        let left = left_n(setup, &[effect], None, Beside::Nothing);
        let factor = (target_n / left.max(1e-9)).clamp(0.05, 20.0);
        if (0.87..1.15).contains(&factor) {
            break;
        }
        match hidden::scaled(&effect, factor, largest_n) {
            Some(next) if next != effect => effect = next,
            _ => break,
        }
    }
    effect
}

/// Whether a membrane breaks clear of every rupture of a layer.
fn clear_of_ruptures(setup: &Setup) -> bool {
    setup.effects.iter().all(|e| match *e {
        Effect::HiddenMembrane { depth_m, stiffness_n_per_m, puncture_n } => {
            let breaks_m = setup.truth.surface_m + depth_m + puncture_n / stiffness_n_per_m;
            breaks_m < setup.truth.end_m()
                && look(setup, &setup.effects, None).iter().all(|(there, _)| {
                    there.ruptures_s.iter().all(|r| {
                        let k = there.time_s.partition_point(|t| t < r).min(there.position_m.len() - 1);
                        (there.position_m[k] - breaks_m).abs() > MEMBRANE_APART_M
                    })
                })
        }
        _ => true,
    })
}

/// Whether a puncture force that depends on speed does so where it can be seen: at least one layer gives way by force in two
/// recordings at forces that differ by as much as the size asks for.
fn told_by_ruptures(setup: &Setup, size: Size) -> bool {
    let depends = setup.effects.iter().any(|e| matches!(e, Effect::RateDependentPuncture { .. }));
    if !depends || setup.paths.len() < 2 {
        return true;
    }
    let least = match size {
        Size::Faint => 0.005,
        Size::Medium => 0.015,
        Size::Strong => 0.05,
    };
    let all = look(setup, &setup.effects, None);
    (0..setup.truth.layers.len()).any(|i| {
        let layer = &setup.truth.layers[i];
        let front = setup.truth.front_m(i);
        let mut forces = Vec::new();
        for (there, _) in &all {
            let Some(r) = there.ruptures_s.get(i) else { continue };
            let k = there.time_s.partition_point(|t| t < r).min(there.position_m.len() - 1);
            let x = there.position_m[k] - front;
            if x < 0.97 * layer.thickness_m {
                forces.push(x * layer.stiffness_n_per_m);
            }
        }
        let high = forces.iter().fold(0.0, |m: f64, f| m.max(*f));
        let low = forces.iter().fold(f64::INFINITY, |m: f64, f| m.min(*f));
        forces.len() >= 2 && high - low >= least * high
    })
}

/// Draws a case.
///
/// # Errors
/// When the columns make no recording, which is a mistake of the referee.
pub fn case(id: &CaseId) -> Result<Case, stylet_record::RecordError> {
    let setup = set_up(id);
    let mut rng = ChaCha8Rng::seed_from_u64(id.own_seed());
    rng.set_stream(0);
    let (mut recordings, mut there) = (Vec::new(), Vec::new());
    for (k, path) in setup.paths.iter().enumerate() {
        let mut own = ChaCha8Rng::seed_from_u64(rng.random());
        let (recording, insertion) = measured(&setup, path, &mut own)?;
        recordings.push(Named { name: format!("{}.csv", k + 1), recording });
        there.push(insertion);
    }
    let name = format!("case {:016x}", id.own_seed());
    let believed_ron = draw::scenario_ron(&name, &setup.believed, setup.amounts.rate_hz);
    Ok(Case { id: *id, question: Question { name, believed_ron, recordings }, setup, there })
}

/// Instants at which samples are taken in s.
fn instants(path: &Path, amounts: &Amounts, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let n = (path.duration_s() * amounts.rate_hz) as usize;
    let mut out = Vec::with_capacity(n);
    let mut missing = 0;
    for k in 0..n {
        let off = if k == 0 { 0.0 } else { amounts.jitter * (rng.random::<f64>() - 0.5) * 2.0 };
        let lost = rng.random::<f64>();
        let run = rng.random_range(1..=3);
        if missing == 0 && k > 0 && lost < amounts.dropped / 2.0 {
            missing = run;
        }
        if missing > 0 {
            missing -= 1;
            continue;
        }
        out.push((k as f64 + off) / amounts.rate_hz);
    }
    out
}

fn measured(
    setup: &Setup,
    path: &Path,
    rng: &mut ChaCha8Rng,
) -> Result<(Recording, Insertion), stylet_record::RecordError> {
    let amounts = &setup.amounts;
    let interval_s = 1.0 / amounts.rate_hz;
    let mut met_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut time_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut noise_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let mut encoder_rng = ChaCha8Rng::seed_from_u64(rng.random());
    let tissue = draw::met(&mut met_rng, &setup.truth, amounts);
    let mut instrument = Instrument::new(&setup.effects, amounts.late_samples * interval_s);
    if let Some(range) = amounts.bits_range_n {
        instrument = instrument.rounding(2.0 * range / 4096.0);
    }
    let at = instants(path, amounts, &mut time_rng);
    let mut law = setup.law(&tissue, &setup.effects);
    let mut strange = setup.shape.clone();
    let strange = strange.as_mut().map(|s| s as &mut dyn Strange);
    let step_s = STEP_S.min(interval_s / STEPS_PER_SAMPLE);
    let there = insert(law.as_mut(), &instrument, strange, path, &at, step_s);
    let mut noise = setup.noise.clone();
    noise.spikes = setup.effects.iter().find_map(|e| match *e {
        Effect::ForceSpikes { rate_hz, size_n } => Some((rate_hz, size_n)),
        _ => None,
    });
    let mut source = NoiseSource::new(&noise, &mut noise_rng);
    let force: Vec<f64> = there
        .time_s
        .iter()
        .zip(&there.force_n)
        .map(|(&t, &f)| {
            let e = source.next(t, f, interval_s);
            instrument.reading_n(t, f, e)
        })
        .collect();
    let position: Vec<f64> = there
        .position_m
        .iter()
        .map(|&z| {
            let e: f64 = rand_distr::Distribution::sample(&rand_distr::StandardNormal, &mut encoder_rng);
            let z = instrument.position_m(z) + amounts.encoder_m * e;
            let q = amounts.encoder_step_m;
            if q > 0.0 { libm::round(z / q) * q } else { z }
        })
        .collect();
    Ok((Recording::new(there.time_s.clone(), position, force)?, there))
}

impl Case {
    /// Samples of all recordings.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.question.recordings.iter().map(|r| r.recording.len()).sum()
    }
}
