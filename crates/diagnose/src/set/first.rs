//! The first guess: what the raw force says before any fit.

use std::sync::Arc;
use stylet_identify::model::{Belief, Bound, Choice, Day, Free, Model, NEVER};
use stylet_identify::phases::{Drop, Phases, contact_m, drops, noise_n, phases, releases, ruptures};
use stylet_record::{QualityNote, Recording};
use stylet_stats::order::median_of;
use stylet_tissue::{AnyEffect, DelayedPuncture, Effect, LetGo, ShaftSlip, Tissue};

/// Speeds that differ by less than this share are one speed, measured on one day.
const SAME_SPEED: f64 = 0.1;
/// Strokes that differ by less than this (m) are one stroke.
const SAME_STROKE_M: f64 = 1e-3;
/// Standard deviation of the surface about where the force first rises, in m.
const SURFACE_SD_M: f64 = 1.5e-3;
/// The same where a blunt tool comes to rest on soft tissue before it presses.
const PRESSED_SD_M: f64 = 2e-3;
/// Places of the exponent of the speed in `shaft_slip` and of the exponent in `delayed_puncture`.
const RATE: usize = 6;
const WAITS: usize = 2;
/// Relative standard deviation of a thickness about what is believed or seen.
const THICKNESS_SD: f64 = 0.2;
/// Friction in the base law bears this share of the load before a rupture.
const PLAIN_FRICTION: f64 = 0.3;
/// Stiffness may be so many times what the first guess says, more or less.
const STIFFNESS_TIMES: f64 = 4.0;

/// Standard deviation of the surface between days that is expected before any data, in m: ten times what a stage repeats.
pub const DAY_SURFACE_M: f64 = 3e-4;
/// The same of the logarithm of friction: as much as between insertions of one day.
pub const DAY_FRICTION: f64 = 0.03;

/// One insertion of a set.
#[derive(Clone, Debug)]
pub struct Insertion {
    /// Its name.
    pub name: String,
    /// All samples.
    pub recording: Recording,
    /// Remarks on them.
    pub notes: Vec<QualityNote>,
    /// When it moves where.
    pub phases: Phases,
    /// Median speed of the advance in m/s.
    pub speed_mps: f64,
    /// How far it went in m.
    pub stroke_m: f64,
    /// Where the force leaves zero, in m.
    pub contact_m: f64,
    /// Per layer the instant (s) of its rupture, [`NEVER`] where the force shows none.
    pub ruptures_s: Vec<f64>,
    /// Per layer the force in N just before its rupture.
    pub loads_n: Vec<Option<f64>>,
    /// Per layer where it lets go on the way back, in m, where the force shows it.
    pub releases_m: Vec<Option<f64>>,
    /// Largest force (N) that the sensor can show, where it was reached: nothing beyond can be compared.
    pub limit_n: Option<f64>,
}

impl Insertion {
    /// Looks a recording over for `layers` layers.
    #[must_use]
    pub fn new(name: String, recording: Recording, layers: usize) -> Self {
        let at = phases(&recording);
        let seen = ruptures(&drops(&recording, &at), layers);
        let found = releases(&recording, &at, layers);
        // With fewer releases than layers nobody knows whose they are, but for the last one: the first layer's.
        let releases_m = (0..layers)
            .map(|l| if found.len() == layers || l == 0 { found.get(l).map(|r| r.position_m) } else { None })
            .collect();
        let advance = recording.velocity_mps.get(at.start..=at.deepest).unwrap_or(&[]);
        let (time, force) = (&recording.time_s, &recording.force_n);
        Self {
            speed_mps: median_of(advance.iter().copied().filter(|v| *v > 0.0)),
            stroke_m: recording.position_m.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            contact_m: contact_m(&recording, &at),
            ruptures_s: seen
                .iter()
                .map(|i| i.filter(|i| *i > 0).map_or(NEVER, |i| 0.5 * (time[i - 1] + time[i])))
                .collect(),
            loads_n: seen.iter().map(|i| i.map(|i| force[i.saturating_sub(4)])).collect(),
            releases_m,
            phases: at,
            limit_n: None,
            notes: Vec::new(),
            name,
            recording,
        }
    }
}

