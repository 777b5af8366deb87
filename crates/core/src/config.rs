//! Configuration of the online core: plain data with `Default`; every value has its unit and source.
//!
//! \[S\] is the supplement of Ferro, Gaz, Anzidei, Vendittelli 2021, \[L\] the tuning published with
//! the authors' laboratory software (facts only), \[D\] a completion derived for this project.

use crate::bounds::at_most;
use alloc::vec::Vec;

/// Largest speed in m/s that `Stylet` uses; faster samples are logging errors.
pub(crate) const MAX_SPEED_MPS: f64 = 2.0;

/// Regressor of a layer's force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Model {
    /// Kelvin-Voigt, `phi = [dz, v]` \[S (3)\]; its `b` is in N s/m.
    KelvinVoigt,
    /// Multi-layer, `phi = [dz, dz v]` \[S (4)\]; its `b` is in N s/m².
    #[default]
    MultiLayer,
}

/// When the covariance is reset to its prior.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum Reset {
    /// At a constant frequency \[S sec. II\].
    Frequency {
        /// Resets per second, positive; 40 \[S\], also 6.66 \[L\].
        hz: f64,
    },
    /// Whenever the trace of the covariance has fallen below a threshold \[S sec. II, refs 12, 13\].
    Trace {
        /// Threshold on `trace P`, positive.
        below: f64,
    },
    /// Only at contact and at detected ruptures \[S Figs 10-12\].
    Ruptures,
}

impl Default for Reset {
    fn default() -> Self {
        Self::Frequency { hz: 40.0 }
    }
}

/// Source of the first contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Contact {
    /// Detected in the data, see [`ContactConfig`].
    #[default]
    Detected,
    /// At the surface position that the caller passes to the core.
    Known,
    /// No contact detection: the recording begins with the tip in the tissue, and forces are absolute.
    None,
}

impl Contact {
    /// Name of the setting, as `--contact` takes it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Contact::Detected => "auto",
            Contact::Known => "known",
            Contact::None => "none",
        }
    }
}

/// Prior knowledge of the layers' depths.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Depths {
    /// Not known: a layer ends where a rupture is detected.
    #[default]
    Unknown,
    /// Thicknesses in m from a model of the anatomy; a layer ends at the latest when the tip passes its far face.
    Known(Vec<f64>),
}

/// Rupture detection by the cumulative sum of the squared reconstruction error.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct CusumConfig {
    /// Off: no alarms.
    pub enabled: bool,
    /// Standard deviation `s0` of the error during ordinary insertion in N; 0.01 \[L\].
    pub sigma_ordinary_n: f64,
    /// Standard deviation `s1` of the error after a rupture in N; 0.15, range 0.03-0.15 \[L\].
    pub sigma_rupture_n: f64,
}

impl Default for CusumConfig {
    fn default() -> Self {
        Self { enabled: true, sigma_ordinary_n: 0.01, sigma_rupture_n: 0.15 }
    }
}

impl CusumConfig {
    /// Drift `nu = (s1² + s0²)/2` in N², subtracted from `e²` at every sample.
    #[must_use]
    pub fn drift_n2(&self) -> f64 {
        let (s0, s1) = (self.sigma_ordinary_n, self.sigma_rupture_n);
        (s1 * s1 + s0 * s0) / 2.0
    }

    /// Alarm threshold `(s1² - s0²)/2` in N².
    #[must_use]
    pub fn threshold_n2(&self) -> f64 {
        let (s0, s1) = (self.sigma_ordinary_n, self.sigma_rupture_n);
        (s1 * s1 - s0 * s0) / 2.0
    }
}

/// Direction of the force change that makes a rupture expected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum DerivativeSense {
    /// The rising signal: loading \[L\].
    #[default]
    Rise,
    /// The falling signal: the drop itself \[S (1)\].
    Drop,
}

/// The force-derivative condition \[S (1)\].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct DerivativeConfig {
    /// Off: the state ExpectedRupture is never entered.
    pub enabled: bool,
    /// Sign of the derivative.
    pub sense: DerivativeSense,
    /// Threshold `beta` that switches on, in N/s; 0.075, range 0.05-0.15 \[L\].
    pub on_n_per_s: f64,
    /// Threshold that switches off, in N/s; -0.03 \[L\].
    pub off_n_per_s: f64,
    /// Time constant of the low-pass on the force in s; `a_f = 0.01` at 200 Hz \[L\].
    pub force_time_constant_s: f64,
    /// Time constant of the low-pass on the derivative in s; `a_d = 0.1` at 200 Hz \[L\].
    pub derivative_time_constant_s: f64,
    /// Switching off counts as a detection \[S sec. I; off in L\].
    pub trailing_edge: bool,
}

impl Default for DerivativeConfig {
    fn default() -> Self {
        Self {
            enabled: true,
            sense: DerivativeSense::Rise,
            on_n_per_s: 0.075,
            off_n_per_s: -0.03,
            // -0.005 / ln(1 - 0.01) and -0.005 / ln(1 - 0.1)
            force_time_constant_s: 0.497_496_0,
            derivative_time_constant_s: 0.047_456_1,
            trailing_edge: true,
        }
    }
}

