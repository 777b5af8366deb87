//! The first guess: what the raw force says before any fit.

use std::sync::Arc;
use stylet_identify::insertion_phases::{
    AbruptDrop, InsertionPhases, abrupt_drops, contact_m, detect_phases, noise_n, releases, rupture_samples,
};
use stylet_identify::model::{
    Assumptions, DayParameters, EffectTerm, FreeParameters, Model, NO_RUPTURE, TiedParameter,
};
use stylet_record::{QualityNote, Recording};
use stylet_stats::order_statistics::median_of;
use stylet_tissue::{AnyEffect, DelayedPuncture, Effect, ReleaseDepth, ShaftSlip, Tissue};

/// Speeds that differ by less than this share are one speed, measured on one day.
pub(super) const SPEED_TOLERANCE: f64 = 0.1;
/// Strokes that differ by less than this (m) are one stroke.
const SAME_STROKE_M: f64 = 1e-3;
/// Standard deviation of the surface about where the force first rises, in m.
const SURFACE_SD_M: f64 = 1.5e-3;
/// The same where a blunt tool comes to rest on soft tissue before it presses.
const PRESSED_SD_M: f64 = 2e-3;
/// Places of the exponent of the speed in `shaft_slip` and of the exponent in `delayed_puncture`.
pub(super) const SLIP_RATE_INDEX: usize = 6;
const WAITS: usize = 2;
/// Relative standard deviation of a thickness about what is believed or seen.
const THICKNESS_SD: f64 = 0.2;
/// Friction in the base law bears this share of the load before a rupture.
const PLAIN_FRICTION: f64 = 0.3;
/// Stiffness may be so many times what the first guess says, more or less.
const STIFFNESS_TIMES: f64 = 4.0;

/// Standard deviation of the surface between days that is expected before any data, in m: ten times what a stage repeats.
pub const EXPECTED_DAY_SURFACE_SD_M: f64 = 3e-4;
/// The same of the logarithm of friction: as much as between insertions of one day.
pub const EXPECTED_DAY_FRICTION_SD: f64 = 0.03;

/// One insertion of a set.
#[derive(Clone, Debug)]
pub struct SegmentedRecording {
    /// Its name.
    pub name: String,
    /// All samples.
    pub recording: Recording,
    /// Remarks on them.
    pub notes: Vec<QualityNote>,
    /// When it moves where.
    pub phases: InsertionPhases,
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

impl SegmentedRecording {
    /// Looks a recording over for `layers` layers.
    #[must_use]
    pub fn new(name: String, recording: Recording, layers: usize) -> Self {
        let at = detect_phases(&recording);
        let seen = rupture_samples(&abrupt_drops(&recording, &at), layers);
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
                .map(|i| i.filter(|i| *i > 0).map_or(NO_RUPTURE, |i| 0.5 * (time[i - 1] + time[i])))
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

impl SegmentedRecording {
    /// Sudden falls of the force until the way back begins.
    #[must_use]
    pub fn drops(&self) -> Vec<AbruptDrop> {
        abrupt_drops(&self.recording, &self.phases)
    }

    /// Standard deviation of the sensor's noise in N.
    #[must_use]
    pub fn noise_n(&self) -> f64 {
        noise_n(&self.recording.force_n)
    }
}

/// Groups of insertions with one speed and stroke, slowest first, as indices.
#[must_use]
pub fn group_by_speed_and_stroke(runs: &[&SegmentedRecording]) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..runs.len()).collect();
    order.sort_by(|a, b| runs[*a].speed_mps.total_cmp(&runs[*b].speed_mps));
    let mut out: Vec<Vec<usize>> = Vec::new();
    for i in order {
        let alike = |members: &Vec<usize>| {
            let first = runs[members[0]];
            runs[i].speed_mps < first.speed_mps * (1.0 + SPEED_TOLERANCE)
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

/// Whether all insertions have one speed.
#[must_use]
pub fn have_one_speed(runs: &[&SegmentedRecording]) -> bool {
    let slowest = runs.iter().map(|r| r.speed_mps).fold(f64::INFINITY, f64::min);
    runs.iter().all(|r| r.speed_mps < slowest * (1.0 + SPEED_TOLERANCE))
}

/// Where a fit begins, beyond what the data say: shares and exponents that several starts vary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartValues {
    /// Share of the load before the first rupture that a straight spring bears.
    pub linear_share: f64,
    /// Hold over that load.
    pub hold_ratio: f64,
    /// Pull over hold.
    pub pull_ratio: f64,
    /// Share of the hold that is left by the rupture.
    pub kept_share: f64,
    /// Exponent of the slip.
    pub exponent: f64,
    /// Loss of hold in 1/m, in the first layer and in deeper ones.
    pub wear_per_m: [f64; 2],
    /// Exponent of the speed in the hold.
    pub rate: f64,
    /// Relaxing shares.
    pub fractions: [f64; 2],
    /// Their time constants in s.
    pub time_constants_s: [f64; 2],
    /// Exponent of the punctures that wait.
    pub delay_exponent: f64,
    /// Surface beyond where the force first rises, in m.
    pub surface_m: f64,
    /// Layers beneath the first give way so far in m behind their front, and the first one without a drop where the force shows none; none:
    /// at the drops that the force shows, which may be what is left of a rupture after the layer above has given way.
    pub rupture_depth_m: Option<f64>,
}

/// What can be said before any fit: faces, and per layer the load before its rupture and the indentation under it.
struct Frame {
    tissue: Tissue,
    fronts_m: Vec<f64>,
    loads_n: Vec<f64>,
    indented_m: Vec<f64>,
}

/// Median over the insertions that show something.
fn of_all(runs: &[&SegmentedRecording], what: &dyn Fn(&SegmentedRecording) -> Option<f64>) -> Option<f64> {
    let all: Vec<f64> = runs.iter().filter_map(|r| what(r)).collect();
    (!all.is_empty()).then(|| median_of(all))
}

/// The frame of a believed tissue, its surface so far beyond where the force first rises.
fn frame(believed: &Tissue, runs: &[&SegmentedRecording], beyond_m: f64) -> Frame {
    let of = |what: &dyn Fn(&SegmentedRecording) -> Option<f64>| of_all(runs, what);
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
            (t < NO_RUPTURE).then(|| r.recording.position_m[k.min(r.recording.len() - 1)])
        });
        loads_n.push(load);
        indented_m.push((at.unwrap_or(deepest) - fronts_m[l]).max(2e-3));
    }
    Frame { tissue, fronts_m, loads_n, indented_m }
}

