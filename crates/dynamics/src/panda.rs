//! The Franka Emika Panda, with F/T sensor and needle.
//!
//! Link parameters: C. Gaz, M. Cognetti, A. Oliva, P. Robuffo Giordano, A. De Luca, *Dynamic identification
//! of the Franka Emika Panda robot with retrieval of feasible parameters using penalty-based optimization*,
//! IEEE RA-L 4(4), 2019, with the values, frames and limits of `panda_description/urdf/panda.urdf` in the
//! Python package `example-robot-data` 6.0.0 (from `franka_ros/franka_description`, Apache License 2.0),
//! re-typed. The hand is left out: the sensor sits on the flange.
//!
//! Joint friction: [`MEASURED_FRICTION`].

use crate::arm_model::{ArmModel, JointLimits, Link, Tool};
use crate::arm_posture::JointVector;
use crate::friction::{DirectionalFriction, FrictionLaw, JointFriction, SmoothSign};
use crate::pose::Pose;
use crate::rigid_body::RigidBody;
use nalgebra::{ArrayStorage, Matrix3, Vector3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// A common start: elbow up, flange pointing straight down half a metre ahead, far from limits and singular
/// poses (rad).
pub const READY_RAD: JointVector<7> = JointVector::<7>::from_array_storage(ArrayStorage([[
    0.0,
    -FRAC_PI_4,
    0.0,
    -3.0 * FRAC_PI_4,
    0.0,
    FRAC_PI_2,
    FRAC_PI_4,
]]));

/// Needle: mass, length, centre of mass from its base (laboratory software of the paper).
pub const NEEDLE_MASS_KG: f64 = 0.068;
/// See [`NEEDLE_MASS_KG`].
pub const NEEDLE_LENGTH_M: f64 = 0.153;
/// See [`NEEDLE_MASS_KG`].
pub const NEEDLE_COM_M: f64 = 0.09;
/// F/T sensor with its mounts (laboratory software of the paper).
pub const SENSOR_MASS_KG: f64 = 0.236;
/// Height of the cylinder that models sensor and mounts (assumed; the needle starts on top of it).
pub const SENSOR_HEIGHT_M: f64 = 0.03;
/// Its radius (assumed).
pub const SENSOR_RADIUS_M: f64 = 0.0225;
/// Radius of the homogeneous rod that gives the needle and its holder their inertia (assumed).
pub const NEEDLE_RADIUS_M: f64 = 0.003;

/// The arm without a tool.
pub fn without_tool() -> ArmModel<7> {
    let large =
        |lower_rad, upper_rad| JointLimits { lower_rad, upper_rad, velocity_radps: 2.175, torque_nm: 87.0 };
    let small =
        |lower_rad, upper_rad| JointLimits { lower_rad, upper_rad, velocity_radps: 2.61, torque_nm: 12.0 };
    ArmModel {
        links: [
            Link {
                placement: Pose::translation(0.0, 0.0, 0.333),
                body: body(
                    4.970684,
                    [0.003875, 0.002081, -0.04762],
                    [0.70337, -0.000139, 0.006772, 0.70661, 0.019169, 0.009117],
                ),
                limits: large(-2.8973, 2.8973),
            },
            Link {
                placement: rotated_back([0.0, 0.0, 0.0]),
                body: body(
                    0.646926,
                    [-0.003141, -0.02872, 0.003495],
                    [0.007962, -0.003925, 0.010254, 0.02811, 0.000704, 0.025995],
                ),
                limits: large(-1.7628, 1.7628),
            },
            Link {
                placement: rotated([0.0, -0.316, 0.0]),
                body: body(
                    3.228604,
                    [0.027518, 0.039252, -0.066502],
                    [0.037242, -0.004761, -0.011396, 0.036155, -0.012805, 0.01083],
                ),
                limits: large(-2.8973, 2.8973),
            },
            Link {
                placement: rotated([0.0825, 0.0, 0.0]),
                body: body(
                    3.587895,
                    [-0.05317, 0.104419, 0.027454],
                    [0.025853, 0.007796, -0.001332, 0.019552, 0.008641, 0.028323],
                ),
                limits: large(-3.0718, -0.0698),
            },
            Link {
                placement: rotated_back([-0.0825, 0.384, 0.0]),
                body: body(
                    1.225946,
                    [-0.011953, 0.041065, -0.038437],
                    [0.035549, -0.002117, -0.004037, 0.029474, 0.000229, 0.008627],
                ),
                limits: small(-2.8973, 2.8973),
            },
            Link {
                placement: rotated([0.0, 0.0, 0.0]),
                body: body(
                    1.666555,
                    [0.060149, -0.014117, -0.010517],
                    [0.001964, 0.000109, -0.001158, 0.004354, 0.000341, 0.005433],
                ),
                limits: small(-0.0175, 3.7525),
            },
            Link {
                placement: rotated([0.088, 0.0, 0.0]),
                body: body(
                    0.735522,
                    [0.010517, -0.004252, 0.061597],
                    [0.012516, -0.000428, -0.001196, 0.010027, -0.000741, 0.004815],
                ),
                limits: small(-2.8973, 2.8973),
            },
        ],
        flange: Pose::translation(0.0, 0.0, 0.107),
        tool: Tool::default(),
    }
}

/// F/T sensor on the flange, needle on the sensor, needle along the flange's z, tip frame at its end.
pub fn needle_and_sensor() -> Tool {
    let sensor = RigidBody::cylinder(
        SENSOR_MASS_KG,
        Vector3::new(0.0, 0.0, 0.5 * SENSOR_HEIGHT_M),
        SENSOR_RADIUS_M,
        SENSOR_HEIGHT_M,
    );
    let needle = RigidBody::cylinder(
        NEEDLE_MASS_KG,
        Vector3::new(0.0, 0.0, SENSOR_HEIGHT_M + NEEDLE_COM_M),
        NEEDLE_RADIUS_M,
        NEEDLE_LENGTH_M,
    );
    Tool {
        mount: Pose::IDENTITY,
        payload: sensor.combined(&needle),
        tip: Pose::translation(0.0, 0.0, SENSOR_HEIGHT_M + NEEDLE_LENGTH_M),
    }
}

/// [`without_tool`] with [`needle_and_sensor`].
pub fn with_needle() -> ArmModel<7> {
    without_tool().with_tool(needle_and_sensor())
}

/// Coulomb and viscous friction identified on a Panda: viscous (N m s/rad) and Coulomb (N m) symmetric, then
/// for positive, then for negative rates; one row per joint.
///
/// From `05_identified_friction_parameters/identified_friction_parameters.xlsx` of
/// <https://github.com/taraknezevic/franka-friction-identification-dataset> (commit 13ca991a), (c) 2026 Tara
/// Knezevic and co-authors, CC BY 4.0, re-typed without change.
pub const MEASURED_FRICTION: [[f64; 6]; 7] = [
    [0.0746, 0.311, 0.1019, 0.2294, 0.0406, 0.4466],
    [0.0866, 0.2007, 0.0219, 0.1381, 0.0422, 0.5648],
    [0.0406, 0.4265, 0.0490, 0.3019, 0.0476, 0.5361],
    [0.0453, 0.3214, 0.0821, 0.5107, 0.0643, 0.1009],
    [0.0410, 0.3555, 0.0873, 0.2517, 0.0256, 0.4199],
    [0.0574, 0.4978, 0.0907, 0.3986, 0.0260, 0.5768],
    [0.0310, 0.3318, 0.0521, 0.3568, 0.0109, 0.3024],
];

/// [`MEASURED_FRICTION`], the same in both directions.
pub fn symmetric_friction() -> JointFriction<7> {
    let joints = MEASURED_FRICTION.map(|row| FrictionLaw::symmetric(row[1], row[0]));
    JointFriction { joints, sign: SmoothSign::default() }
}

/// [`MEASURED_FRICTION`], direction-dependent.
pub fn directional_friction() -> JointFriction<7> {
    let joints = MEASURED_FRICTION.map(|row| FrictionLaw::CoulombViscous {
        positive: DirectionalFriction { coulomb_nm: row[3], viscous_nms_per_rad: row[2] },
        negative: DirectionalFriction { coulomb_nm: row[5], viscous_nms_per_rad: row[4] },
    });
    JointFriction { joints, sign: SmoothSign::default() }
}

/// Rotated by +90 degrees about x (exactly).
fn rotated(position_m: [f64; 3]) -> Pose {
    Pose {
        rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0),
        position_m: Vector3::from(position_m),
    }
}

/// Rotated by -90 degrees about x (exactly).
fn rotated_back(position_m: [f64; 3]) -> Pose {
    Pose {
        rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0),
        position_m: Vector3::from(position_m),
    }
}

/// Inertia in the order of a URDF: xx, xy, xz, yy, yz, zz.
fn body(mass_kg: f64, com_m: [f64; 3], [xx, xy, xz, yy, yz, zz]: [f64; 6]) -> RigidBody {
    RigidBody {
        mass_kg,
        com_m: Vector3::from(com_m),
        inertia_kgm2: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
    }
}