/// Estimator of the force drop at a rupture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum DropEstimator {
    /// Lines fitted over 1 mm on either side, evaluated at the rupture \[D\]: less biased by noise.
    #[default]
    Lines,
    /// Maximum of the window before, minimum of the window after \[L\].
    Extremes,
}

/// Measurement of the force drop, re-weighting and compensation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct DropConfig {
    /// Travel in the state ForceDropMeasuring in m; 0.005 \[L\].
    pub travel_m: f64,
    /// Longest time in ForceDropMeasuring in s, without standstill; 5 \[L\].
    pub max_duration_s: f64,
    /// Travel in the state ForceCompensation in m; half of `travel_m`.
    pub compensation_travel_m: f64,
    /// Shortest time in ForceCompensation after the cumulative friction has changed, in s, so that the change itself does not
    /// count as a rupture \[D\].
    pub settle_s: f64,
    /// Speed below which the needle stands still, in m/s; 0.05 mm/s.
    pub standstill_mps: f64,
    /// Estimator of the drop.
    pub estimator: DropEstimator,
    /// Off: the prior is not re-weighted by the drop (ablation of \[S Figs 13-15\]).
    pub reweight: bool,
    /// Off: the online estimate at the rupture is kept instead of replaying the layer's samples.
    pub replay: bool,
    /// Off: nothing is added to the cumulative friction.
    pub compensate: bool,
    /// Limits on the elastic share `kappa`; 0.01 and 0.99.
    pub share_limits: [f64; 2],
    /// Replayed samples per step: bounds its work.
    pub replay_per_tick: usize,
}

impl Default for DropConfig {
    fn default() -> Self {
        Self {
            travel_m: 0.005,
            max_duration_s: 5.0,
            compensation_travel_m: 0.0025,
            settle_s: 0.1,
            standstill_mps: 5e-5,
            estimator: DropEstimator::Lines,
            reweight: true,
            replay: true,
            compensate: true,
            share_limits: [0.01, 0.99],
            replay_per_tick: 128,
        }
    }
}

/// Detection of the first contact in the data \[D\].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct ContactConfig {
    /// Time constant of the low-pass on the force in s.
    pub time_constant_s: f64,
    /// Threshold in standard deviations of the noise in air.
    pub noise_sds: f64,
    /// Consecutive samples above the threshold.
    pub samples: usize,
    /// Lower bound on the standard deviation of the noise in N, for data without noise. `Stylet` limits it to 1e-9 to 1e5.
    pub min_noise_n: f64,
    /// Time in air, in s, for learning bias and noise before contact can be declared.
    pub learn_s: f64,
    /// Travel after the declaration over which the loading line is fitted, in m; it is extrapolated back to zero force.
    pub extrapolate_over_m: f64,
}

impl Default for ContactConfig {
    fn default() -> Self {
        Self {
            time_constant_s: 0.05,
            noise_sds: 5.0,
            samples: 5,
            min_noise_n: 1e-4,
            learn_s: 0.25,
            extrapolate_over_m: 0.001,
        }
    }
}

/// Suppression of false ruptures \[D\].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct GuardConfig {
    /// Travel after contact or a rupture without detection, in m. `Stylet`: after contact, until the base law is confirmed; a fall by
    /// half of the force is a rupture.
    pub blind_travel_m: f64,
    /// Time constant of the acceleration in s.
    pub acceleration_time_constant_s: f64,
    /// Acceleration of a sudden change of speed, in m/s².
    pub sudden_mps2: f64,
    /// Distance above the deepest point from which the tip revisits tissue, in m; more than the position noise.
    pub revisit_margin_m: f64,
    /// Hold-off after a sudden change, a reversal or a hold, in s.
    pub rest_s: f64,
    /// Relative deceleration per second above which a trailing edge does not count.
    pub slowing_per_s: f64,
}

impl Default for GuardConfig {
    fn default() -> Self {
        Self {
            blind_travel_m: 0.002,
            acceleration_time_constant_s: 0.01,
            sudden_mps2: 0.05,
            revisit_margin_m: 1e-4,
            rest_s: 0.25,
            slowing_per_s: 0.1,
        }
    }
}

/// Algorithm of the online core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Algorithm {
    /// The paper's algorithm with the completions \[D\].
    Paper,
    /// The paper's algorithm as printed: no blind travel after contact, no motion guards, drop by extremes. At 20 mN of noise and with
    /// contact detected in the data nearly every insertion has a false rupture right after contact, and with the sinusoid from rest the
    /// first layer's `K` is off by half (`tests/detection_over_noise_seeds.rs`).
    Literal,
    /// Kalman filters with calibrated intervals, see [`StyletConfig`]. It has the multi-layer model only and detects layers
    /// itself: with [`Model::KelvinVoigt`] or [`Depths::Known`] the paper's algorithm runs instead.
    #[default]
    Stylet,
}

