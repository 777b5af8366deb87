//! The online core for C and C++ control loops.
//!
//! The caller provides the memory: [`stylet_size`] bytes, aligned to [`stylet_align`], hold the core and the samples of a layer.
//! The core allocates nothing, and panics do not unwind into C: a panic (a bug in this library) makes the call return `STYLET_INTERNAL`. A
//! core must not be used from two threads at once; separate cores are independent.
//!
//! `include/stylet.h` is generated from these files by cbindgen; `tests/header.rs` checks that it is up to date.

mod tissue;

use std::panic::{AssertUnwindSafe, catch_unwind};
use stylet_core::config::{Algorithm, Contact, EnhanceConfig, Model};
use stylet_core::{Enhancer, Output, Sample, UnusedReason};
pub use tissue::{
    StyletForce, StyletLayer, StyletTissue, stylet_tissue_free, stylet_tissue_new, stylet_tissue_step,
};

/// Status of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StyletStatus {
    /// Success.
    StyletOk = 0,
    /// The sample was ignored; `stylet_last_error` says why. The output repeats the last one.
    StyletUnused = 1,
    /// A pointer is null, or the memory is not aligned.
    StyletNull = -1,
    /// The memory is too small: `stylet_size(samples)` bytes are needed.
    StyletTooSmall = -2,
    /// A value of the configuration or of a layer is not finite or out of range; the message names it.
    StyletBadConfig = -3,
    /// Internal error; the core must not be used any more.
    StyletInternal = -4,
}

/// Algorithm.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StyletAlgorithm {
    /// The paper's.
    StyletPaper = 0,
    /// The paper's to the letter.
    StyletLiteral = 1,
    /// Kalman filters (default). Multi-layer model only: with the Kelvin-Voigt model the paper's algorithm runs.
    StyletStylet = 2,
}

/// Tissue model.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StyletModel {
    /// Friction proportional to the depth inside the layer.
    StyletMultiLayer = 0,
    /// A spring and a damper.
    StyletKelvinVoigt = 1,
}

/// State of the algorithm.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StyletState {
    /// Ordinary insertion.
    StyletNoRupture = 0,
    /// The force derivative has exceeded its threshold.
    StyletExpectedRupture = 1,
    /// A rupture has just been declared; lasts one sample.
    StyletDetectedRupture = 2,
    /// Waiting for the end of the drop.
    StyletForceDropMeasuring = 3,
    /// The traversed layer is re-estimated and its friction compensated.
    StyletForceCompensation = 4,
    /// `Stylet` only: the tip is in a gap or beyond the last layer, and no tissue acts on it.
    StyletFreeTip = 5,
}

/// Configuration. Fill it with `stylet_default_config`, then change fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StyletConfig {
    /// A `StyletAlgorithm`.
    pub algorithm: i32,
    /// A `StyletModel`.
    pub model: i32,
    /// Not zero: the surface is at `surface_m`. Zero: contact is detected in the force.
    pub contact_known: i32,
    /// Position of the surface in m, for `contact_known`.
    pub surface_m: f64,
    /// Accepted false alarms per hour of insertion, above 0. The fields below apply to the paper's algorithm.
    pub false_alarms_per_hour: f64,
    /// Forgetting factor of the recursive least squares, above 0 to 1.
    pub forgetting: f64,
    /// Prior variance of the stiffness (N/m)^2.
    pub prior_stiffness: f64,
    /// Prior variance of the friction, in the model's unit squared.
    pub prior_friction: f64,
    /// CUSUM: standard deviation of the error in ordinary insertion, N.
    pub cusum_sigma_ordinary_n: f64,
    /// CUSUM: standard deviation of the error at a rupture, N.
    pub cusum_sigma_rupture_n: f64,
    /// Force derivative that switches the expectation of a rupture on, N/s.
    pub derivative_on_n_per_s: f64,
    /// Force derivative that switches it off, N/s.
    pub derivative_off_n_per_s: f64,
}

