//! Promise: the tissue of the C interface gives bitwise the forces of Rust, and refuses invalid layers by field.

use std::ffi::{CStr, c_char};
use stylet::{
    StyletForce, StyletLayer, StyletStatus, StyletTissue, stylet_tissue_free, stylet_tissue_new,
    stylet_tissue_step,
};
use stylet_tissue::{ForceLaw, ForceLawState, Tissue};

fn three_gels() -> Vec<StyletLayer> {
    let of = |l: &stylet_tissue::Layer| StyletLayer {
        thickness_m: l.thickness_m,
        stiffness_n_per_m: l.stiffness_n_per_m,
        friction_ns_per_m2: l.friction_ns_per_m2,
        puncture_n: l.puncture_n.unwrap_or(0.0),
    };
    Tissue::three_gels().layers.iter().map(of).collect()
}

fn new(layers: &[StyletLayer], surface_m: f64) -> (StyletStatus, *mut StyletTissue, String) {
    let (mut tissue, mut why): (_, *const c_char) = (std::ptr::null_mut(), c"".as_ptr());
    // SAFETY: all pointers are valid, and messages of the library are static.
    unsafe {
        let status = stylet_tissue_new(layers.as_ptr(), layers.len(), surface_m, &mut tissue, &mut why);
        (status, tissue, CStr::from_ptr(why).to_string_lossy().into_owned())
    }
}

#[test]
fn the_forces_are_bitwise_those_of_rust() {
    let (status, tissue, why) = new(&three_gels(), 0.0);
    assert_eq!((status, why.as_str()), (StyletStatus::StyletOk, ""));
    let law = ForceLaw::base(&Tissue::three_gels());
    let mut state = ForceLawState::default();
    let mut last = 0;
    for k in 0..25_000 {
        // In, and halfway out again.
        let (time_s, velocity_mps) = (f64::from(k) * 0.002, if k < 20_000 { 0.0026 } else { -0.005 });
        let position_m = if k < 20_000 { -0.005 + 0.0026 * time_s } else { 0.099 - 0.005 * (time_s - 40.0) };
        let mut c =
            StyletForce { total_n: 0.0, elastic_n: 0.0, friction_n: 0.0, tip_n: 0.0, active_layer: 0 };
        // SAFETY: a live tissue and a place for the force.
        let status = unsafe { stylet_tissue_step(tissue, time_s, position_m, velocity_mps, &mut c) };
        assert_eq!(status, StyletStatus::StyletOk);
        let f = law.step(&mut state, time_s, position_m, velocity_mps, |_| {});
        assert_eq!(
            [c.total_n, c.elastic_n, c.friction_n, c.tip_n].map(f64::to_bits),
            [f.total_n, f.elastic_n, f.friction_n, f.tip_n].map(f64::to_bits)
        );
        last = c.active_layer;
    }
    assert_eq!(last, 4, "all three layers are ruptured");
    // SAFETY: from `stylet_tissue_new`, freed once; null is ignored.
    unsafe {
        stylet_tissue_free(tissue);
        stylet_tissue_free(std::ptr::null_mut());
    }
}

#[test]
fn invalid_layers_are_refused_by_field() {
    let good = three_gels()[0];
    for (wrong, named) in [
        (StyletLayer { thickness_m: 0.0, ..good }, "thickness_m"),
        (StyletLayer { stiffness_n_per_m: f64::NAN, ..good }, "stiffness_n_per_m"),
        (StyletLayer { friction_ns_per_m2: -1.0, ..good }, "friction_ns_per_m2"),
        (StyletLayer { puncture_n: f64::INFINITY, ..good }, "puncture_n"),
    ] {
        let (status, tissue, why) = new(&[good, wrong], 0.0);
        assert_eq!(status, StyletStatus::StyletBadConfig);
        assert!(tissue.is_null() && why.starts_with(named), "{why}");
    }
    assert!(new(&[], 0.0).2.starts_with("count"));
    assert!(new(&[good], f64::NAN).2.starts_with("surface_m"));
    // SAFETY: null pointers are refused without being dereferenced.
    unsafe {
        let (null, mut out) = (std::ptr::null(), std::ptr::null_mut());
        assert_eq!(stylet_tissue_new(null, 1, 0.0, &mut out, std::ptr::null_mut()), StyletStatus::StyletNull);
        let step = stylet_tissue_step(std::ptr::null_mut(), 0.0, 0.0, 0.0, std::ptr::null_mut());
        assert_eq!(step, StyletStatus::StyletNull);
    }
}
