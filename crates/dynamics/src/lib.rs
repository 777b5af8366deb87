#![doc = include_str!("../README.md")]
//!
//! # Frames and signs
//! - SI units; angles in rad. All rotations map coordinates of the child frame into the parent's.
//! - *Base frame*: base of the arm (`panda_link0`), z up when the arm stands on a table; gravity is then
//!   [`EARTH_GRAVITY_MPS2`].
//! - *Link frame* `i`: moves with link `i`, origin on joint `i`, z along the joint's axis. Joint angles turn
//!   right-handed about z.
//! - *Flange*: fixed to the last link (`panda_link8`), z out of the arm. The *tool frame* sits on it, the
//!   *tip frame* in the tool frame; with [`panda::needle_and_sensor`] the tip's z is the needle's axis,
//!   pointing into the tissue.
//! - A [`Wrench`] acts on the arm: force on the tip and moment about the tip's origin, both in base coordinates. The
//!   Jacobian maps joint rates to the tip's velocity (rows 0-2, m/s) and angular velocity (rows 3-5, rad/s), also in base coordinates.
//! - Equation of motion: `M(q) qd' + C(q, qd) qd + g(q) = tau - tau_friction + J^T F`. The observer's
//!   residual tends to `J^T F - tau_friction`. Tissue that resists an insertion along the unit vector `u`
//!   pushes with `F = -f u`: the axial force of the rest of the project is `f = -wrench.component_along(u)`.
//!
//! # Accuracy and cost
//! `tests/promises/reference.rs` compares torques, mass matrix, Jacobian and momentum terms with Pinocchio and MuJoCo
//! at 1000 random states; `examples/time_observer.rs` prints the cost of one observer step;
//! `tests/no_allocation.rs` counts allocations (only the error of a failing line check makes one). Sines and
//! exponentials come from `libm` and all matrices have fixed sizes, so that results do not depend on the
//! platform's maths library or CPU features.
//!
//! # Sources
//! Featherstone, *Rigid Body Dynamics Algorithms*, Springer 2008 (RBDA). De Luca and Mattone, ICRA 2005, and
//! Haddadin, De Luca and Albu-Schaeffer, *Robot collisions: a survey on detection, isolation, and
//! identification*, IEEE T-RO 2017 (the observer).

mod arm_model;
mod arm_posture;
mod cholesky_solve;
mod error;
pub mod feasibility;
mod forward_dynamics;
pub mod friction;
mod generalized_momentum;
mod inverse_kinematics;
mod kinematics;
mod mass_matrix;
mod momentum_observer;
pub mod panda;
mod pose;
mod rigid_body;
mod rnea;
mod singular_values;
mod tip_wrench;
mod wrench;

pub use arm_model::{ArmModel, JointLimits, Link, Tool};
pub use arm_posture::{Arm, JointVector, Posture};
pub use error::{Error, JointQuantity};
pub use generalized_momentum::MomentumTerms;
pub use inverse_kinematics::IkConfig;
pub use kinematics::Jacobian;
pub use momentum_observer::{JointGain, Observer, ObserverConfig, ObserverState};
pub use pose::Pose;
pub use rigid_body::RigidBody;
pub use singular_values::SingularValues;
pub use wrench::Wrench;

/// Gravity in the base frame of an arm that stands upright (m/s^2).
pub const EARTH_GRAVITY_MPS2: nalgebra::Vector3<f64> = nalgebra::Vector3::new(0.0, 0.0, -9.81);