/// Output of a step.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StyletOutput {
    /// Enhanced force in N: measured force less the friction of the passed layers.
    pub enhanced_n: f64,
    /// Lower end of the 95 % interval of the tip force in N; NaN where the algorithm provides none.
    pub low_n: f64,
    /// Upper end of that interval in N.
    pub high_n: f64,
    /// Force predicted before this sample's update, in N.
    pub reconstructed_n: f64,
    /// Innovation in N.
    pub error_n: f64,
    /// Stiffness estimate of the active layer in N/m.
    pub stiffness_n_per_m: f64,
    /// Friction estimate of the active layer: N s/m^2 (multi-layer), N s/m (Kelvin-Voigt).
    pub friction: f64,
    /// CUSUM in N^2; for `StyletStylet` the largest sum as a fraction of its threshold.
    pub cusum_n2: f64,
    /// Filtered force derivative in N/s; zero for `StyletStylet`.
    pub derivative_n_per_s: f64,
    /// Cumulative friction in N s/m.
    pub cumulative_friction_ns_per_m: f64,
    /// Position of the first contact in m; NaN before.
    pub contact_m: f64,
    /// A `StyletState`.
    pub state: i32,
    /// Ruptures declared so far.
    pub ruptures: u32,
    /// Not zero at the sample that declares a rupture.
    pub ruptured: i32,
    /// Layer whose estimate became available at this sample, from 1; otherwise zero.
    pub estimated_layer: u32,
    /// Thickness of that layer in m.
    pub layer_thickness_m: f64,
    /// Stiffness of that layer in N/m.
    pub layer_stiffness_n_per_m: f64,
    /// Friction of that layer in the model's unit.
    pub layer_friction: f64,
    /// Not zero when the algorithm was re-initialised before this sample because of a new clock.
    pub restarted: i32,
}

/// The core; it occupies `stylet_size` bytes.
pub struct StyletCore {
    inner: Enhancer<Storage>,
    error: &'static std::ffi::CStr,
}

/// The samples behind the core, in the caller's memory.
struct Storage {
    first: *mut Sample,
    count: usize,
}

impl AsRef<[Sample]> for Storage {
    fn as_ref(&self) -> &[Sample] {
        // SAFETY: `stylet_init` wrote `count` samples there, in memory that the caller provides for the lifetime of the core.
        unsafe { std::slice::from_raw_parts(self.first, self.count) }
    }
}

impl AsMut<[Sample]> for Storage {
    fn as_mut(&mut self) -> &mut [Sample] {
        // SAFETY: as above; only the core has this pointer.
        unsafe { std::slice::from_raw_parts_mut(self.first, self.count) }
    }
}

/// Offset of the samples, a multiple of both alignments.
const fn samples_at() -> usize {
    let align = align_of::<Sample>();
    size_of::<StyletCore>().div_ceil(align) * align
}

/// Bytes of a core that stores `samples` samples of a layer (16384: 80 s at 200 Hz).
#[unsafe(no_mangle)]
pub extern "C" fn stylet_size(samples: usize) -> usize {
    samples_at().saturating_add(samples.saturating_mul(size_of::<Sample>()))
}

/// Alignment of that memory in bytes, at most that of `malloc`.
#[unsafe(no_mangle)]
pub extern "C" fn stylet_align() -> usize {
    if align_of::<StyletCore>() > align_of::<Sample>() {
        align_of::<StyletCore>()
    } else {
        align_of::<Sample>()
    }
}

/// Version of the library, a static string.
#[unsafe(no_mangle)]
pub extern "C" fn stylet_version() -> *const std::ffi::c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Sets the default configuration, that of `stylet enhance`.
///
/// # Safety
/// `config` is null or points to a `StyletConfig`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stylet_default_config(config: *mut StyletConfig) -> StyletStatus {
    // SAFETY: guaranteed by the caller.
    let Some(config) = (unsafe { config.as_mut() }) else { return StyletStatus::StyletNull };
    let from = EnhanceConfig::default();
    *config = StyletConfig {
        algorithm: match from.algorithm {
            Algorithm::Paper => StyletAlgorithm::StyletPaper as i32,
            Algorithm::Literal => StyletAlgorithm::StyletLiteral as i32,
            Algorithm::Stylet => StyletAlgorithm::StyletStylet as i32,
        },
        model: match from.model {
            Model::MultiLayer => StyletModel::StyletMultiLayer as i32,
            Model::KelvinVoigt => StyletModel::StyletKelvinVoigt as i32,
        },
        contact_known: i32::from(from.contact == Contact::Known),
        surface_m: 0.0,
        false_alarms_per_hour: from.stylet.false_alarms_per_hour,
        forgetting: from.forgetting,
        prior_stiffness: from.prior_stiffness,
        prior_friction: from.prior_friction,
        cusum_sigma_ordinary_n: from.cusum.sigma_ordinary_n,
        cusum_sigma_rupture_n: from.cusum.sigma_rupture_n,
        derivative_on_n_per_s: from.derivative.on_n_per_s,
        derivative_off_n_per_s: from.derivative.off_n_per_s,
    };
    StyletStatus::StyletOk
}

