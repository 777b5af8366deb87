//! Input and output of the core, one value per sample.

/// Largest number of traversed layers stored separately for retraction. The friction of further layers is still compensated
/// during insertion, but merged into the last one.
pub const MAX_LAYERS: usize = 16;

/// One measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Time in s, increasing.
    pub time_s: f64,
    /// Tip position along the insertion axis in m, positive into the tissue.
    pub position_m: f64,
    /// Tip velocity in m/s.
    pub velocity_mps: f64,
    /// Axial force at the needle base in N, positive resisting insertion.
    pub force_n: f64,
}

impl Sample {
    /// True if every field is finite and physically possible: positions within 1 km, speeds below 1 km/s, forces below 1 MN.
    /// Other values are logging errors, which would corrupt the estimates permanently.
    #[must_use]
    #[inline]
    pub fn is_usable(&self) -> bool {
        self.time_s.is_finite() && self.is_in_range()
    }

    /// As [`Sample::is_usable`], without the time.
    #[inline]
    pub(crate) fn is_in_range(&self) -> bool {
        self.position_m.abs() < 1e3 && self.velocity_mps.abs() < 1e3 && self.force_n.abs() < 1e6
    }
}

/// Why a sample was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum UnusedReason {
    /// A value is NaN or infinite.
    NotFinite,
    /// Position, velocity or force is physically impossible for a needle.
    OutOfRange,
    /// The time is not later than that of the last used sample.
    NotLater,
    /// The time jumped; further samples decide whether it is an outlier, a pause or a new clock.
    TimeJump,
}

impl UnusedReason {
    /// One sentence without a full stop.
    #[must_use]
    pub fn message(self) -> &'static str {
        match self {
            UnusedReason::NotFinite => "a value is not finite",
            UnusedReason::OutOfRange => "position, velocity or force is out of range",
            UnusedReason::NotLater => "the time is not later than that of the last used sample",
            UnusedReason::TimeJump => "the time jumped: an outlier, or the first samples of a new clock",
        }
    }

    /// Reason why a sample fails [`Sample::is_usable`].
    #[cold]
    pub(crate) fn of_values(sample: &Sample) -> Self {
        let finite = [sample.time_s, sample.position_m, sample.velocity_mps, sample.force_n];
        if finite.iter().all(|x| x.is_finite()) { UnusedReason::OutOfRange } else { UnusedReason::NotFinite }
    }
}

/// The states of the supplement's Fig. 1, and one of `Stylet`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum State {
    /// Ordinary insertion.
    #[default]
    NoRupture,
    /// The force derivative has exceeded its threshold.
    ExpectedRupture,
    /// A rupture has just been declared; lasts one sample.
    DetectedRupture,
    /// Waiting for the end of the drop.
    ForceDropMeasuring,
    /// The traversed layer is re-estimated and its friction compensated.
    ForceCompensation,
    /// `Stylet` only: the tip is in a gap or beyond the last layer, and no tissue acts on it.
    FreeTip,
}

impl State {
    /// The states of the paper's algorithm, in the order of the supplement's Fig. 1.
    pub const ALL: [State; 5] = [
        State::NoRupture,
        State::ExpectedRupture,
        State::DetectedRupture,
        State::ForceDropMeasuring,
        State::ForceCompensation,
    ];

    /// The name in the supplement's Fig. 1, without blanks.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            State::NoRupture => "NoRupture",
            State::ExpectedRupture => "ExpectedRupture",
            State::DetectedRupture => "DetectedRupture",
            State::ForceDropMeasuring => "ForceDropMeasuring",
            State::ForceCompensation => "ForceCompensation",
            State::FreeTip => "FreeTip",
        }
    }
}

/// Test that declared a rupture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Cause {
    /// The CUSUM alarm.
    Cusum,
    /// The trailing edge of the force derivative.
    DerivativeTrailingEdge,
    /// The tip passed the known far face.
    KnownFace,
}

impl Cause {
    /// Short name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Cause::Cusum => "CUSUM",
            Cause::DerivativeTrailingEdge => "derivative",
            Cause::KnownFace => "known face",
        }
    }
}

/// A declared rupture. Values that the algorithm does not provide are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Ruptured layer, counted from 1 in the order of detection.
    pub layer: usize,
    /// Time of the declaration in s.
    pub time_s: f64,
    /// Tip position at the declaration in m.
    pub position_m: f64,
    /// Estimated time of the rupture in s.
    pub located_s: f64,
    /// Estimated tip position at the rupture in m.
    pub located_m: f64,
    /// Test that declared it.
    pub cause: Cause,
    /// Fall of the force at the declaration in N (`Stylet`).
    pub drop_n: f64,
    /// Standard deviation of `drop_n` in N (`Stylet`).
    pub drop_sd_n: f64,
    /// Probability that the rupture is not a false alarm, 0 to 1 (`Stylet`).
    pub confidence: f64,
}

/// The fall of the force at a rupture until 0.1 s after its declaration. Not reported if the recording ends before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompletedDrop {
    /// Ruptured layer, as in its [`Detection`].
    pub layer: usize,
    /// Fall of the force in N.
    pub drop_n: f64,
    /// Standard deviation of `drop_n` in N.
    pub drop_sd_n: f64,
}

