//! Effects beyond the base law, written from the effects table of docs/reference/model.md: ids, parameters, and which of these are
//! strengths.

/// An effect with its parameters. Units are those of the parameter paths.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "names and units are those of docs/reference/model.md")]
pub enum Effect {
    NonlinearElasticity { kappa_per_m: f64 },
    StressRelaxation { terms: [(f64, f64); 2] },
    CoulombFriction { c_n_per_m: f64 },
    StribeckFriction { c_n_per_m: f64, c_static_n_per_m: f64, v_stribeck_mps: f64 },
    PreslidingFriction { c_n_per_m: f64, delta_m: f64 },
    AsymmetricFriction { eps: f64 },
    PowerLawFriction { exponent: f64 },
    CuttingForce { force_n: f64 },
    IncompleteRelease { fraction: f64 },
    RateDependentPuncture { alpha: f64 },
    HiddenMembrane { depth_m: f64, stiffness_n_per_m: f64, puncture_n: f64 },
    BoundaryShift { layer: usize, shift_m: f64 },
    SoftBoundary { width_m: f64 },
    Respiration { amplitude_m: f64, frequency_hz: f64, phase_rad: f64 },
    NeedleCompliance { stiffness_n_per_m: f64 },
    ToolInertia { mass_kg: f64 },
    DriveFriction { force_n: f64 },
    ForceGain { eps: f64 },
    LowPassLag { time_constant_s: f64 },
    TimeDelay { delay_s: f64 },
    ForceBias { force_n: f64 },
    ForceDrift { rate_n_per_s: f64 },
    PeriodicInterference { amplitude_n: f64, frequency_hz: f64, phase_rad: f64 },
    Saturation { limit_n: f64 },
    Quantisation { step_n: f64 },
    PositionScale { eps: f64 },
    ForceSpikes { rate_hz: f64, size_n: f64 },
    ZeroStep { time_s: f64, step_n: f64 },
    PositionDependentForce { stiffness_n_per_m: f64, rest_m: f64 },
    LoadingHysteresis { fraction: f64, reversal_n: f64 },
}

/// Their ids, in the order of docs/reference/model.md.
pub const IDS: [&str; 30] = [
    "nonlinear_elasticity",
    "stress_relaxation",
    "coulomb_friction",
    "stribeck_friction",
    "presliding_friction",
    "asymmetric_friction",
    "power_law_friction",
    "cutting_force",
    "incomplete_release",
    "rate_dependent_puncture",
    "hidden_membrane",
    "boundary_shift",
    "soft_boundary",
    "respiration",
    "needle_compliance",
    "tool_inertia",
    "drive_friction",
    "force_gain",
    "low_pass_lag",
    "time_delay",
    "force_bias",
    "force_drift",
    "periodic_interference",
    "saturation",
    "quantisation",
    "position_scale",
    "force_spikes",
    "zero_step",
    "position_dependent_force",
    "loading_hysteresis",
];

/// Further ids that an answer may use: effects added for measured insertions.
pub const FURTHER_IDS: [&str; 3] = ["viscoelastic_presliding", "deep_indentation", "layer_stiffening"];

