//! What is kept of one run: its score and what the claims ask beyond it.

use stylet_record::{Recording, Truth};
use stylet_score::{LayerTruth, Score, Trace};

/// One run of the algorithm on one recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The score of SPEC section 10.
    pub score: Score,
    /// Cumulative friction at the end over the true one at that instant; none where the true one is zero.
    pub cumulative_ratio: Option<f64>,
    /// RMS of the enhanced over RMS of the measured force after the tip has left the last layer and the
    /// algorithm has compensated it (from the exit on when it never does).
    pub after_exit: Option<f64>,
    /// RMS of enhanced force minus true elastic force over RMS of the latter, from contact to the last
    /// rupture.
    pub elastic_error: Option<f64>,
    /// RMS of the reconstruction error over RMS of the measured force, from contact to the end.
    pub reconstruction: Option<f64>,
    /// Friction in N s/m² of the first layer, offline, under the supplement's assumption that all force
    /// is friction: least squares of `f` on `dz v`.
    pub friction_only: Option<f64>,
}

fn ratio(over: f64, under: f64) -> Option<f64> {
    (under > 0.0).then(|| (over / under).sqrt())
}

impl Outcome {
    /// Collects what is asked.
    #[must_use]
    pub fn of(
        recording: &Recording,
        force_n: &[f64],
        truth: &Truth,
        layers: &[LayerTruth],
        trace: &Trace,
        score: Score,
    ) -> Self {
        let contact_s = truth.surface_contact_s.unwrap_or(f64::INFINITY);
        let exit_s = (truth.ruptures.len() == layers.len())
            .then(|| truth.ruptures.last().map(|r| r.time_s))
            .flatten()
            .unwrap_or(f64::INFINITY);
        let last_rupture_s = truth.ruptures.last().map_or(f64::INFINITY, |r| r.time_s);
        let from_s = trace.estimates.iter().map(|e| e.time_s).filter(|t| *t > exit_s).fold(exit_s, f64::max);
        let (mut enhanced2, mut after2) = (0.0, 0.0);
        let (mut missed2, mut elastic2) = (0.0, 0.0);
        let (mut error2, mut force2) = (0.0, 0.0);
        for (i, &time_s) in recording.time_s.iter().enumerate() {
            let (f, enhanced) = (force_n[i], trace.enhanced_n[i]);
            if time_s < contact_s || !f.is_finite() {
                continue;
            }
            error2 += trace.error_n[i] * trace.error_n[i];
            force2 += f * f;
            if time_s > from_s {
                enhanced2 += enhanced * enhanced;
                after2 += f * f;
            }
            if time_s < last_rupture_s {
                let elastic = truth.elastic_n[i];
                missed2 += (enhanced - elastic) * (enhanced - elastic);
                elastic2 += elastic * elastic;
            }
        }
        let cumulative = truth.cumulative_friction_ns_per_m.last().copied().unwrap_or(0.0);
        let found = trace.cumulative_friction_ns_per_m.last().copied().unwrap_or(0.0);
        Self {
            cumulative_ratio: (cumulative > 0.0).then(|| found / cumulative),
            after_exit: ratio(enhanced2, after2),
            elastic_error: ratio(missed2, elastic2),
            reconstruction: ratio(error2, force2),
            friction_only: friction_only(recording, force_n, truth, layers),
            score,
        }
    }

    /// Whether exactly the true ruptures were found.
    #[must_use]
    pub fn found_all(&self) -> bool {
        self.score.missed == 0 && self.score.false_alarms == 0
    }

    /// Friction of a layer in N s/m² as the online algorithm found it.
    #[must_use]
    pub fn online_friction(&self, layer: usize) -> Option<f64> {
        self.score.layers.get(layer).and_then(|l| l.friction_ns_per_m2.estimated)
    }
}

fn friction_only(
    recording: &Recording,
    force_n: &[f64],
    truth: &Truth,
    layers: &[LayerTruth],
) -> Option<f64> {
    let (layer, rupture) = (layers.first()?, truth.ruptures.first()?);
    let (mut over, mut under) = (0.0, 0.0);
    for (s, f) in recording.samples().zip(force_n) {
        let depth_m = s.position_m - layer.front_m;
        if depth_m > 0.0 && s.time_s < rupture.time_s && f.is_finite() {
            let phi = depth_m * s.velocity_mps;
            over += phi * f;
            under += phi * phi;
        }
    }
    (under > 0.0).then(|| over / under)
}