/// Validates a configuration; the error names the field.
fn validate(config: &StyletConfig) -> Result<EnhanceConfig, &'static std::ffi::CStr> {
    let algorithm = match config.algorithm {
        a if a == StyletAlgorithm::StyletPaper as i32 => Algorithm::Paper,
        a if a == StyletAlgorithm::StyletLiteral as i32 => Algorithm::Literal,
        a if a == StyletAlgorithm::StyletStylet as i32 => Algorithm::Stylet,
        _ => return Err(c"algorithm: must be STYLET_PAPER, STYLET_LITERAL or STYLET_STYLET"),
    };
    let model = match config.model {
        m if m == StyletModel::StyletMultiLayer as i32 => Model::MultiLayer,
        m if m == StyletModel::StyletKelvinVoigt as i32 => Model::KelvinVoigt,
        _ => return Err(c"model: must be STYLET_MULTI_LAYER or STYLET_KELVIN_VOIGT"),
    };
    let positive = |x: f64| x > 0.0 && x.is_finite();
    if !config.surface_m.is_finite() {
        return Err(c"surface_m: must be finite");
    }
    if !positive(config.false_alarms_per_hour) {
        return Err(c"false_alarms_per_hour: must be positive and finite");
    }
    if !(positive(config.forgetting) && config.forgetting <= 1.0) {
        return Err(c"forgetting: must lie above 0 and be at most 1");
    }
    if !positive(config.prior_stiffness) {
        return Err(c"prior_stiffness: must be positive and finite");
    }
    if !positive(config.prior_friction) {
        return Err(c"prior_friction: must be positive and finite");
    }
    if !(positive(config.cusum_sigma_ordinary_n) && positive(config.cusum_sigma_rupture_n)) {
        return Err(c"cusum_sigma_ordinary_n, cusum_sigma_rupture_n: must be positive and finite");
    }
    if !(config.derivative_on_n_per_s.is_finite() && config.derivative_off_n_per_s.is_finite()) {
        return Err(c"derivative_on_n_per_s, derivative_off_n_per_s: must be finite");
    }
    let mut core = EnhanceConfig { algorithm, model, ..EnhanceConfig::default() };
    core.contact = if config.contact_known != 0 { Contact::Known } else { Contact::Detected };
    core.stylet.false_alarms_per_hour = config.false_alarms_per_hour;
    core.forgetting = config.forgetting;
    core.prior_stiffness = config.prior_stiffness;
    core.prior_friction = config.prior_friction;
    core.cusum.sigma_ordinary_n = config.cusum_sigma_ordinary_n;
    core.cusum.sigma_rupture_n = config.cusum_sigma_rupture_n;
    core.derivative.on_n_per_s = config.derivative_on_n_per_s;
    core.derivative.off_n_per_s = config.derivative_off_n_per_s;
    Ok(core)
}

/// Creates a core in the caller's `memory` of `bytes` bytes, which stores as many samples as fit behind it (at least one). `config`
/// may be null for the defaults. `*core` is the handle; it lives in the memory and needs no freeing. If `why` is not null, `*why` is
/// set to a static message, empty on success.
///
/// # Safety
/// `memory` is null or points to `bytes` bytes that are used by nothing else while the core lives; `config` is null or points to a
/// `StyletConfig`; `core` is null or points to a pointer; so does `why`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stylet_init(
    memory: *mut std::ffi::c_void,
    bytes: usize,
    config: *const StyletConfig,
    core: *mut *mut StyletCore,
    why: *mut *const std::ffi::c_char,
) -> StyletStatus {
    let report = |status: StyletStatus, text: &'static std::ffi::CStr| {
        // SAFETY: guaranteed by the caller.
        if let Some(why) = unsafe { why.as_mut() } {
            *why = text.as_ptr();
        }
        status
    };
    if memory.is_null() || core.is_null() {
        return report(StyletStatus::StyletNull, c"memory or core is null");
    }
    if !(memory as usize).is_multiple_of(stylet_align()) {
        return report(StyletStatus::StyletNull, c"memory is not aligned to stylet_align()");
    }
    if bytes < stylet_size(1) {
        return report(StyletStatus::StyletTooSmall, c"the memory is smaller than stylet_size(1)");
    }
    // SAFETY: guaranteed by the caller.
    let config = match unsafe { config.as_ref() } {
        None => Ok((EnhanceConfig::default(), 0.0)),
        Some(config) => validate(config).map(|valid| (valid, config.surface_m)),
    };
    let (config, surface_m) = match config {
        Ok(config) => config,
        Err(text) => return report(StyletStatus::StyletBadConfig, text),
    };
    let count = (bytes - samples_at()) / size_of::<Sample>();
    let made = catch_unwind(AssertUnwindSafe(|| {
        // SAFETY: aligned, and `samples_at() + count * size_of::<Sample>()` is at most `bytes`.
        unsafe {
            let first = memory.cast::<u8>().add(samples_at()).cast::<Sample>();
            for k in 0..count {
                first.add(k).write(Sample::default());
            }
            let place = memory.cast::<StyletCore>();
            let inner = Enhancer::new(config, surface_m, Storage { first, count });
            place.write(StyletCore { inner, error: c"" });
            *core = place;
        }
    }));
    match made {
        Ok(()) => report(StyletStatus::StyletOk, c""),
        Err(_) => report(StyletStatus::StyletInternal, c"internal error; please report it"),
    }
}