/// Law of the shaft friction `D u` that [`Algorithm::Stylet`] subtracts. The law defines the drive `u` (m/s); the cumulative friction
/// `D` (N s/m) is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub enum FrictionLaw {
    /// Selected during insertion: viscous while that predicts the force, dry afterwards.
    #[default]
    Auto,
    /// The paper's: `u = v`.
    Viscous,
    /// Coulomb and viscous: `u = v + dry_mps sgn v`.
    CoulombViscous {
        /// Ratio of dry to viscous friction, `c/b` in m/s, 0 or more.
        dry_mps: f64,
    },
    /// Viscous, and dry friction that builds up over travel and persists in holds: `u = v + dry_mps xi`,
    /// `xi' = (v/travel)(1 - xi sgn v)`.
    Presliding {
        /// Ratio of dry to viscous friction, `c/b` in m/s, 0 or more.
        dry_mps: f64,
        /// Travel over which it builds up, in m, positive.
        travel_m: f64,
    },
}

/// Settings of [`Algorithm::Stylet`]. Noise, friction and drop sizes are estimated during insertion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct StyletConfig {
    /// Accepted false alarms per hour of insertion, above 0.
    pub false_alarms_per_hour: f64,
    /// Smallest drop that counts as a rupture where the base law does not hold, relative to the largest force so far, 0 to 1;
    /// smaller drops are texture.
    pub min_drop_share: f64,
    /// Law of the shaft friction.
    pub friction_law: FrictionLaw,
    /// If true, slow changes of the force during retraction are attributed to friction; if false, friction keeps the value estimated
    /// during insertion.
    pub track_retraction: bool,
    /// True if velocities are derived from positions by a causal filter instead of measured. They show a stop one sample late, so a
    /// force drop that may be lost friction is declared a rupture only after the next position.
    pub derived_velocity: bool,
}

impl Default for StyletConfig {
    fn default() -> Self {
        Self {
            false_alarms_per_hour: 0.05,
            min_drop_share: 0.08,
            friction_law: FrictionLaw::Auto,
            track_retraction: true,
            derived_velocity: false,
        }
    }
}

/// Configuration of the core. The defaults of the paper's algorithm are the paper's.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct EnhanceConfig {
    /// Algorithm.
    pub algorithm: Algorithm,
    /// Regressor.
    pub model: Model,
    /// Covariance reset.
    pub reset: Reset,
    /// Source of the first contact.
    pub contact: Contact,
    /// Prior knowledge of the layers' depths.
    pub depths: Depths,
    /// RLS forgetting factor `lambda`, 0 to 1; 1 \[S\].
    pub forgetting: f64,
    /// Prior variance of the stiffness, `sK` in (N/m)²; 1e6 \[L\].
    pub prior_stiffness: f64,
    /// Prior variance of the friction, `sB` in the square of its unit; 1e6 \[L\].
    pub prior_friction: f64,
    /// CUSUM.
    pub cusum: CusumConfig,
    /// Force derivative.
    pub derivative: DerivativeConfig,
    /// Force drop, re-weighting and compensation.
    pub drop: DropConfig,
    /// First contact.
    pub contact_search: ContactConfig,
    /// Suppression of false ruptures.
    pub guard: GuardConfig,
    /// Settings of [`Algorithm::Stylet`].
    pub stylet: StyletConfig,
}

impl EnhanceConfig {
    /// The paper's algorithm with the paper's settings.
    #[must_use]
    pub fn paper() -> Self {
        Self { algorithm: Algorithm::Paper, ..Self::default() }
    }

    /// The algorithm that runs: [`Algorithm::Stylet`] has no Kelvin-Voigt model and uses no known depths.
    #[must_use]
    pub fn active_algorithm(&self) -> Algorithm {
        match self.algorithm {
            Algorithm::Stylet if self.model == Model::KelvinVoigt || self.depths != Depths::Unknown => {
                Algorithm::Paper
            }
            chosen => chosen,
        }
    }

    /// Speeds of `Stylet` at most [`MAX_SPEED_MPS`]: larger ones mean the same, and their squares may overflow.
    pub(crate) fn with_limited_speeds(mut self) -> Self {
        self.drop.standstill_mps = at_most(MAX_SPEED_MPS, self.drop.standstill_mps);
        match &mut self.stylet.friction_law {
            FrictionLaw::Auto | FrictionLaw::Viscous => {}
            FrictionLaw::CoulombViscous { dry_mps } | FrictionLaw::Presliding { dry_mps, .. } => {
                *dry_mps = at_most(MAX_SPEED_MPS, *dry_mps);
            }
        }
        self
    }
}

impl Default for EnhanceConfig {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::default(),
            model: Model::default(),
            reset: Reset::default(),
            contact: Contact::default(),
            depths: Depths::default(),
            forgetting: 1.0,
            prior_stiffness: 1e6,
            prior_friction: 1e6,
            cusum: CusumConfig::default(),
            derivative: DerivativeConfig::default(),
            drop: DropConfig::default(),
            contact_search: ContactConfig::default(),
            guard: GuardConfig::default(),
            stylet: StyletConfig::default(),
        }
    }
}
