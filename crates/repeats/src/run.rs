//! One measured insertion among its repeats.

use crate::events::{self, Phases};
use stylet_record::{QualityNote, Recording};

/// Interval (s) between the samples that a fit looks at.
const FIT_INTERVAL_S: f64 = 0.08;

/// One measured insertion.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its name.
    pub name: String,
    /// All samples, as recorded.
    pub recording: Recording,
    /// Remarks on them.
    pub notes: Vec<QualityNote>,
    /// When it moves where.
    pub phases: Phases,
    /// Median speed of the advance in m/s.
    pub speed_mps: f64,
    /// Where the force leaves zero (m).
    pub contact_m: f64,
    /// Per layer the first sample after its rupture, where the force shows one.
    pub ruptures: Vec<Option<usize>>,
    /// Per layer where it lets go of the tip on the way back (m), where the force shows it.
    pub releases_m: Vec<Option<f64>>,
    /// The samples that fits look at.
    pub thin: Columns,
    /// The same with the first layer's rupture alone.
    pub thin_first: Columns,
}

/// Plain columns, with the ruptures seen in them.
#[derive(Clone, Debug, Default)]
pub struct Columns {
    /// Time in s.
    pub t: Vec<f64>,
    /// Position in m.
    pub z: Vec<f64>,
    /// Velocity in m/s.
    pub v: Vec<f64>,
    /// Force in N.
    pub f: Vec<f64>,
    /// Per layer the first sample after its rupture.
    pub ruptures: Vec<Option<usize>>,
}

impl Run {
    /// Looks a recording over for `layers` layers.
    #[must_use]
    pub fn new(name: String, recording: Recording, notes: Vec<QualityNote>, layers: usize) -> Self {
        let phases = events::phases(&recording);
        let ruptures = events::ruptures(&events::drops(&recording, &phases), layers);
        let found = events::releases(&recording, &phases, layers);
        // With fewer releases than layers nobody knows whose they are, but for the last one: the first layer's.
        let releases_m = (0..layers)
            .map(|i| if found.len() == layers || i == 0 { found.get(i).map(|r| r.position_m) } else { None })
            .collect();
        let mut speeds: Vec<f64> = recording.velocity_mps[phases.start..=phases.deepest]
            .iter()
            .copied()
            .filter(|v| *v > 0.0)
            .collect();
        let speed_mps = crate::stats::median(&mut speeds);
        let contact_m = events::contact_m(&recording, &phases);
        let thin = thinned(&recording, &ruptures);
        let mut thin_first = thin.clone();
        thin_first.ruptures.iter_mut().skip(1).for_each(|r| *r = None);
        Self { name, recording, notes, phases, speed_mps, contact_m, ruptures, releases_m, thin, thin_first }
    }

    /// What fits of a law look at: ruptures where it takes them from the data.
    #[must_use]
    pub fn seen_by(&self, shape: &crate::shape::Shape) -> &Columns {
        if shape.imposes(1) { &self.thin } else { &self.thin_first }
    }

    /// Time of the first motion in s.
    #[must_use]
    pub fn start_s(&self) -> f64 {
        self.recording.time_s[self.phases.start]
    }

    /// All samples as columns.
    #[must_use]
    pub fn columns(&self) -> Columns {
        Columns {
            t: self.recording.time_s.clone(),
            z: self.recording.position_m.clone(),
            v: self.recording.velocity_mps.clone(),
            f: self.recording.force_n.clone(),
            ruptures: self.ruptures.clone(),
        }
    }
}

/// Every so many of the samples, as they are, and those on both sides of a rupture.
fn thinned(recording: &Recording, ruptures: &[Option<usize>]) -> Columns {
    let mut out = Columns { ruptures: vec![None; ruptures.len()], ..Columns::default() };
    let mut last = f64::NEG_INFINITY;
    for i in 0..recording.len() {
        let beside = ruptures.iter().flatten().any(|at| i + 1 == *at || i == *at);
        if !beside && recording.time_s[i] - last < FIT_INTERVAL_S {
            continue;
        }
        last = recording.time_s[i];
        for (place, at) in out.ruptures.iter_mut().zip(ruptures) {
            if *at == Some(i) {
                *place = Some(out.t.len());
            }
        }
        out.t.push(recording.time_s[i]);
        out.z.push(recording.position_m[i]);
        out.v.push(recording.velocity_mps[i]);
        out.f.push(recording.force_n[i]);
    }
    out
}