/// Processes one sample: time in s (increasing), tip position in m (positive into the tissue), tip velocity in m/s, axial force
/// in N (positive resisting insertion). `out` may be null.
///
/// # Safety
/// `core` is null or from `stylet_init`, and its memory is still valid; `out` is null or points to a `StyletOutput`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stylet_step(
    core: *mut StyletCore,
    time_s: f64,
    position_m: f64,
    velocity_mps: f64,
    force_n: f64,
    out: *mut StyletOutput,
) -> StyletStatus {
    // SAFETY: guaranteed by the caller.
    let Some(core) = (unsafe { core.as_mut() }) else { return StyletStatus::StyletNull };
    let sample = Sample { time_s, position_m, velocity_mps, force_n };
    let Ok(output) = catch_unwind(AssertUnwindSafe(|| core.inner.step(sample))) else {
        core.error = c"internal error; please report it";
        return StyletStatus::StyletInternal;
    };
    // SAFETY: guaranteed by the caller.
    if let Some(out) = unsafe { out.as_mut() } {
        *out = to_c_output(&output);
    }
    let Some(reason) = output.unused_reason else { return StyletStatus::StyletOk };
    core.error = match reason {
        UnusedReason::NotFinite => c"the sample was ignored: a value is not finite",
        UnusedReason::OutOfRange => c"the sample was ignored: position, velocity or force is out of range",
        UnusedReason::NotLater => {
            c"the sample was ignored: its time is not later than that of the last used sample"
        }
        UnusedReason::TimeJump => {
            c"the sample was ignored: its time jumped (an outlier, or the first samples of a new clock)"
        }
    };
    StyletStatus::StyletUnused
}

fn to_c_output(o: &Output) -> StyletOutput {
    let estimate = o.estimate.unwrap_or_default();
    let [low_n, high_n] = o.band_n.unwrap_or([f64::NAN; 2]);
    StyletOutput {
        enhanced_n: o.enhanced_n,
        low_n,
        high_n,
        reconstructed_n: o.reconstructed_n,
        error_n: o.error_n,
        stiffness_n_per_m: o.theta[0],
        friction: o.theta[1],
        cusum_n2: o.cusum_n2,
        derivative_n_per_s: o.derivative_n_per_s,
        cumulative_friction_ns_per_m: o.cumulative_friction_ns_per_m,
        contact_m: o.contact_m.unwrap_or(f64::NAN),
        state: o.state as i32,
        ruptures: o.ruptures as u32,
        ruptured: i32::from(o.detection.is_some()),
        estimated_layer: if o.estimate.is_some() { estimate.layer as u32 } else { 0 },
        layer_thickness_m: estimate.thickness_m,
        layer_stiffness_n_per_m: estimate.stiffness_n_per_m,
        layer_friction: estimate.friction,
        restarted: i32::from(o.restarted),
    }
}

/// Message of the last failed step, a static string; empty before.
///
/// # Safety
/// `core` is null or from `stylet_init`, and its memory is still valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stylet_last_error(core: *const StyletCore) -> *const std::ffi::c_char {
    // SAFETY: guaranteed by the caller.
    match unsafe { core.as_ref() } {
        Some(core) => core.error.as_ptr(),
        None => c"core is null".as_ptr(),
    }
}
