//! Promise: invalid arguments from C give a status and a message, not a crash.

use std::ffi::{CStr, c_char};
use stylet::{
    StyletConfig, StyletCore, StyletOutput, StyletStatus, stylet_align, stylet_default_config, stylet_init,
    stylet_last_error, stylet_size, stylet_step,
};

fn memory(samples: usize) -> Vec<u64> {
    vec![0; stylet_size(samples).div_ceil(8)]
}

fn init(memory: &mut [u64], bytes: usize, config: &StyletConfig) -> (StyletStatus, *mut StyletCore, String) {
    let (mut core, mut why): (_, *const c_char) = (std::ptr::null_mut(), c"".as_ptr());
    // SAFETY: all pointers are valid.
    let status = unsafe { stylet_init(memory.as_mut_ptr().cast(), bytes, config, &mut core, &mut why) };
    // SAFETY: messages of the library are static.
    (status, core, unsafe { CStr::from_ptr(why) }.to_string_lossy().into_owned())
}

fn default() -> StyletConfig {
    let mut config = std::mem::MaybeUninit::uninit();
    // SAFETY: a place for a configuration, which the call fills.
    unsafe {
        assert_eq!(stylet_default_config(config.as_mut_ptr()), StyletStatus::StyletOk);
        config.assume_init()
    }
}

#[test]
fn invalid_configurations_are_refused_by_field() {
    let mut room = memory(16);
    let bytes = stylet_size(16);
    for (wrong, named) in [
        (StyletConfig { algorithm: 9, ..default() }, "algorithm"),
        (StyletConfig { false_alarms_per_hour: 0.0, ..default() }, "false_alarms_per_hour"),
        (StyletConfig { model: 7, ..default() }, "model"),
        (StyletConfig { forgetting: 1.5, ..default() }, "forgetting"),
        (StyletConfig { surface_m: f64::NAN, ..default() }, "surface_m"),
        (StyletConfig { prior_friction: -1.0, ..default() }, "prior_friction"),
    ] {
        let (status, core, why) = init(&mut room, bytes, &wrong);
        assert_eq!(status, StyletStatus::StyletBadConfig);
        assert!(core.is_null() && why.starts_with(named), "{why}");
    }
}

#[test]
fn missing_small_or_misaligned_memory_is_refused() {
    let mut room = memory(16);
    let (status, _, why) = init(&mut room, stylet_size(1) - 1, &default());
    assert_eq!((status, why.contains("stylet_size")), (StyletStatus::StyletTooSmall, true));
    let mut core = std::ptr::null_mut();
    // SAFETY: invalid pointers are rejected without being dereferenced.
    unsafe {
        let null = std::ptr::null_mut();
        assert_eq!(
            stylet_init(null, 9999, &default(), &mut core, std::ptr::null_mut()),
            StyletStatus::StyletNull
        );
        let misaligned = room.as_mut_ptr().cast::<u8>().add(1).cast();
        assert_eq!(
            stylet_init(misaligned, 9999, &default(), &mut core, std::ptr::null_mut()),
            StyletStatus::StyletNull
        );
        assert_eq!(
            stylet_step(std::ptr::null_mut(), 0.0, 0.0, 0.0, 0.0, std::ptr::null_mut()),
            StyletStatus::StyletNull
        );
    }
    assert!(stylet_align() <= 16, "memory from malloc is aligned");
}

#[test]
fn an_invalid_sample_is_ignored_and_reported() {
    let mut room = memory(64);
    let (status, core, _) = init(&mut room, stylet_size(64), &default());
    assert_eq!(status, StyletStatus::StyletOk);
    let mut out = std::mem::MaybeUninit::<StyletOutput>::zeroed();
    // SAFETY: a valid core and a valid output.
    unsafe {
        assert_eq!(stylet_step(core, 0.0, -0.005, 0.002, 0.01, out.as_mut_ptr()), StyletStatus::StyletOk);
        for bad in [f64::NAN, f64::INFINITY, 1e9] {
            assert_eq!(stylet_step(core, 0.1, bad, 0.002, 0.0, out.as_mut_ptr()), StyletStatus::StyletUnused);
        }
        assert_eq!(stylet_step(core, -1.0, 0.0, 0.002, 0.0, out.as_mut_ptr()), StyletStatus::StyletUnused);
        assert!(CStr::from_ptr(stylet_last_error(core)).to_string_lossy().contains("ignored"));
        assert!(out.assume_init().enhanced_n.is_finite());
    }
}
