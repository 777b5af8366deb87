//! Time of one step of the virtual sensor, by parts.
//!
//! `cargo run --release -p stylet-dynamics --example time_observer`

use std::hint::black_box;
use std::time::Instant;
use stylet_dynamics::{Arm, EARTH_GRAVITY_MPS2, JointVector, ObserverConfig, ObserverState, Wrench, panda};

/// Least of several averages: the machine is shared.
fn time(name: &str, mut f: impl FnMut(&JointVector<7>)) {
    const STEPS: usize = 20_000;
    let mut best = f64::INFINITY;
    for _ in 0..20 {
        let start = Instant::now();
        for k in 0..STEPS {
            let q = panda::READY_RAD.add_scalar(1e-5 * k as f64);
            f(black_box(&q));
        }
        best = best.min(start.elapsed().as_nanos() as f64 / STEPS as f64);
    }
    println!("{name:<60} {best:7.0} ns");
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arm = Arm::new(&panda::with_needle())?;
    let observer = ObserverConfig::default().build()?;
    let mut state = ObserverState::default();
    let (qd, g) = (JointVector::<7>::repeat(0.01), EARTH_GRAVITY_MPS2);
    let torque = arm.at(&panda::READY_RAD).gravity_torques(&g);

    time("posture (sines and cosines)", |q| {
        black_box(arm.at(q));
    });
    time("posture, p, C^T qd, g, observer step: the residual", |q| {
        let terms = arm.at(q).momentum_terms(&qd, &g);
        black_box(observer.step(&mut state, &terms, &torque, 0.001).is_ok());
    });
    let mut state = ObserverState::default();
    time("the same and the wrench at the tip", |q| {
        let at = arm.at(q);
        let terms = at.momentum_terms(&qd, &g);
        if let Ok(r) = observer.step(&mut state, &terms, &torque, 0.001) {
            black_box(at.tip_wrench(&r, 1e-3));
        }
    });
    time("posture, inverse dynamics", |q| {
        black_box(arm.at(q).inverse_dynamics(&qd, &qd, &g, &Wrench::default()));
    });
    time("posture, mass matrix", |q| {
        black_box(arm.at(q).mass_matrix());
    });
    time("posture, tip and Jacobian", |q| {
        black_box(arm.at(q).tip_and_jacobian());
    });
    time("posture, singular values", |q| {
        black_box(arm.at(q).singular_values());
    });
    Ok(())
}
