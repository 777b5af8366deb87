//! Where the fit of each effect begins: a grid over its shapes and both signs of its strength. A
//! linear look at each start decides which are worth a fit.

use crate::model::Choice;
use stylet_tissue::{EffectInfo, library};

/// A start.
#[derive(Clone, Debug)]
pub struct Start {
    /// The effect with its values.
    pub choice: Choice,
    /// By how many seconds the drops in the data come after the ruptures, with this effect.
    pub lead_s: f64,
    /// By how many metres of travel they do.
    pub lead_m: f64,
    /// Two starts in quadrature: the phase is found from both.
    pub quadrature: bool,
}

impl Start {
    /// Whether a fit from here is that from `other`.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        let whole = |s: &Self| (s.choice.info.id, s.lead_s.to_bits(), s.lead_m.to_bits());
        whole(self) == whole(other) && self.choice.values == other.choice.values
    }
}

/// Effects that are named from the raw data and not from the residual of a law.
pub const FROM_THE_RAW_DATA: [&str; 3] = ["saturation", "quantisation", "force_spikes"];

/// What the data say of where to look.
#[derive(Clone, Debug, Default)]
pub struct Hints {
    /// Frequencies (Hz) that stand out in the residual.
    pub lines_hz: Vec<f64>,
    /// Frequencies (Hz) to try for a breathing tissue.
    pub breath_hz: Vec<f64>,
    /// Number of layers.
    pub layers: usize,
    /// Depth (m) that the needle reached.
    pub depth_m: f64,
    /// Depths (m) at which the residual falls although no layer ruptured.
    pub drops_m: Vec<f64>,
    /// Membranes that a fine grid suggests, as `Look::membranes` gives them.
    pub membranes: Vec<[f64; 4]>,
    /// Largest force in N.
    pub force_n: f64,
}

/// All starts of all effects that are fitted.
#[must_use]
pub fn all(hints: &Hints) -> Vec<Start> {
    library().filter(|info| !FROM_THE_RAW_DATA.contains(&info.id)).flat_map(|info| of(info, hints)).collect()
}

/// The starts of one effect.
#[must_use]
pub fn of(info: &'static EffectInfo, hints: &Hints) -> Vec<Start> {
    let plain = |values: &[f64]| Start {
        choice: Choice::new(info, values),
        lead_s: 0.0,
        lead_m: 0.0,
        quadrature: false,
    };
    let each = |values: &[f64]| values.iter().map(|x| plain(&[*x])).collect::<Vec<_>>();
    match info.id {
        "nonlinear_elasticity" => each(&[10.0, -3.0]),
        "stress_relaxation" => {
            [0.1, 0.3, 0.8, 2.0, 5.0, 15.0].iter().map(|tau| plain(&[0.2, *tau])).collect()
        }
        "stribeck_friction" => [0.3e-3, 0.8e-3, 2e-3, 5e-3]
            .iter()
            .flat_map(|v| [plain(&[2.0, 6.0, *v]), plain(&[0.3, 4.0, *v])])
            .collect(),
        "presliding_friction" => [5e-5, 2e-4, 6e-4, 2e-3, 6e-3].iter().map(|d| plain(&[3.0, *d])).collect(),
        "power_law_friction" => each(&[0.7, 1.3]),
        "asymmetric_friction" => each(&[0.02, -0.02]),
        "position_scale" => each(&[0.02, -0.02, 0.08, -0.08]),
        "rate_dependent_puncture" => each(&[0.05, 0.15, 0.3, -0.05, -0.15, -0.3]),
        "hidden_membrane" => {
            let mut starts: Vec<Start> = hints
                .membranes
                .iter()
                .map(|[begins, breaks, k, _]| {
                    plain(&[*begins, k.clamp(2.0, 2e4), k.clamp(2.0, 2e4) * (breaks - begins)])
                })
                .collect();
            for at in &hints.drops_m {
                for (k, f) in [(60.0, 0.1), (60.0, 0.3), (250.0, 0.3), (250.0, 0.9)] {
                    starts.push(plain(&[at - f / k, k, f]));
                }
            }
            starts.retain(|s| s.choice.values[0] > 0.0);
            starts
        }
        "boundary_shift" => (1..hints.layers)
            .flat_map(|i| [0.002, -0.002, 0.007, -0.007].map(|d| plain(&[i as f64, d])))
            .collect(),
        "soft_boundary" => [0.5e-3, 2e-3, 5e-3]
            .iter()
            .flat_map(|w| [Start { lead_m: 0.5 * w, ..plain(&[*w]) }, plain(&[*w])])
            .collect(),
        "low_pass_lag" => [0.01, 0.04, 0.12, 0.3]
            .iter()
            .flat_map(|tau| [Start { lead_s: 0.7 * tau, ..plain(&[*tau]) }, plain(&[*tau])])
            .collect(),
        // The replay itself moves the ruptures back by the delay.
        "time_delay" => each(&[0.01, 0.03, 0.08, 0.2]),
        "needle_compliance" => each(&[200.0, 800.0, 3000.0]),
        "respiration" => {
            hints.breath_hz.iter().map(|f| Start { quadrature: true, ..plain(&[2e-4, *f, 0.0]) }).collect()
        }
        "periodic_interference" => {
            hints.lines_hz.iter().map(|f| Start { quadrature: true, ..plain(&[0.01, *f, 0.0]) }).collect()
        }
        "force_drift" => each(&[0.002]),
        _ => vec![plain(&info.parameters.iter().map(|p| p.start).collect::<Vec<_>>())],
    }
}