/// Estimate of a traversed layer. Standard deviations are zero where the algorithm does not provide them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LayerEstimate {
    /// Layer, counted from 1 in the order of detection.
    pub layer: usize,
    /// Start of the layer in m.
    pub start_m: f64,
    /// Thickness `d_i` in m: travel from start to rupture, or the known thickness.
    pub thickness_m: f64,
    /// Stiffness `K_i` in N/m.
    pub stiffness_n_per_m: f64,
    /// Friction `b_i`: N s/m² for the multi-layer model, N s/m for Kelvin-Voigt.
    pub friction: f64,
    /// Force drop in N.
    pub drop_n: f64,
    /// Elastic share `kappa` of the force at the rupture, 0 to 1.
    pub elastic_share: f64,
    /// Friction that the layer adds to the cumulative friction, in N s/m.
    pub added_friction_ns_per_m: f64,
    /// Time of the estimate in s.
    pub time_s: f64,
    /// Standard deviation of the stiffness in N/m.
    pub stiffness_sd: f64,
    /// Standard deviation of the friction in its unit.
    pub friction_sd: f64,
    /// Standard deviation of the force drop in N.
    pub drop_sd_n: f64,
    /// Cumulative friction `D` at the layer's rupture in N s/m (`Stylet`).
    pub cumulative_ns_per_m: f64,
    /// Standard deviation of `cumulative_ns_per_m` in N s/m.
    pub cumulative_sd: f64,
}

/// Form of the sensor baseline in air, apart from noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum BaselineKind {
    /// A constant offset.
    #[default]
    Constant,
    /// Drift in time.
    Drift,
    /// Linear in position: a cable, a guide, the weight of a tilted tool.
    Line,
    /// Drift or line: the motion in air does not separate them.
    DriftOrLine,
}

impl BaselineKind {
    /// Short name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            BaselineKind::Constant => "constant offset",
            BaselineKind::Drift => "drift in time",
            BaselineKind::Line => "line in position",
            BaselineKind::DriftOrLine => "drift in time or line in position",
        }
    }
}

/// Baseline of the force as estimated by `Stylet`: `f = offset + drift (t - t_now) + line (z - z_now)`. Standard deviations are
/// zero where no estimate exists.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Baseline {
    /// Form of the baseline.
    pub kind: BaselineKind,
    /// Force without contact at this sample in N.
    pub offset_n: f64,
    /// Drift in N/s.
    pub drift_n_per_s: f64,
    /// Change with position in N/m.
    pub line_n_per_m: f64,
    /// Standard deviations of offset, drift and line.
    pub sd: [f64; 3],
    /// Steps of the zero so far.
    pub zero_steps: usize,
}

/// A step of the sensor's zero (a tare, a slipping amplifier): a jump between two samples that is not a rupture.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ZeroStep {
    /// Time of the step in s.
    pub time_s: f64,
    /// Tip position at the step in m.
    pub position_m: f64,
    /// Size in N, positive upwards.
    pub size_n: f64,
    /// Standard deviation of the size in N.
    pub sd_n: f64,
    /// Whether the needle was in tissue.
    pub in_tissue: bool,
    /// Number of an earlier declared rupture that was this step; the rupture and its layer are withdrawn.
    pub withdrawn: Option<usize>,
}

/// Result of one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    /// Enhanced force, `f - D v` (during retraction `f - v sum b_i l_i(z)`), in N.
    pub enhanced_n: f64,
    /// Force predicted before this sample's update, `phi'th + D v`, in N.
    pub reconstructed_n: f64,
    /// Innovation `e` in N; zero before contact.
    pub error_n: f64,
    /// Estimate `[K, b]` of the active layer.
    pub theta: [f64; 2],
    /// CUSUM `g` in N²; for `Stylet` the largest sum as a fraction of its threshold.
    pub cusum_n2: f64,
    /// Filtered force derivative in N/s.
    pub derivative_n_per_s: f64,
    /// Cumulative friction `D` in N s/m.
    pub cumulative_friction_ns_per_m: f64,
    /// 95 % interval of the tip force in N, around `enhanced_n`: sensor noise and uncertain friction. `None` where the
    /// algorithm does not provide it.
    pub band_n: Option<[f64; 2]>,
    /// Standard deviations of `theta` and of the cumulative friction; zero where the algorithm does not provide them.
    pub sd: [f64; 3],
    /// State after this sample.
    pub state: State,
    /// Number of ruptures declared so far.
    pub ruptures: usize,
    /// Position of the first contact in m: the onset of the load, revised at the first rupture.
    pub contact_m: Option<f64>,
    /// Standard deviation of `contact_m` in m; zero where the algorithm does not provide it (`Stylet`).
    pub contact_sd_m: f64,
    /// Probability that the load is a contact, not a moving baseline or a step of the zero, 0 to 1 (`Stylet`).
    pub contact_probability: f64,
    /// Baseline of the force (`Stylet`).
    pub baseline: Baseline,
    /// Step of the zero reported at this sample (`Stylet`).
    pub zero_step: Option<ZeroStep>,
    /// Rupture declared at this sample.
    pub detection: Option<Detection>,
    /// Fall of the force at the last rupture, which ended at this sample (`Stylet`).
    pub completed_drop: Option<CompletedDrop>,
    /// Layer estimate that became available at this sample.
    pub estimate: Option<LayerEstimate>,
    /// False when the sample was ignored; the other fields then repeat the previous output and are not current.
    pub used: bool,
    /// Why it was ignored; `None` when it was used.
    pub unused_reason: Option<UnusedReason>,
    /// The algorithm was re-initialised before this sample, because its time belongs to a new clock: ruptures, contact and
    /// estimates begin again.
    pub restarted: bool,
}

impl Output {
    /// The output for an ignored sample: the values of the previous one, without its events.
    pub(crate) fn ignore(&mut self, why: UnusedReason) {
        self.detection = None;
        self.completed_drop = None;
        self.estimate = None;
        self.zero_step = None;
        self.restarted = false;
        self.used = false;
        self.unused_reason = Some(why);
    }
}
