//! Nothing that runs in the control loop allocates, inverse kinematics and line checks included.
#![allow(unsafe_code)] // a counting allocator has to be

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;
use stylet_dynamics::{
    Arm, EARTH_GRAVITY_MPS2, IkConfig, JointVector, ObserverConfig, ObserverState, Wrench,
    feasibility::{self, LineConfig},
    panda,
};

thread_local! { static COUNT: Cell<usize> = const { Cell::new(0) }; }

struct Counting;

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_step_of_arm_controller_and_virtual_sensor_does_not_allocate() {
    let before = COUNT.get();
    drop(black_box(Box::new(1)));
    assert_eq!(COUNT.get(), before + 1, "the counter must count");

    let arm = Arm::new(&panda::with_needle()).expect("valid");
    let observer = ObserverConfig::default().build().expect("valid");
    let friction = panda::directional_friction();
    let mut state = ObserverState::default();
    let (q, qd, g) = (panda::READY_RAD, JointVector::<7>::repeat(0.01), EARTH_GRAVITY_MPS2);
    let before = COUNT.get();
    for _ in 0..10 {
        let at = arm.at(&q);
        let torque = at.inverse_dynamics(&qd, &qd, &g, &Wrench::default()) + friction.torques(&qd);
        let r = observer.step(&mut state, &at.momentum_terms(&qd, &g), &torque, 0.001).expect("finite");
        black_box(at.tip_wrench(&r, 1e-3));
        black_box(at.tip_point_force(&r, 1e-3));
        black_box(at.mass_matrix());
        black_box(at.tip_acceleration(&qd, &qd));
        black_box(at.singular_values());
    }
    let mut target = arm.at(&q).tip();
    target.position_m.z -= 0.05;
    black_box(arm.inverse_kinematics(&target, &q, &IkConfig::default()).is_ok());
    black_box(
        feasibility::follow_line(&arm, &target, &arm.at(&q).tip().position_m, &q, &LineConfig::default())
            .is_ok(),
    );
    assert_eq!(COUNT.get(), before);
}
