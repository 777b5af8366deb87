//! Computed-torque control of the needle's tip along a line.

use nalgebra::{Vector3, Vector6};
use stylet_dynamics::{
    Arm, EARTH_GRAVITY_MPS2, Error, JointGain, JointVector, MomentumTerms, Observer, ObserverConfig,
    ObserverState, Pose, Posture, Wrench,
};
use stylet_scenario::{ArmController, ArmInsertionLine, MotionPoint};

/// Controller of the tip, `tau = M qdd + C qd + g - r`:
///
/// `qdd = J^+ (a - dJ/dt qd + k J qd) - k qd` with `a = a_plan + 2 w (v_plan - v) + w² (x_plan - x)` for the
/// position of the tip and likewise for its orientation, `k` the damping of the null-space motion, and `r` the external joint torques of a momentum
/// observer (Khatib 1987; De Luca and Mattone 2005). Without `r` the tip would deviate by `f/(Lambda w²)` under a force `f`. The observer uses the
/// torque that drives the links: the inner loops of the motors compensate their friction.
#[derive(Debug)]
pub struct LineController {
    config: ArmController,
    start: Pose,
    direction: Vector3<f64>,
    /// Axial position of `start`, m.
    start_m: f64,
    observer: Option<Observer<7>>,
    state: ObserverState<7>,
}

/// Damping of the inverse Jacobian. The line was checked to stay away from singular poses.
const DAMPING: f64 = 1e-6;

impl LineController {
    /// Controller of a line that starts at the axial position `start_m`.
    ///
    /// # Errors
    /// When the gain of the disturbance observer is not a positive number (zero: no feed-forward).
    pub fn new(config: &ArmController, line: &ArmInsertionLine, start_m: f64) -> Result<Self, Error> {
        let gain_per_s = JointGain::Uniform(config.disturbance_gain_per_s);
        let observer = match config.disturbance_gain_per_s {
            0.0 => None,
            _ => Some(ObserverConfig { gain_per_s }.build()?),
        };
        Ok(Self {
            config: *config,
            start: line.start,
            direction: line.direction,
            start_m,
            observer,
            state: ObserverState::default(),
        })
    }

    /// Joint rates that move the tip along the line at `velocity_mps`.
    #[must_use]
    pub fn start_rates(&self, arm: &Arm<7>, q_rad: &JointVector<7>, velocity_mps: f64) -> JointVector<7> {
        let v = self.direction * velocity_mps;
        arm.at(q_rad).joint_rates(&Vector6::new(v.x, v.y, v.z, 0.0, 0.0, 0.0), DAMPING)
    }

    /// Position (m) of a tip along the insertion axis.
    #[inline]
    #[must_use]
    pub fn axial_position_m(&self, tip: &Pose) -> f64 {
        self.start_m + self.direction.dot(&(tip.position_m - self.start.position_m))
    }

    /// Insertion direction, base frame.
    #[must_use]
    pub fn direction(&self) -> Vector3<f64> {
        self.direction
    }

    /// Distance (m) of a tip from the line.
    #[must_use]
    pub fn lateral_deviation_m(&self, tip: &Pose) -> f64 {
        let away = tip.position_m - self.start.position_m;
        (away - self.direction * self.direction.dot(&away)).norm()
    }

    /// Joint torques (N m) to apply. `terms` are the momentum terms at the present state, `last` the torque and duration (s) of the previous step,
    /// `twist` the velocity and angular velocity of the tip.
    ///
    /// # Errors
    /// When a value is not finite.
    #[allow(clippy::too_many_arguments)]
    pub fn torque_nm(
        &mut self,
        at: &Posture<'_, 7>,
        qd_radps: &JointVector<7>,
        tip: &Pose,
        twist: &Vector6<f64>,
        terms: &MomentumTerms<7>,
        plan: &MotionPoint,
        last: (&JointVector<7>, f64),
    ) -> Result<JointVector<7>, Error> {
        let external = match &self.observer {
            Some(observer) => observer.step(&mut self.state, terms, last.0, last.1)?,
            None => JointVector::zeros(),
        };
        let w = self.config.natural_frequency_radps;
        let target_m = self.start.position_m + self.direction * (plan.position_m - self.start_m);
        let (v, turning) = (twist.fixed_rows::<3>(0), twist.fixed_rows::<3>(3));
        let forward = self.direction * plan.acceleration_mps2
            + (self.direction * plan.velocity_mps - v) * (2.0 * w)
            + (target_m - tip.position_m) * (w * w);
        let turn = tip.rotation_vector_to(&self.start) * (w * w) - turning * (2.0 * w);
        let k = self.config.elbow_damping_per_s;
        let twist_rate = Vector6::new(forward.x, forward.y, forward.z, turn.x, turn.y, turn.z) + twist * k
            - at.tip_acceleration(qd_radps, &JointVector::zeros());
        let qdd = at.joint_rates(&twist_rate, DAMPING) - qd_radps * k;
        Ok(at.inverse_dynamics(qd_radps, &qdd, &EARTH_GRAVITY_MPS2, &Wrench::default()) - external)
    }
}