impl Effect {
    /// The id used in every output.
    #[must_use]
    pub fn id(&self) -> &'static str {
        IDS[self.index()]
    }

    fn index(&self) -> usize {
        use Effect::*;
        match self {
            NonlinearElasticity { .. } => 0,
            StressRelaxation { .. } => 1,
            CoulombFriction { .. } => 2,
            StribeckFriction { .. } => 3,
            PreslidingFriction { .. } => 4,
            AsymmetricFriction { .. } => 5,
            PowerLawFriction { .. } => 6,
            CuttingForce { .. } => 7,
            IncompleteRelease { .. } => 8,
            RateDependentPuncture { .. } => 9,
            HiddenMembrane { .. } => 10,
            BoundaryShift { .. } => 11,
            SoftBoundary { .. } => 12,
            Respiration { .. } => 13,
            NeedleCompliance { .. } => 14,
            ToolInertia { .. } => 15,
            DriveFriction { .. } => 16,
            ForceGain { .. } => 17,
            LowPassLag { .. } => 18,
            TimeDelay { .. } => 19,
            ForceBias { .. } => 20,
            ForceDrift { .. } => 21,
            PeriodicInterference { .. } => 22,
            Saturation { .. } => 23,
            Quantisation { .. } => 24,
            PositionScale { .. } => 25,
            ForceSpikes { .. } => 26,
            ZeroStep { .. } => 27,
            PositionDependentForce { .. } => 28,
            LoadingHysteresis { .. } => 29,
        }
    }

    /// Its parameter values with their paths.
    #[must_use]
    pub fn parameters(&self) -> Vec<(String, f64)> {
        use Effect::*;
        let named: Vec<(&str, f64)> = match *self {
            NonlinearElasticity { kappa_per_m } => vec![("kappa_per_m", kappa_per_m)],
            StressRelaxation { terms } => {
                let mut all = vec![("terms.0.fraction", terms[0].0), ("terms.0.time_constant_s", terms[0].1)];
                if terms[1].0 != 0.0 {
                    all.extend([("terms.1.fraction", terms[1].0), ("terms.1.time_constant_s", terms[1].1)]);
                }
                all
            }
            CoulombFriction { c_n_per_m } => vec![("c_n_per_m", c_n_per_m)],
            StribeckFriction { c_n_per_m, c_static_n_per_m, v_stribeck_mps } => vec![
                ("c_n_per_m", c_n_per_m),
                ("c_static_n_per_m", c_static_n_per_m),
                ("v_stribeck_mps", v_stribeck_mps),
            ],
            PreslidingFriction { c_n_per_m, delta_m } => vec![("c_n_per_m", c_n_per_m), ("delta_m", delta_m)],
            AsymmetricFriction { eps } | ForceGain { eps } | PositionScale { eps } => vec![("eps", eps)],
            PowerLawFriction { exponent } => vec![("exponent", exponent)],
            CuttingForce { force_n } | DriveFriction { force_n } | ForceBias { force_n } => {
                vec![("force_n", force_n)]
            }
            IncompleteRelease { fraction } => vec![("fraction", fraction)],
            RateDependentPuncture { alpha } => vec![("alpha", alpha)],
            HiddenMembrane { depth_m, stiffness_n_per_m, puncture_n } => vec![
                ("depth_m", depth_m),
                ("stiffness_n_per_m", stiffness_n_per_m),
                ("puncture_n", puncture_n),
            ],
            BoundaryShift { layer, shift_m } => vec![("layer", layer as f64), ("shift_m", shift_m)],
            SoftBoundary { width_m } => vec![("width_m", width_m)],
            Respiration { amplitude_m, frequency_hz, phase_rad } => {
                vec![("amplitude_m", amplitude_m), ("frequency_hz", frequency_hz), ("phase_rad", phase_rad)]
            }
            NeedleCompliance { stiffness_n_per_m } => vec![("stiffness_n_per_m", stiffness_n_per_m)],
            ToolInertia { mass_kg } => vec![("mass_kg", mass_kg)],
            LowPassLag { time_constant_s } => vec![("time_constant_s", time_constant_s)],
            TimeDelay { delay_s } => vec![("delay_s", delay_s)],
            ForceDrift { rate_n_per_s } => vec![("rate_n_per_s", rate_n_per_s)],
            PeriodicInterference { amplitude_n, frequency_hz, phase_rad } => {
                vec![("amplitude_n", amplitude_n), ("frequency_hz", frequency_hz), ("phase_rad", phase_rad)]
            }
            Saturation { limit_n } => vec![("limit_n", limit_n)],
            Quantisation { step_n } => vec![("step_n", step_n)],
            ZeroStep { time_s, step_n } => vec![("time_s", time_s), ("step_n", step_n)],
            PositionDependentForce { stiffness_n_per_m, rest_m } => {
                vec![("stiffness_n_per_m", stiffness_n_per_m), ("rest_m", rest_m)]
            }
            LoadingHysteresis { fraction, reversal_n } => {
                vec![("fraction", fraction), ("reversal_n", reversal_n)]
            }
            ForceSpikes { rate_hz, size_n } => vec![("rate_hz", rate_hz), ("size_n", size_n)],
        };
        named.into_iter().map(|(path, value)| (path.to_owned(), value)).collect()
    }
}
