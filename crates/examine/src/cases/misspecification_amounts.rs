//! Amounts of misspecification of a case.

use super::case_id::{Severity, Wrong};

/// Number of layers of the drawn stacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerStack {
    /// Two to four layers of 15 to 45 mm.
    Usual,
    /// One or two.
    Few,
    /// Five.
    Five,
    /// Six, over the widest ranges.
    Six,
}

/// Amounts of misspecification. [`MisspecificationAmounts::none`] is the case without any.
#[derive(Clone, Debug, PartialEq)]
pub struct MisspecificationAmounts {
    /// Relative error of the thicknesses.
    pub thickness: f64,
    /// Error of the surface position in m, common to all recordings.
    pub surface_m: f64,
    /// Error of the surface position in m, independent in every recording.
    pub surface_each_m: f64,
    /// Relative error of K, b, F.
    pub coefficients: f64,
    /// Largest factor by which thickness, K, b, F of a guessed scenario are off.
    pub guess: f64,
    /// Whether there is a scenario.
    pub has_scenario: bool,
    /// Standard deviation of the encoder's noise in m.
    pub encoder_m: f64,
    /// Step of the encoder in m.
    pub encoder_step_m: f64,
    /// Jitter of the sample times as a share of the interval.
    pub jitter: f64,
    /// Share of samples missing.
    pub dropped: f64,
    /// Delay of the force in samples.
    pub late_samples: f64,
    /// Standard deviation of the force-dependent noise as a share of the force.
    pub growing: f64,
    /// Share of the noise variance with heavy tails.
    pub tails: f64,
    /// Autoregressive coefficients of the noise, if prescribed.
    pub ar: Option<[f64; 2]>,
    /// 1/f drift, in noise standard deviations.
    pub wander: f64,
    /// Amplitude of the mains hum, in noise standard deviations.
    pub hum: f64,
    /// Range in N of a 12-bit converter.
    pub bits_range_n: Option<f64>,
    /// Samples per second.
    pub rate_hz: f64,
    /// Number of layers.
    pub stack: LayerStack,
    /// Travel in air in m.
    pub air_m: f64,
    /// Number of recordings.
    pub recordings: usize,
    /// Scatter of the puncture forces between recordings, relative.
    pub scatter_puncture: f64,
    /// Scatter of the friction.
    pub scatter_friction: f64,
    /// Scatter of the surface, share of the first layer's thickness.
    pub scatter_surface: f64,
}

impl MisspecificationAmounts {
    /// Whether the layers are not known to the usual tolerance.
    #[must_use]
    pub fn is_tissue_guessed(&self) -> bool {
        self.guess > 1.0 || !self.has_scenario
    }

    /// Delay of the force in s.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.late_samples / self.rate_hz
    }

    /// No misspecification, except for the usual error of 5 % in K, b, F.
    #[must_use]
    pub fn none() -> Self {
        Self {
            thickness: 0.0,
            surface_m: 0.0,
            surface_each_m: 0.0,
            coefficients: 0.05,
            guess: 1.0,
            has_scenario: true,
            encoder_m: 0.0,
            encoder_step_m: 0.0,
            jitter: 0.0,
            dropped: 0.0,
            late_samples: 0.0,
            growing: 0.0,
            tails: 0.0,
            ar: None,
            wander: 0.0,
            hum: 0.0,
            bits_range_n: None,
            rate_hz: 200.0,
            stack: LayerStack::Usual,
            air_m: 0.005,
            recordings: 4,
            scatter_puncture: 0.0,
            scatter_friction: 0.0,
            scatter_surface: 0.0,
        }
    }

    /// The amounts of a row of the table.
    #[must_use]
    pub fn of(wrong: Wrong, severity: Severity) -> Self {
        let mut it = Self::none();
        let pick = |three: [f64; 3]| three[severity as usize];
        match wrong {
            Wrong::Nothing => {}
            Wrong::Thickness => it.thickness = pick([0.02, 0.05, 0.10]),
            Wrong::Surface => it.surface_m = pick([0.5e-3, 1e-3, 2e-3]),
            Wrong::SurfaceEach => it.surface_each_m = pick([0.5e-3, 1e-3, 2e-3]),
            Wrong::Coefficients => it.coefficients = pick([0.10, 0.20, 0.28]),
            Wrong::Guess => it.guess = pick([1.6, 3.0, 10.0]),
            Wrong::NoScenario => {
                it.has_scenario = false;
                it.stack = [LayerStack::Few, LayerStack::Usual, LayerStack::Five][severity as usize];
            }
            Wrong::Encoder => it.encoder_m = pick([2e-6, 10e-6, 20e-6]),
            Wrong::EncoderSteps => it.encoder_step_m = pick([5e-6, 20e-6, 50e-6]),
            Wrong::Jitter => it.jitter = pick([0.1, 0.2, 0.3]),
            Wrong::Dropped => it.dropped = pick([0.01, 0.03, 0.10]),
            Wrong::Late => it.late_samples = pick([0.5, 1.0, 2.0]),
            Wrong::Growing => it.growing = pick([0.005, 0.01, 0.02]),
            Wrong::Tails => it.tails = pick([0.125, 0.25, 0.5]),
            Wrong::Ar1 => it.ar = Some([pick([0.5, 0.8, 0.95]), 0.0]),
            Wrong::Ar2 => it.ar = Some([[0.8, -0.3], [1.3, -0.6], [1.6, -0.8]][severity as usize]),
            Wrong::Wander => it.wander = pick([0.5, 1.0, 2.0]),
            Wrong::Hum => it.hum = pick([0.5, 1.0, 2.0]),
            Wrong::Bits => it.bits_range_n = Some(pick([10.0, 20.0, 40.0])),
            Wrong::Rate => it.rate_hz = pick([50.0, 1000.0, 5000.0]),
            Wrong::Layers => {
                it.stack = [LayerStack::Few, LayerStack::Five, LayerStack::Six][severity as usize]
            }
            Wrong::NoAir => it.air_m = pick([1e-3, 0.3e-3, 0.0]),
            Wrong::Recordings => it.recordings = [8, 2, 1][severity as usize],
            Wrong::ScatterPuncture => it.scatter_puncture = pick([0.01, 0.03, 0.06]),
            Wrong::ScatterFriction => it.scatter_friction = pick([0.01, 0.03, 0.06]),
            Wrong::ScatterSurface => it.scatter_surface = pick([0.01, 0.03, 0.06]),
            Wrong::Geometry => {
                it.thickness = pick([0.02, 0.05, 0.10]);
                it.surface_m = pick([0.5e-3, 1e-3, 2e-3]);
            }
            Wrong::Five => {
                it.thickness = 0.5 * pick([0.02, 0.05, 0.10]);
                it.surface_m = 0.5 * pick([0.5e-3, 1e-3, 2e-3]);
                it.coefficients = 0.5 * pick([0.10, 0.20, 0.28]);
                it.encoder_m = 0.5 * pick([2e-6, 10e-6, 20e-6]);
                it.growing = 0.5 * pick([0.005, 0.01, 0.02]);
            }
        }
        it
    }
}
