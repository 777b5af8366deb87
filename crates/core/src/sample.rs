//! What goes into the core and what comes out, one value each per sample.

/// One measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Time in seconds, increasing.
    pub time_s: f64,
    /// Tip position along the insertion axis in metres, positive into the tissue.
    pub position_m: f64,
    /// Tip velocity in m/s.
    pub velocity_mps: f64,
    /// Axial force at the needle's base in N, positive resisting insertion.
    pub force_n: f64,
}

impl Sample {
    /// True when every field is a number that a needle can have: positions within a kilometre,
    /// speeds below 1 km/s, forces below 1 MN. Anything else is a fault of the logging and would
    /// spoil the estimates for good.
    #[must_use]
    #[inline]
    pub fn is_usable(&self) -> bool {
        self.time_s.is_finite() && self.is_in_range()
    }

    /// Position, velocity and force alone.
    #[inline]
    pub(crate) fn is_in_range(&self) -> bool {
        self.position_m.abs() < 1e3 && self.velocity_mps.abs() < 1e3 && self.force_n.abs() < 1e6
    }
}

/// The states of the supplement's Fig. 1, and one of this project's own.
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
    /// Waiting for the drop to be over.
    ForceDropMeasuring,
    /// The traversed layer is re-estimated and its friction compensated.
    ForceCompensation,
    /// `Stylet` alone, not in the supplement: the tip is in a gap or behind the last layer and feels nothing.
    FreeTip,
}

impl State {
    /// Every state of the paper's algorithm, in the order of the supplement's Fig. 1.
    pub const ALL: [State; 5] = [
        State::NoRupture,
        State::ExpectedRupture,
        State::DetectedRupture,
        State::ForceDropMeasuring,
        State::ForceCompensation,
    ];

    /// The name, that of the supplement's Fig. 1 without blanks where it is there.
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

/// What made the core declare a rupture.
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
    /// Short name in plain words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Cause::Cusum => "CUSUM",
            Cause::DerivativeTrailingEdge => "derivative",
            Cause::KnownFace => "known face",
        }
    }
}

/// A declared rupture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Layer that ruptured, 1-based, as the core counts.
    pub layer: usize,
    /// Time of the declaration in seconds.
    pub time_s: f64,
    /// Tip position at the declaration in metres.
    pub position_m: f64,
    /// Time to which the drop was traced back, in seconds.
    pub located_s: f64,
    /// Tip position to which the drop was traced back, in metres.
    pub located_m: f64,
    /// What declared it.
    pub cause: Cause,
    /// Fall of the force at the declaration in N, and its standard deviation; zero when the algorithm does not tell.
    pub drop_n: f64,
    /// See `drop_n`.
    pub drop_sd_n: f64,
    /// Probability that it is no false alarm, 0 to 1; zero when the algorithm does not tell.
    pub confidence: f64,
}

/// What the core holds of a traversed layer after compensation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LayerEstimate {
    /// Layer, 1-based, as the core counts.
    pub layer: usize,
    /// Position where the layer started, in metres.
    pub start_m: f64,
    /// Thickness `d_i` in metres: travel from start to rupture, or the known thickness.
    pub thickness_m: f64,
    /// Stiffness `K_i` in N/m.
    pub stiffness_n_per_m: f64,
    /// Friction `b_i`: N s/m² for the multi-layer model, N s/m for Kelvin-Voigt.
    pub friction: f64,
    /// Measured force drop in N.
    pub drop_n: f64,
    /// Elastic share `kappa` of the force at the rupture, 0 to 1.
    pub elastic_share: f64,
    /// What the layer adds to the cumulative friction, in N s/m.
    pub added_friction_ns_per_m: f64,
    /// When the estimate became available, in seconds.
    pub time_s: f64,
    /// Standard deviation of the stiffness in N/m; zero when the algorithm does not tell.
    pub stiffness_sd: f64,
    /// Standard deviation of the friction in its unit; zero when the algorithm does not tell.
    pub friction_sd: f64,
    /// Standard deviation of the force drop in N; zero when the algorithm does not tell.
    pub drop_sd_n: f64,
    /// Cumulative friction `D` behind this layer in N s/m as it is known now; zero when the algorithm does not tell.
    pub cumulative_ns_per_m: f64,
    /// Its standard deviation in N s/m; zero when the algorithm does not tell.
    pub cumulative_sd: f64,
}

/// Result of one call.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    /// Enhanced force, `f - D v` (while retracting `f - v sum b_i l_i(z)`), in N.
    pub enhanced_n: f64,
    /// Force predicted before this sample's update, `phi'th + D v`, in N.
    pub reconstructed_n: f64,
    /// Innovation `e`, in N; zero before contact.
    pub error_n: f64,
    /// Present estimate `[K, b]` of the layer being traversed.
    pub theta: [f64; 2],
    /// CUSUM `g` in N².
    pub cusum_n2: f64,
    /// Filtered force derivative in N/s.
    pub derivative_n_per_s: f64,
    /// Cumulative friction `D` in N s/m.
    pub cumulative_friction_ns_per_m: f64,
    /// Where the tip's force lies with 95 % probability, in N: around `enhanced_n`, the sensor's noise and what is not known of the friction
    /// included. `None` when the algorithm does not tell.
    pub band_n: Option<[f64; 2]>,
    /// Standard deviations of `theta` and of the cumulative friction; zero when the algorithm does not tell.
    pub sd: [f64; 3],
    /// State after this sample.
    pub state: State,
    /// Number of ruptures declared so far.
    pub ruptures: usize,
    /// The first contact's position in metres, once it is settled.
    pub contact_m: Option<f64>,
    /// The rupture declared at this sample.
    pub detection: Option<Detection>,
    /// The layer whose estimate became available at this sample.
    pub estimate: Option<LayerEstimate>,
    /// False when the sample was not used (not usable, or not later than the one before): the
    /// other fields then repeat the previous output.
    pub used: bool,
}