impl Insertion {
    /// Sudden falls of the force until the way back begins.
    #[must_use]
    pub fn drops(&self) -> Vec<Drop> {
        drops(&self.recording, &self.phases)
    }

    /// Standard deviation of the sensor's noise in N.
    #[must_use]
    pub fn noise_n(&self) -> f64 {
        noise_n(&self.recording.force_n)
    }
}

/// Groups of insertions with one speed and stroke, slowest first, as indices.
#[must_use]
pub fn groups(runs: &[&Insertion]) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by(|a, b| runs[*a].speed_mps.total_cmp(&runs[*b].speed_mps));
    let mut out: Vec<Vec<usize>> = Vec::new();
    for i in order {
        let alike = |members: &Vec<usize>| {
            let first = runs[members[0]];
            runs[i].speed_mps < first.speed_mps * (1.0 + SAME_SPEED)
                && (runs[i].stroke_m - first.stroke_m).abs() < SAME_STROKE_M
        };
        match out.iter_mut().rev().find(|g| alike(g)) {
            Some(group) => group.push(i),
            None => out.push(vec![i]),
        }
    }
    out.iter_mut().for_each(|g| g.sort_unstable());
    out
}

/// Where a fit begins, beyond what the data say: shares and exponents that several starts vary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guess {
    /// Share of the load before the first rupture that a straight spring bears.
    pub straight: f64,
    /// Hold over that load.
    pub hold: f64,
    /// Pull over hold.
    pub pull: f64,
    /// Share of the hold that is left by the rupture.
    pub kept: f64,
    /// Exponent of the slip.
    pub exponent: f64,
    /// Loss of hold in 1/m, in the first layer and in deeper ones.
    pub wear_per_m: [f64; 2],
    /// Exponent of the speed in the hold.
    pub rate: f64,
    /// Relaxing shares.
    pub fractions: [f64; 2],
    /// Their time constants in s.
    pub times_s: [f64; 2],
    /// Exponent of the punctures that wait.
    pub waits: f64,
    /// Surface beyond where the force first rises, in m.
    pub surface_m: f64,
    /// Layers beneath the first give way so far in m behind their front; none: at the drops that the force shows, which may be what is left of
    /// a rupture after the layer above has given way.
    pub gives_way_m: Option<f64>,
}

/// What can be said before any fit: faces, and per layer the load before its rupture and the indentation under it.
struct Frame {
    tissue: Tissue,
    fronts_m: Vec<f64>,
    loads_n: Vec<f64>,
    indented_m: Vec<f64>,
}

/// Median over the insertions that show something.
fn of_all(runs: &[&Insertion], what: &dyn Fn(&Insertion) -> Option<f64>) -> Option<f64> {
    let all: Vec<f64> = runs.iter().filter_map(|r| what(r)).collect();
    (!all.is_empty()).then(|| median_of(all))
}