/// What is believed of an indentation that punctures nothing: one spring where the force says.
#[must_use]
pub fn indentation_prior(believed: &Tissue, run: &SegmentedRecording) -> Assumptions {
    let frame = frame(believed, &[run], 0.0);
    let mut tissue = frame.tissue;
    for (layer, (load, x)) in tissue.layers.iter_mut().zip(frame.loads_n.iter().zip(&frame.indented_m)) {
        layer.stiffness_n_per_m = (load / x).max(1.0);
        layer.friction_ns_per_m2 = 0.0;
        layer.puncture_n = None;
    }
    Assumptions { surface_tolerance_m: PRESSED_SD_M, ..wide(tissue) }
}

/// What is believed before the base law is fitted to a set: springs, friction and thresholds where the raw forces say, surely
/// known to a factor of a few.
#[must_use]
pub fn base_law_prior(believed: &Tissue, runs: &[&SegmentedRecording]) -> Assumptions {
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
fn wide(tissue: Tissue) -> Assumptions {
    let layers = tissue.layers.len();
    Assumptions {
        known_effects: Vec::new(),
        tolerance: vec![STIFFNESS_TIMES; layers],
        thickness_tolerance: (0..layers).map(|l| if l + 1 < layers { THICKNESS_SD } else { 0.0 }).collect(),
        surface_tolerance_m: SURFACE_SD_M,
        tissue,
    }
}

/// The instant (s) at which the force first reaches so much (N) on the way in.
fn reached_s(run: &SegmentedRecording, force_n: f64) -> f64 {
    let way = run.phases.start..=run.phases.deepest;
    let force = run.recording.force_n.get(way).unwrap_or(&[]);
    let at = force.iter().position(|f| *f >= force_n).map(|k| run.phases.start + k);
    at.and_then(|k| run.recording.time_s.get(k)).copied().unwrap_or(NO_RUPTURE)
}

/// A model of these insertions, with its instants where the force shows drops. The first layer may give way without one, when it holds the
/// shaft by as much as it bears: then where the force first reaches what is held.
#[must_use]
pub fn shaft_slip_start(believed: &Tissue, runs: &[&SegmentedRecording], guess: &StartValues) -> Model {
    let Frame { mut tissue, fronts_m: fronts, loads_n, indented_m } = frame(believed, runs, guess.surface_m);
    let days = group_by_speed_and_stroke(runs);
    let one_speed = have_one_speed(runs);
    let mut effects: Vec<AnyEffect> = Vec::new();
    let mut bound = Vec::new();
    for (l, layer) in tissue.layers.iter_mut().enumerate() {
        let (load, x) = (loads_n[l], indented_m[l]);
        layer.stiffness_n_per_m = (guess.linear_share * load / x).max(1.0);
        layer.friction_ns_per_m2 = 0.0;
        layer.puncture_n = None;
        let hold = guess.hold_ratio * load;
        let here = effects.len();
        if l == 0 && one_speed {
            // One speed tells nothing of what a rate does, nor of how long a puncture waits.
            bound.push(TiedParameter { effect: here, parameter: SLIP_RATE_INDEX, tied_to: None });
            bound.push(TiedParameter { effect: here + 1, parameter: WAITS, tied_to: None });
        }
        if l > 0 {
            // What the material of the shaft decides is common to the layers.
            bound.push(TiedParameter { effect: here + 1, parameter: 2, tied_to: Some(1) });
            bound.extend([3, 4, 6, 8, 9, 10, 11].map(|parameter| TiedParameter {
                effect: here,
                parameter,
                tied_to: Some(0),
            }));
        }
        effects.push(
            ShaftSlip {
                layer: l + 1,
                push_n: hold,
                pull_n: guess.pull_ratio * hold,
                retained_share: guess.kept_share,
                exponent: guess.exponent,
                wear_per_m: guess.wear_per_m[l.min(1)],
                rate: if one_speed { 0.0 } else { guess.rate },
                curvature_n_per_m2: (1.0 - guess.linear_share) * load / (x * x),
                fractions: guess.fractions,
                time_constants_s: guess.time_constants_s,
            }
            .into(),
        );
        effects.push(DelayedPuncture { layer: l + 1, force_n: load, exponent: guess.delay_exponent }.into());
        let depth_m = of_all(runs, &|r| r.releases_m[l]).map_or(0.0, |z| z - fronts[l]);
        effects.push(ReleaseDepth { layer: l + 1, depth_m }.into());
    }
    let layers = tissue.layers.len();
    let belief = wide(tissue);
    let mut model = Model::base(Arc::new(belief), runs.len());
    model.effects = effects.iter().map(|e| EffectTerm::new(e.info(), &e.parameters())).collect();
    model.tied = bound;
    model.free = FreeParameters {
        surface: true,
        thickness: true,
        wide_thickness: false,
        recording_surface: true,
        recording_friction: true,
        recording_effects: true,
        day_surface: days.len() > 1,
        day_friction: days.len() > 1,
    };
    model.fixed_scatter = true;
    model.scatter.surface_m = 2e-4;
    model.scatter.day_surface_m = EXPECTED_DAY_SURFACE_SD_M;
    model.scatter.day_ln_friction = EXPECTED_DAY_FRICTION_SD;
    model.scatter.rupture_force = 0.09;
    model.days = vec![DayParameters::default(); days.len()];
    model.day_of = (0..runs.len()).map(|r| days.iter().position(|g| g.contains(&r)).unwrap_or(0)).collect();
    model.rupture_times_s = runs.iter().map(|r| r.ruptures_s.clone()).collect();
    if let Some(behind_m) = guess.rupture_depth_m {
        for (instants, run) in model.rupture_times_s.iter_mut().zip(runs) {
            let (time, place) = (&run.recording.time_s, &run.recording.position_m);
            if let Some((first, load)) =
                instants.first_mut().zip(loads_n.first()).filter(|i| *i.0 == NO_RUPTURE)
            {
                *first = reached_s(run, guess.hold_ratio * load);
            }
            for l in 1..layers {
                let before = instants[l - 1];
                let passed = place.iter().position(|z| *z > fronts[l] + behind_m);
                instants[l] = passed
                    .map_or(NO_RUPTURE, |k| time[k].max(before + 2.0 * run.recording.median_interval_s()));
            }
        }
    }
    // Where a recording shows a release, its own one is known from the beginning.
    let differing: Vec<(usize, usize)> = model.varying_parameters().collect();
    for (k, (effect, parameter)) in differing.into_iter().enumerate() {
        let common = model.effects[effect].values[parameter];
        let range = model.effects[effect].info.parameters[parameter];
        for (r, run) in runs.iter().enumerate() {
            if let Some((z, front)) = run.releases_m.get(k).copied().flatten().zip(fronts.get(k)) {
                let depth_m = z - front;
                model.per_recording[r].varying[k] = depth_m.clamp(range.low, range.high) - common;
            }
        }
    }
    model
}

#[cfg(test)]
mod tests {
    use super::{
        SAME_STROKE_M, SLIP_RATE_INDEX, SPEED_TOLERANCE, SegmentedRecording, StartValues, base_law_prior,
        frame, group_by_speed_and_stroke, indentation_prior, shaft_slip_start,
    };
    use stylet_identify::model::{NO_RUPTURE, TiedParameter};
    use stylet_record::Recording;
    use stylet_tissue::{Layer, Tissue};

    /// In at a speed, a rest of 1 s, back to the beginning; two layers give way at 10 and 22 mm and let go at 18.5 and 7 mm.
    fn run(name: &str, speed_mps: f64, stroke_m: f64) -> SegmentedRecording {
        let travel = stroke_m / speed_mps;
        let (mut t, mut z, mut f) = (Vec::new(), Vec::new(), Vec::new());
        let mut k = 0;
        loop {
            let at = 0.01 * f64::from(k);
            let place = match at {
                x if x < travel => speed_mps * x,
                x if x < travel + 1.0 => stroke_m,
                x => stroke_m - speed_mps * (x - travel - 1.0),
            };
            if place < 0.0 {
                break;
            }
            let inward = at < travel + 1.0;
            // A spring that begins at 4 mm, falls to a third at 10 mm, and another one beyond 13 mm that falls at 22 mm.
            let load = match (inward, place) {
                (true, z) if z < 0.004 => 0.0,
                (true, z) if z < 0.010 => 500.0 * (z - 0.004),
                (true, z) if z < 0.022 => 1.0 + 200.0 * (z - 0.010),
                (true, z) => 1.2 + 50.0 * (z - 0.022),
                (false, z) if z > 0.0185 => -2.0,
                (false, z) if z > 0.007 => -1.0,
                (false, _) => 0.0,
            };
            t.push(at);
            z.push(place);
            f.push(load + 1e-3 * (f64::from((k * 37) % 11) / 11.0 - 0.5));
            k += 1;
        }
        SegmentedRecording::new(name.to_owned(), Recording::new(t, z, f).expect("clean columns"), 2)
    }

    /// Some starts have the first layer give way without a drop, where the force first reaches what it will hold.
    #[test]
    fn a_layer_whose_rupture_shows_no_drop_begins_to_give_way_where_the_force_reaches_what_is_held() {
        let mut silent = run("a", 0.002, 0.028);
        (silent.ruptures_s, silent.loads_n) = (vec![NO_RUPTURE; 2], vec![None; 2]);
        let (shown, none) = (run("b", 0.002, 0.028), StartValues { rupture_depth_m: None, ..guess() });
        let runs = [&silent, &shown];
        let m = shaft_slip_start(&believed(), &runs, &guess());
        let load = shown.loads_n[0].expect("a drop");
        let held = guess().hold_ratio * load;
        let at = m.rupture_times_s[0][0];
        let k = silent.recording.time_s.partition_point(|t| *t < at);
        let f = &silent.recording.force_n;
        assert!(f[k] >= held && f[..k].iter().all(|f| *f < held), "{at} {held}");
        // The layer beneath comes after it, and what is seen stays.
        assert!(
            m.rupture_times_s[0][1] > at && m.rupture_times_s[0][1] < NO_RUPTURE,
            "{:?}",
            m.rupture_times_s[0]
        );
        assert_eq!(m.rupture_times_s[1][0], shown.ruptures_s[0]);
        // Other starts go by what is seen alone, and what the force never reaches never was.
        assert_eq!(shaft_slip_start(&believed(), &runs, &none).rupture_times_s[0], vec![NO_RUPTURE; 2]);
        let weak = shaft_slip_start(&believed(), &runs, &StartValues { hold_ratio: 1e3, ..guess() });
        assert_eq!(weak.rupture_times_s[0], vec![NO_RUPTURE; 2]);
    }

    fn believed() -> Tissue {
        let layer = |d: f64| Layer {
            name: String::new(),
            thickness_m: d,
            stiffness_n_per_m: 300.0,
            friction_ns_per_m2: 100.0,
            puncture_n: Some(4.0),
        };
        Tissue { surface_m: 0.001, layers: vec![layer(0.009), layer(0.03)] }
    }

    #[test]
    fn an_insertion_is_read_off_its_force() {
        let r = run("a", 0.005, 0.026);
        assert!((r.speed_mps - 0.005).abs() < 2e-4, "{}", r.speed_mps);
        assert!((r.stroke_m - 0.026).abs() < 1e-9);
        assert!((r.contact_m - 0.004).abs() < 6e-4, "{}", r.contact_m);
        // The instant between the last sample before and the first behind the drop.
        assert!((r.ruptures_s[0] - 1.995).abs() < 0.011, "{:?}", r.ruptures_s);
        assert!((r.ruptures_s[1] - 4.395).abs() < 0.011, "{:?}", r.ruptures_s);
        assert!((r.ruptures_s[0] * 200.0).fract().abs() < 1e-6, "{}", r.ruptures_s[0]);
        // The load a little before: 500 N/m times 6 mm, four samples of 0.05 mm earlier.
        let loads: Vec<f64> = r.loads_n.iter().flatten().copied().collect();
        assert!((loads[0] - 2.9).abs() < 0.06 && (loads[1] - 3.36).abs() < 0.06, "{loads:?}");
        let releases: Vec<f64> = r.releases_m.iter().flatten().copied().collect();
        assert_eq!(releases.len(), 2);
        assert!((releases[0] - 0.007).abs() < 6e-4 && (releases[1] - 0.0185).abs() < 6e-4, "{releases:?}");
        // Of three layers nobody knows whose the second release is.
        let three = SegmentedRecording::new("b".to_owned(), r.recording.clone(), 3);
        assert!(three.releases_m[0].is_some() && three.releases_m[1..].iter().all(Option::is_none));
        assert_eq!(three.ruptures_s[..2], r.ruptures_s[..]);
        assert!(r.noise_n() < 2e-3 && r.noise_n() > 1e-5, "{}", r.noise_n());
        // Two ruptures, and where the force turns with the way.
        assert_eq!(r.drops().len(), 3);
    }

    #[test]
    fn insertions_of_one_speed_and_stroke_are_a_group_slowest_first() {
        let mut all: Vec<SegmentedRecording> = (0..6).map(|_| run("a", 0.005, 0.026)).collect();
        for (r, (speed, stroke)) in all.iter_mut().zip([
            (0.005, 0.0300),
            (0.001, 0.0200),
            (0.00549, 0.0309),
            (0.00551, 0.0300),
            (0.0010, 0.0209),
            (0.0010, 0.0211),
        ]) {
            (r.speed_mps, r.stroke_m) = (speed, stroke);
        }
        let refs: Vec<&SegmentedRecording> = all.iter().collect();
        // The stroke of the last differs by 1.1 mm from its group's first.
        assert_eq!(group_by_speed_and_stroke(&refs), vec![vec![1, 4], vec![5], vec![0, 2], vec![3]]);
    }

    /// From a tenth more speed or a millimetre more way on.
    #[test]
    fn what_differs_by_just_as_much_as_groups_may_is_a_group_of_its_own() {
        let one = run("a", 0.005, 0.026);
        let of = |speed_mps: f64, stroke_m: f64| SegmentedRecording { speed_mps, stroke_m, ..one.clone() };
        let (slow, fast) = (0.004, 0.004 * (1.0 + SPEED_TOLERANCE));
        let all = [of(slow, 0.0), of(fast, 0.0), of(slow, SAME_STROKE_M)];
        let refs: Vec<&SegmentedRecording> = all.iter().collect();
        assert_eq!(group_by_speed_and_stroke(&refs), vec![vec![0], vec![2], vec![1]]);
        // Two such speeds are not one: they tell what a rate does.
        let m = shaft_slip_start(&believed(), &refs[..2], &guess());
        assert_eq!((m.effects[0].values[SLIP_RATE_INDEX], m.days.len()), (guess().rate, 2));
    }

    #[test]
    fn a_frame_needs_neither_insertions_nor_depth_and_looks_no_further_than_a_recording() {
        // A centimetre beyond the believed surface where nobody went anywhere.
        let f = frame(&believed(), &[], 0.0);
        assert_eq!(f.fronts_m[0], 0.001);
        assert!((f.indented_m[0] - 0.01).abs() < 1e-12, "{:?}", f.indented_m);
        // Where an insertion ends within two millimetres of the surface, the next face lies no further behind it than that.
        let shallow = SegmentedRecording { stroke_m: 0.005, ..run("a", 0.005, 0.026) };
        let f = frame(&believed(), &[&shallow], 0.0);
        assert!((f.fronts_m[1] - f.fronts_m[0] - 2e-3).abs() < 1e-12, "{:?}", f.fronts_m);
        // A rupture lies where the needle was at its very instant, and one behind the last sample where that was.
        let mut r = run("a", 0.005, 0.026);
        let place = r.recording.position_m.clone();
        for (t, wanted) in [(r.recording.time_s[150], place[150]), (1e3, place[place.len() - 1])] {
            r.ruptures_s[0] = t;
            let f = frame(&believed(), &[&r], 0.0);
            assert!(
                (f.indented_m[0] - (wanted - f.fronts_m[0]).max(2e-3)).abs() < 1e-12,
                "{t}: {:?}",
                f.indented_m
            );
        }
    }

    #[test]
    fn faces_loads_and_indentations_are_what_the_runs_have_in_the_middle() {
        let all = [run("a", 0.005, 0.026), run("b", 0.005, 0.026), run("c", 0.004, 0.026)];
        let refs: Vec<&SegmentedRecording> = all.iter().collect();
        let f = frame(&believed(), &refs, 2e-4);
        let contact = stylet_stats::median_of(all.iter().map(|r| r.contact_m));
        assert_eq!(f.fronts_m[0], contact + 2e-4);
        assert_eq!(f.tissue.surface_m, f.fronts_m[0]);
        let lets_go = stylet_stats::median_of(all.iter().filter_map(|r| r.releases_m[1]));
        assert!((f.fronts_m[1] - (lets_go - 5e-4)).abs() < 1e-12);
        assert!((f.tissue.layers[0].thickness_m - (f.fronts_m[1] - f.fronts_m[0])).abs() < 1e-12);
        assert!((f.tissue.layers[1].thickness_m - 0.03).abs() < 1e-12);
        let load = |l: usize| stylet_stats::median_of(all.iter().filter_map(|r| r.loads_n[l]));
        // A deeper layer shares its force with friction of the one before.
        assert!((f.loads_n[0] - load(0)).abs() < 1e-12 && (f.loads_n[1] - 0.6 * load(1)).abs() < 1e-12);
        assert!((f.indented_m[0] - (0.010 - f.fronts_m[0])).abs() < 2e-4, "{:?}", f.indented_m);
        assert!((f.indented_m[1] - (0.022 - f.fronts_m[1])).abs() < 2e-4, "{:?}", f.indented_m);

        // Nothing lets go: the believed thickness tells the face; nothing gives way: the deepest point and the largest force.
        let mut blank = all.to_vec();
        for r in &mut blank {
            (r.releases_m, r.ruptures_s, r.loads_n) = (vec![None; 2], vec![NO_RUPTURE; 2], vec![None; 2]);
        }
        let refs: Vec<&SegmentedRecording> = blank.iter().collect();
        let f = frame(&believed(), &refs, 0.0);
        assert!((f.fronts_m[1] - (contact + 0.009)).abs() < 1e-12);
        let largest = blank.iter().flat_map(|r| &r.recording.force_n).fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!((f.loads_n[0] - largest).abs() < 1e-12 && (f.loads_n[1] - 0.6 * largest).abs() < 1e-12);
        assert!((f.indented_m[0] - (0.026 - contact)).abs() < 1e-9);
        // A face lies a millimetre behind the one before and a millimetre before the deepest point at least.
        let mut thin = believed();
        thin.layers[0].thickness_m = 2e-4;
        assert!((frame(&thin, &refs, 0.0).fronts_m[1] - (contact + 1e-3)).abs() < 1e-12);
        thin.layers[0].thickness_m = 0.08;
        let f = frame(&thin, &refs, 0.0);
        assert!(
            (f.fronts_m[1] - 0.025).abs() < 1e-9 && (f.indented_m[1] - 2e-3).abs() < 1e-9,
            "{:?}",
            f.fronts_m
        );
        // The last layer reaches 20 mm beyond the deepest point at least.
        thin.layers[1].thickness_m = 1e-3;
        let f = frame(&thin, &refs, 0.0);
        assert!((f.tissue.layers[1].thickness_m - 0.021).abs() < 1e-9, "{:?}", f.tissue);
        // A load of less than a twentieth of the largest force is none.
        blank[0].loads_n = vec![Some(0.01), None];
        let refs: Vec<&SegmentedRecording> = blank.iter().collect();
        assert!((frame(&believed(), &refs, 0.0).loads_n[0] - 0.05 * largest).abs() < 1e-12);
    }

    #[test]
    fn what_is_believed_before_a_fit_is_a_spring_friction_and_a_threshold_where_most_give_way() {
        let mut all =
            [run("a", 0.005, 0.026), run("b", 0.005, 0.026), run("c", 0.005, 0.026), run("d", 0.005, 0.026)];
        all[0].ruptures_s[1] = NO_RUPTURE;
        all[1].ruptures_s[1] = NO_RUPTURE;
        let refs: Vec<&SegmentedRecording> = all.iter().collect();
        let f = frame(&believed(), &refs, 0.0);
        let b = base_law_prior(&believed(), &refs);
        for l in 0..2 {
            let layer = &b.tissue.layers[l];
            assert!((layer.stiffness_n_per_m - f.loads_n[l] / f.indented_m[l]).abs() < 1e-9);
            let friction = 0.3 * f.loads_n[l] / (refs[0].speed_mps * f.indented_m[l]);
            assert!((layer.friction_ns_per_m2 / friction - 1.0).abs() < 1e-9);
            assert_eq!(layer.puncture_n, Some(f.loads_n[l]));
        }
        assert_eq!(
            (b.tolerance, b.thickness_tolerance, b.surface_tolerance_m),
            (vec![4.0; 2], vec![0.2, 0.0], 1.5e-3)
        );
        // Less than half of them: no threshold.
        all[2].ruptures_s[1] = NO_RUPTURE;
        let refs: Vec<&SegmentedRecording> = all.iter().collect();
        assert_eq!(base_law_prior(&believed(), &refs).tissue.layers[1].puncture_n, None);
        // Three of six are half of them.
        let six = [&refs[..], &[&all[3], &all[3]]].concat();
        assert!(base_law_prior(&believed(), &six).tissue.layers[1].puncture_n.is_some());
        let p = indentation_prior(&believed(), &all[3]);
        let f = frame(&believed(), &[&all[3]], 0.0);
        for l in 0..2 {
            let layer = &p.tissue.layers[l];
            assert!((layer.stiffness_n_per_m - f.loads_n[l] / f.indented_m[l]).abs() < 1e-9);
            assert_eq!((layer.friction_ns_per_m2, layer.puncture_n), (0.0, None));
        }
        assert_eq!(p.surface_tolerance_m, 2e-3);
    }

    fn guess() -> StartValues {
        StartValues {
            linear_share: 0.4,
            hold_ratio: 0.55,
            pull_ratio: 0.7,
            kept_share: 0.8,
            exponent: 9.0,
            wear_per_m: [11.0, 23.0],
            rate: -0.2,
            fractions: [0.1, 0.2],
            time_constants_s: [0.5, 7.0],
            delay_exponent: 13.0,
            surface_m: 3e-4,
            rupture_depth_m: Some(2e-3),
        }
    }

    #[test]
    fn a_start_has_a_slipping_shaft_a_waiting_puncture_and_a_release_in_every_layer() {
        let all = [run("a", 0.005, 0.026), run("b", 0.003, 0.026), run("c", 0.005, 0.026)];
        let refs: Vec<&SegmentedRecording> = all.iter().collect();
        let g = guess();
        let f = frame(&believed(), &refs, g.surface_m);
        let m = shaft_slip_start(&believed(), &refs, &g);
        assert_eq!(
            m.effects.iter().map(|e| e.info.id).collect::<Vec<_>>(),
            ["shaft_slip", "delayed_puncture", "release_depth"].repeat(2)
        );
        let of = |e: usize, path: &str| {
            let k = m.effects[e].info.parameters.iter().position(|p| p.path == path).expect("a parameter");
            m.effects[e].values[k]
        };
        for l in 0..2 {
            let (load, x) = (f.loads_n[l], f.indented_m[l]);
            let near =
                |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "layer {l}: {a} for {b}");
            near(m.tissue.layers[l].stiffness_n_per_m, 0.4 * load / x);
            near(of(3 * l, "push_n"), 0.55 * load);
            near(of(3 * l, "pull_n"), 0.7 * 0.55 * load);
            near(of(3 * l, "curvature_n_per_m2"), 0.6 * load / (x * x));
            near(of(3 * l, "wear_per_m"), [11.0, 23.0][l]);
            near(of(3 * l, "rate"), -0.2);
            near(of(3 * l + 1, "force_n"), load);
            near(of(3 * l + 1, "exponent"), 13.0);
            let z = stylet_stats::median_of(all.iter().filter_map(|r| r.releases_m[l]));
            near(of(3 * l + 2, "depth_m"), z - f.fronts_m[l]);
            assert_eq!(
                (of(3 * l, "layer"), of(3 * l + 1, "layer"), of(3 * l + 2, "layer")),
                (l as f64 + 1.0, l as f64 + 1.0, l as f64 + 1.0)
            );
        }
        // What the shaft's material decides is common to the layers; with two speeds nothing else is bound.
        let mut wanted = vec![TiedParameter { effect: 4, parameter: 2, tied_to: Some(1) }];
        wanted.extend([3, 4, 6, 8, 9, 10, 11].map(|parameter| TiedParameter {
            effect: 3,
            parameter,
            tied_to: Some(0),
        }));
        assert_eq!(m.tied, wanted);
        // Days are groups: the slow run was the first one.
        assert_eq!(
            (m.day_of.as_slice(), m.days.len(), m.free.day_surface, m.free.day_friction),
            (&[1, 0, 1][..], 2, true, true)
        );
        assert!(
            m.fixed_scatter
                && m.free.recording_surface
                && m.free.recording_friction
                && m.free.recording_effects
        );
        // The second layer gives way 2 mm behind its front, not where the force drops.
        for (r, run) in all.iter().enumerate() {
            assert_eq!(m.rupture_times_s[r][0], run.ruptures_s[0]);
            let k = run
                .recording
                .position_m
                .iter()
                .position(|z| *z > f.fronts_m[1] + 2e-3)
                .expect("it gets there");
            assert_eq!(m.rupture_times_s[r][1], run.recording.time_s[k]);
        }
        // Each release of its own is known.
        for (k, (e, p)) in m.varying_parameters().enumerate() {
            for (r, run) in all.iter().enumerate() {
                if let Some(z) = run.releases_m.get(k).copied().flatten() {
                    let range = m.effects[e].info.parameters[p];
                    let own =
                        (z - f.fronts_m[k.min(1)]).clamp(range.low, range.high) - m.effects[e].values[p];
                    assert!((m.per_recording[r].varying[k] - own).abs() < 1e-12, "{k} {r}");
                }
            }
        }
    }

    #[test]
    fn one_speed_tells_neither_a_rate_nor_how_long_a_puncture_waits() {
        let all = [run("a", 0.005, 0.026), run("b", 0.0052, 0.026)];
        let refs: Vec<&SegmentedRecording> = all.iter().collect();
        let m = shaft_slip_start(&believed(), &refs, &StartValues { rupture_depth_m: None, ..guess() });
        assert_eq!(
            m.tied[..2],
            [
                TiedParameter { effect: 0, parameter: 6, tied_to: None },
                TiedParameter { effect: 1, parameter: 2, tied_to: None }
            ]
        );
        assert_eq!(m.effects[0].values[6], 0.0);
        assert!(!m.free.day_surface && !m.free.day_friction && m.days.len() == 1);
        // Passed is what lies behind, not what stands at it.
        let front = frame(&believed(), &refs, 3e-4).fronts_m[1];
        let place = &all[0].recording.position_m;
        let exact = |z: &f64| *z > front + 1e-3 && front + (z - front) == *z;
        let k = place.iter().position(exact).expect("a sample whose depth is a sum");
        let at = shaft_slip_start(
            &believed(),
            &refs,
            &StartValues { rupture_depth_m: Some(place[k] - front), ..guess() },
        );
        assert_eq!(at.rupture_times_s[0][1], all[0].recording.time_s[k + 1]);
        // Without a guess layers give way where the force drops.
        assert_eq!(m.rupture_times_s, all.iter().map(|r| r.ruptures_s.clone()).collect::<Vec<_>>());
        // A layer that would give way before the one above waits for two samples behind it.
        let m =
            shaft_slip_start(&believed(), &refs, &StartValues { rupture_depth_m: Some(-8e-3), ..guess() });
        for (r, run) in all.iter().enumerate() {
            let wanted = run.ruptures_s[0] + 2.0 * run.recording.median_interval_s();
            assert!(m.rupture_times_s[r][1] >= wanted - 1e-12, "{:?}", m.rupture_times_s[r]);
        }
    }
}
