//! The committed random states, see `reference/make_reference.py`.
#![allow(dead_code)]

use stylet_dynamics::{EARTH_GRAVITY_MPS2, JointVector, Posture, Wrench};

pub const STATES: usize = 1000;

#[derive(Debug, Clone, Copy)]
pub struct State {
    pub q: JointVector<7>,
    pub qd: JointVector<7>,
    pub qdd: JointVector<7>,
    pub wrench: Wrench,
}

pub fn states() -> Vec<State> {
    let text = include_str!("../../../reference/states.csv");
    let states: Vec<State> = text
        .lines()
        .map(|line| {
            let n: Vec<f64> = line.split(',').map(|field| field.parse().expect("number")).collect();
            assert_eq!(n.len(), 27);
            State {
                q: JointVector::from_column_slice(&n[0..7]),
                qd: JointVector::from_column_slice(&n[7..14]),
                qdd: JointVector::from_column_slice(&n[14..21]),
                wrench: Wrench {
                    force_n: nalgebra::Vector3::from_column_slice(&n[21..24]),
                    moment_nm: nalgebra::Vector3::from_column_slice(&n[24..27]),
                },
            }
        })
        .collect();
    assert_eq!(states.len(), STATES);
    states
}

/// Rows of little-endian f64.
pub fn rows(bytes: &[u8], width: usize) -> Vec<Vec<f64>> {
    assert_eq!(bytes.len(), STATES * width * 8);
    bytes
        .chunks_exact(width * 8)
        .map(|row| row.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().expect("8 bytes"))).collect())
        .collect()
}

/// Torques of Coriolis, centrifugal and gravity forces (N m).
pub fn bias_torques(
    at: &Posture<'_, 7>,
    qd: &JointVector<7>,
    gravity: &nalgebra::Vector3<f64>,
) -> JointVector<7> {
    at.inverse_dynamics(qd, &JointVector::zeros(), gravity, &Wrench::default())
}

/// Joint accelerations under joint torques and a wrench on the tip: `M^-1 (tau - C qd - g + J^T F)`.
pub fn forward_dynamics(
    at: &Posture<'_, 7>,
    qd: &JointVector<7>,
    torque: &JointVector<7>,
    tip: &Wrench,
) -> JointVector<7> {
    let bias = at.inverse_dynamics(qd, &JointVector::zeros(), &EARTH_GRAVITY_MPS2, tip);
    at.mass_matrix().cholesky().expect("positive definite").solve(&(torque - bias))
}