/// The frame of a believed tissue, its surface so far beyond where the force first rises.
fn frame(believed: &Tissue, runs: &[&Insertion], beyond_m: f64) -> Frame {
    let of = |what: &dyn Fn(&Insertion) -> Option<f64>| of_all(runs, what);
    let contact = of(&|r| Some(r.contact_m)).unwrap_or(believed.surface_m);
    let deepest = of(&|r| Some(r.stroke_m)).unwrap_or(contact + 0.01);
    let largest = runs.iter().flat_map(|r| &r.recording.force_n).fold(1e-3_f64, |most, f| most.max(f.abs()));
    let layers = believed.layers.len();
    let surface_m = contact + beyond_m;
    let mut fronts_m = vec![surface_m];
    for l in 1..layers {
        let told = believed.front_m(l) - believed.surface_m + contact;
        let front = of(&|r| r.releases_m[l]).map_or(told, |z| z - 5e-4);
        let low = fronts_m[l - 1] + 1e-3;
        fronts_m.push(front.clamp(low, (deepest - 1e-3).max(low + 1e-3)));
    }
    let mut tissue = believed.clone();
    tissue.surface_m = surface_m;
    let (mut loads_n, mut indented_m) = (Vec::new(), Vec::new());
    for (l, layer) in tissue.layers.iter_mut().enumerate() {
        if l + 1 < layers {
            layer.thickness_m = fronts_m[l + 1] - fronts_m[l];
        } else {
            layer.thickness_m = layer.thickness_m.max(deepest - fronts_m[l] + 0.02);
        }
        // Deeper layers share the force with friction of those before them.
        let share = if l == 0 { 1.0 } else { 0.6 };
        let seen = of(&|r| r.loads_n[l]);
        let load = share * seen.unwrap_or(largest).max(0.05 * largest);
        let at = of(&|r| {
            let t = r.ruptures_s[l];
            let k = r.recording.time_s.partition_point(|x| *x < t);
            (t < NEVER).then(|| r.recording.position_m[k.min(r.recording.len() - 1)])
        });
        loads_n.push(load);
        indented_m.push((at.unwrap_or(deepest) - fronts_m[l]).max(2e-3));
    }
    Frame { tissue, fronts_m, loads_n, indented_m }
}

/// What is believed of an indentation that punctures nothing: one spring where the force says.
#[must_use]
pub fn pressed(believed: &Tissue, run: &Insertion) -> Belief {
    let frame = frame(believed, &[run], 0.0);
    let mut tissue = frame.tissue;
    for (layer, (load, x)) in tissue.layers.iter_mut().zip(frame.loads_n.iter().zip(&frame.indented_m)) {
        layer.stiffness_n_per_m = (load / x).max(1.0);
        layer.friction_ns_per_m2 = 0.0;
        layer.puncture_n = None;
    }
    Belief { surface_tolerance_m: PRESSED_SD_M, ..wide(tissue) }
}

/// What is believed before the base law is fitted to a set: springs, friction and thresholds where the raw forces say, surely
/// known to a factor of a few.
#[must_use]
pub fn plain(believed: &Tissue, runs: &[&Insertion]) -> Belief {
    let frame = frame(believed, runs, 0.0);
    let speed = of_all(runs, &|r| Some(r.speed_mps)).unwrap_or(1e-3).max(1e-5);
    let mut tissue = frame.tissue;
    for (l, layer) in tissue.layers.iter_mut().enumerate() {
        let (load, x) = (frame.loads_n[l], frame.indented_m[l]);
        let seen = runs.iter().filter(|r| r.ruptures_s[l].is_finite()).count();
        layer.stiffness_n_per_m = (load / x).max(1.0);
        layer.friction_ns_per_m2 = PLAIN_FRICTION * load / (speed * x);
        layer.puncture_n = (2 * seen >= runs.len()).then_some(load);
    }
    wide(tissue)
}

/// A belief in this tissue that leaves it all freedom but the scale.
fn wide(tissue: Tissue) -> Belief {
    let layers = tissue.layers.len();
    Belief {
        given: Vec::new(),
        tolerance: vec![STIFFNESS_TIMES; layers],
        thickness_tolerance: (0..layers).map(|l| if l + 1 < layers { THICKNESS_SD } else { 0.0 }).collect(),
        surface_tolerance_m: SURFACE_SD_M,
        tissue,
    }
}

