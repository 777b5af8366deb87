//! One physics step of arm, controller and virtual sensor.

use crate::arm_body::{ArmBody, ArmChainError};
use crate::computed_torque_control::LineController;
use crate::joint_space_arm::JointSpaceArm;
use crate::virtual_sensor::{AxialForceObserver, JointTorqueSensors};
use nalgebra::Vector3;
use stylet_dynamics::feasibility;
use stylet_dynamics::{Arm, EARTH_GRAVITY_MPS2, Error, JointVector};
use stylet_scenario::{ArmConfig, ArmInsertionLine, MotionPoint, VirtualSensor};

/// Error of an insertion by the arm.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ArmError {
    /// The arm cannot be set up.
    #[error("the arm cannot be set up: {0}")]
    Setup(#[from] Error),
    /// rapier rejects the arm's joints.
    #[error(transparent)]
    Chain(#[from] ArmChainError),
    /// A limit was exceeded, or a value is not finite, during the motion.
    #[error("the arm stops at {time_s:.3} s: {reason}")]
    DuringMotion {
        /// Time in s.
        time_s: f64,
        /// Reason.
        reason: Error,
    },
}

/// The arm at one physics step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmStep {
    /// Joint angles, rad.
    pub q_rad: JointVector<7>,
    /// Axial position of the tip, m.
    pub position_m: f64,
    /// Its velocity over the step that ended here, m/s.
    pub velocity_mps: f64,
    /// Distance of the tip from the line, m.
    pub lateral_deviation_m: f64,
    /// Measured joint torques over the step that begins here, N m.
    pub joint_torque_nm: JointVector<7>,
    /// Axial force of the virtual sensor, N, when requested.
    pub virtual_force_n: Option<f64>,
}

/// The arm during an insertion.
pub struct ArmSimulation<Body = JointSpaceArm> {
    arm: Arm<7>,
    body: Body,
    control: LineController,
    sensors: JointTorqueSensors,
    observer: Option<AxialForceObserver>,
    /// Driving and measured joint torques of the last step, N m.
    last: (JointVector<7>, JointVector<7>),
    dt_s: f64,
}

impl<Body: ArmBody> ArmSimulation<Body> {
    /// The arm at the start of its approach. `first` is the commanded point there, `start_m` the axial position at which the line starts.
    ///
    /// # Errors
    /// [`ArmError`] when a value is out of range, which a checked scenario excludes.
    pub fn new(
        config: &ArmConfig,
        sensor: Option<&VirtualSensor>,
        line: &ArmInsertionLine,
        first: &MotionPoint,
        start_m: f64,
        dt_s: f64,
        seed: u64,
    ) -> Result<Self, ArmError> {
        let arm = Arm::new(&config.model())?;
        let control = LineController::new(&config.controller, line, start_m)?;
        let mut tip = line.start;
        tip.position_m += line.direction * (first.position_m - start_m);
        let q = arm.inverse_kinematics(
            &tip,
            &line.start_rad,
            &stylet_dynamics::IkConfig { restarts: 0, ..Default::default() },
        )?;
        let qd = control.start_rates(&arm, &q, first.velocity_mps);
        let body = Body::new(&arm, &q, &qd, dt_s)?;
        let noise_nm = sensor.map_or(0.0, |s| s.torque_noise_nm);
        let observer = sensor.map(|s| AxialForceObserver::new(config, s)).transpose()?;
        let still = JointVector::zeros();
        Ok(Self {
            arm,
            body,
            control,
            sensors: JointTorqueSensors::new(config, noise_nm, seed),
            observer,
            last: (still, still),
            dt_s,
        })
    }

    /// One physics step. `tissue` returns the resisting force (N) at a position (m) and velocity (m/s) of the tip; `sense` requests the force of the
    /// virtual sensor.
    ///
    /// # Errors
    /// When a joint leaves its range of angles or torques, or a value is not finite.
    pub fn step(
        &mut self,
        plan: &MotionPoint,
        sense: bool,
        tissue: impl FnOnce(f64, f64) -> f64,
    ) -> Result<ArmStep, Error> {
        let (q, qd) = self.body.joints();
        feasibility::check_joint_positions(&self.arm, &q)?;
        let at = self.arm.at(&q);
        let (tip, jacobian) = at.tip_and_jacobian();
        let twist = jacobian * qd;
        let direction = self.control.direction();
        let velocity: Vector3<f64> = twist.fixed_rows::<3>(0).into_owned();
        let position_m = self.control.axial_position_m(&tip);
        let velocity_mps = direction.dot(&velocity);
        let resistance_n = tissue(position_m, velocity_mps);

        let terms = at.momentum_terms(&qd, &EARTH_GRAVITY_MPS2);
        let mut virtual_n = None;
        if let Some(observer) = &mut self.observer {
            observer.step((&q, &qd), &terms, &self.last.1, self.dt_s)?;
            if sense {
                virtual_n = Some(observer.axial_force_n(&at, &direction));
            }
        }
        let driving =
            self.control.torque_nm(&at, &qd, &tip, &twist, &terms, plan, (&self.last.0, self.dt_s))?;
        feasibility::check_joint_torques(&self.arm, &driving)?;
        let reading = self.sensors.read(&driving, &qd);
        self.body.step(&at, &driving, &(direction * -resistance_n));
        self.last = (driving, reading);
        Ok(ArmStep {
            q_rad: q,
            position_m,
            velocity_mps,
            lateral_deviation_m: self.control.lateral_deviation_m(&tip),
            joint_torque_nm: reading,
            virtual_force_n: virtual_n,
        })
    }

    /// The virtual sensor.
    pub fn observer_mut(&mut self) -> Option<&mut AxialForceObserver> {
        self.observer.as_mut()
    }

    /// Axial force (N) of external joint torques (N m) at joint angles `q_rad`.
    #[must_use]
    pub fn axial_force_n(&self, q_rad: &JointVector<7>, torque_nm: &JointVector<7>) -> f64 {
        self.observer.as_ref().map_or(0.0, |observer| {
            observer.axial_force_of_torques_n(&self.arm.at(q_rad), &self.control.direction(), torque_nm)
        })
    }
}
