//! The virtual sensor: force at the needle's tip from the joint torques of the arm.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use stylet_dynamics::friction::JointFriction;
use stylet_dynamics::{
    Arm, EARTH_GRAVITY_MPS2, Error, JointVector, MomentumTerms, Observer, ObserverConfig, ObserverState,
    Posture,
};
use stylet_scenario::{ArmConfig, VirtualSensor, WrenchEstimate};

/// Generator stream of the torque noise.
const NOISE_STREAM: u64 = 2;
/// Damping of the pseudo-inverse; its effect on the force is about 1e-6.
const DAMPING: f64 = 1e-3;

/// Joint torques as the arm measures them.
///
/// The inner loops of the motors compensate joint friction: the commanded torque drives the links, and the measured torque contains `friction(qd)` in
/// addition. For the same motion the residual of an observer is the same as with friction on the links, which is stiff at 1 kHz (see
/// `stylet_dynamics::friction::SmoothSign::width_radps`).
#[derive(Debug)]
pub struct JointTorqueSensors {
    friction: JointFriction<7>,
    noise_nm: f64,
    generator: ChaCha8Rng,
}

impl JointTorqueSensors {
    /// Sensors with the arm's friction and white noise of standard deviation `noise_nm` from `seed`.
    #[must_use]
    pub fn new(arm: &ArmConfig, noise_nm: f64, seed: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(NOISE_STREAM);
        Self { friction: arm.joint_friction.friction_models(arm.friction_scale), noise_nm, generator }
    }

    /// Measured torques (N m) while `driving_nm` drives the links at joint rates `qd_radps`.
    #[inline]
    pub fn read(&mut self, driving_nm: &JointVector<7>, qd_radps: &JointVector<7>) -> JointVector<7> {
        let mut reading = driving_nm + self.friction.torques(qd_radps);
        if self.noise_nm > 0.0 {
            for torque in &mut reading {
                let unit: f64 = StandardNormal.sample(&mut self.generator);
                *torque += self.noise_nm * unit;
            }
        }
        reading
    }
}

/// Momentum observer with its assumed model of the arm, reporting the axial force.
///
/// `r = G (p - p(0) - int(tau + C^T qd - g + r) ds)` once per physics step; wrench `= pinv(J^T) r`, less
/// the value of `r` in the air; axial force `f = -F . u` (`docs/reference/model.md`, *Sensors*; `stylet_dynamics::Observer`).
#[derive(Debug)]
pub struct AxialForceObserver {
    /// The assumed model, if it differs from the true one.
    assumed: Option<Arm<7>>,
    observer: Observer<7>,
    state: ObserverState<7>,
    wrench: WrenchEstimate,
}

impl AxialForceObserver {
    /// An observer for an arm.
    ///
    /// # Errors
    /// When a gain or the assumed model is out of range.
    pub fn new(arm: &ArmConfig, sensor: &VirtualSensor) -> Result<Self, Error> {
        let differs = arm.payload_error_kg != 0.0 || arm.link_mass_error != 0.0;
        Ok(Self {
            assumed: if differs { Some(Arm::new(&arm.assumed_model())?) } else { None },
            observer: ObserverConfig { gain_per_s: sensor.gain_per_s.into() }.build()?,
            state: ObserverState::default(),
            wrench: sensor.wrench,
        })
    }

    /// One physics step: `terms` of the true arm at the present state, joint torques (N m) measured over the previous step of `dt_s`.
    ///
    /// # Errors
    /// When a value is not finite.
    #[inline]
    pub fn step(
        &mut self,
        (q_rad, qd_radps): (&JointVector<7>, &JointVector<7>),
        terms: &MomentumTerms<7>,
        torque_nm: &JointVector<7>,
        dt_s: f64,
    ) -> Result<(), Error> {
        let terms = match &self.assumed {
            None => *terms,
            Some(arm) => arm.at(q_rad).momentum_terms(qd_radps, &EARTH_GRAVITY_MPS2),
        };
        self.observer.step(&mut self.state, &terms, torque_nm, dt_s)?;
        Ok(())
    }

    /// Starts averaging the residual.
    pub fn begin_zeroing(&mut self) {
        self.state.begin_offset();
    }

    /// Subtracts the average from now on and returns it, in joint torques (N m).
    ///
    /// # Errors
    /// When there is nothing to average.
    pub fn finish_zeroing(&mut self) -> Result<JointVector<7>, Error> {
        self.state.finish_offset()
    }

    /// Axial force (N) of the residual along `direction`, positive when it resists the insertion.
    #[must_use]
    pub fn axial_force_n(&self, at: &Posture<'_, 7>, direction: &Vector3<f64>) -> f64 {
        self.axial_force_of_torques_n(at, direction, &self.state.residual_nm())
    }

    /// The same for given external joint torques (N m).
    #[must_use]
    pub fn axial_force_of_torques_n(
        &self,
        at: &Posture<'_, 7>,
        direction: &Vector3<f64>,
        torque_nm: &JointVector<7>,
    ) -> f64 {
        match self.wrench {
            WrenchEstimate::Full => -at.tip_wrench(torque_nm, DAMPING).component_along(direction),
            WrenchEstimate::Point => -at.tip_point_force(torque_nm, DAMPING).dot(direction),
        }
    }
}