/// A model of these insertions, with its instants where the force shows drops.
#[must_use]
pub fn first(believed: &Tissue, runs: &[&Insertion], guess: &Guess) -> Model {
    let Frame { mut tissue, fronts_m: fronts, loads_n, indented_m } = frame(believed, runs, guess.surface_m);
    let days = groups(runs);
    let slowest = days.first().map_or(0.0, |g| runs[g[0]].speed_mps);
    let one_speed = days.iter().flatten().all(|r| runs[*r].speed_mps < slowest * (1.0 + SAME_SPEED));
    let mut effects: Vec<AnyEffect> = Vec::new();
    let mut bound = Vec::new();
    for (l, layer) in tissue.layers.iter_mut().enumerate() {
        let (load, x) = (loads_n[l], indented_m[l]);
        layer.stiffness_n_per_m = (guess.straight * load / x).max(1.0);
        layer.friction_ns_per_m2 = 0.0;
        layer.puncture_n = None;
        let hold = guess.hold * load;
        let here = effects.len();
        if l == 0 && one_speed {
            // One speed tells nothing of what a rate does, nor of how long a puncture waits.
            bound.push(Bound { effect: here, parameter: RATE, like: None });
            bound.push(Bound { effect: here + 1, parameter: WAITS, like: None });
        }
        if l > 0 {
            // What the material of the shaft decides is common to the layers.
            bound.push(Bound { effect: here + 1, parameter: 2, like: Some(1) });
            bound.extend([3, 4, 6, 8, 9, 10, 11].map(|parameter| Bound {
                effect: here,
                parameter,
                like: Some(0),
            }));
        }
        effects.push(
            ShaftSlip {
                layer: l + 1,
                push_n: hold,
                pull_n: guess.pull * hold,
                kept: guess.kept,
                exponent: guess.exponent,
                wear_per_m: guess.wear_per_m[l.min(1)],
                rate: if one_speed { 0.0 } else { guess.rate },
                curve_n_per_m2: (1.0 - guess.straight) * load / (x * x),
                fractions: guess.fractions,
                time_constants_s: guess.times_s,
            }
            .into(),
        );
        effects.push(DelayedPuncture { layer: l + 1, force_n: load, exponent: guess.waits }.into());
        let depth_m = of_all(runs, &|r| r.releases_m[l]).map_or(0.0, |z| z - fronts[l]);
        effects.push(LetGo { layer: l + 1, depth_m }.into());
    }
    let layers = tissue.layers.len();
    let belief = wide(tissue);
    let mut model = Model::base(Arc::new(belief), runs.len());
    model.effects = effects.iter().map(|e| Choice::new(e.info(), &e.parameters())).collect();
    model.bound = bound;
    model.free = Free {
        surface: true,
        thickness: true,
        own_surface: true,
        own_friction: true,
        own_effects: true,
        day_surface: days.len() > 1,
        day_friction: days.len() > 1,
    };
    model.steady = true;
    model.scatter.surface_m = 2e-4;
    model.scatter.day_surface_m = DAY_SURFACE_M;
    model.scatter.day_friction = DAY_FRICTION;
    model.scatter.force = 0.09;
    model.days = vec![Day::default(); days.len()];
    model.day_of = (0..runs.len()).map(|r| days.iter().position(|g| g.contains(&r)).unwrap_or(0)).collect();
    model.instants = runs.iter().map(|r| r.ruptures_s.clone()).collect();
    if let Some(behind_m) = guess.gives_way_m {
        for (instants, run) in model.instants.iter_mut().zip(runs) {
            let (time, place) = (&run.recording.time_s, &run.recording.position_m);
            for l in 1..layers {
                let before = instants[l - 1];
                let passed = place.iter().position(|z| *z > fronts[l] + behind_m);
                instants[l] =
                    passed.map_or(NEVER, |k| time[k].max(before + 2.0 * run.recording.median_interval_s()));
            }
        }
    }
    // Where a recording shows a release, its own one is known from the beginning.
    let differing: Vec<(usize, usize)> = model.differing().collect();
    for (k, (effect, parameter)) in differing.into_iter().enumerate() {
        let common = model.effects[effect].values[parameter];
        let range = model.effects[effect].info.parameters[parameter];
        for (r, run) in runs.iter().enumerate() {
            if let Some(z) = run.releases_m.get(k).copied().flatten() {
                let depth_m = z - fronts[k.min(layers - 1)];
                model.own[r].differing[k] = depth_m.clamp(range.low, range.high) - common;
            }
        }
    }
    model
}
