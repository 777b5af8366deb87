//! The force of layered tissue for simulators: base law of puncture and friction, without effects.

use crate::StyletStatus;
use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use stylet_tissue::{ForceLaw, ForceLawState, Layer, Tissue};

/// A layer of a tissue.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StyletLayer {
    /// Thickness in m, above 0.
    pub thickness_m: f64,
    /// Stiffness in N/m, zero or positive.
    pub stiffness_n_per_m: f64,
    /// Friction per metre of needle inside the layer in N s/m^2, zero or positive.
    pub friction_ns_per_m2: f64,
    /// Elastic force in N at which the layer ruptures; zero: it ruptures at its far face.
    pub puncture_n: f64,
}

/// Force of a tissue on the needle.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StyletForce {
    /// Force at the needle's base in N, positive when it resists the insertion.
    pub total_n: f64,
    /// Elastic force of the active layer in N.
    pub elastic_n: f64,
    /// Friction along the shaft in N.
    pub friction_n: f64,
    /// Force at the tip in N: `total_n` less the friction of the ruptured layers.
    pub tip_n: f64,
    /// Active layer, from 1; one more than the number of layers after the last rupture.
    pub active_layer: u32,
}

/// A tissue and which of its layers are ruptured; `stylet_tissue_new` allocates it.
pub struct StyletTissue {
    law: ForceLaw,
    state: ForceLawState,
}

fn to_layer(layer: &StyletLayer) -> Result<Layer, &'static CStr> {
    let not_negative = |x: f64| x >= 0.0 && x.is_finite();
    if !(not_negative(layer.thickness_m) && layer.thickness_m > 0.0) {
        return Err(c"thickness_m: must be positive and finite");
    }
    if !not_negative(layer.stiffness_n_per_m) {
        return Err(c"stiffness_n_per_m: must be zero or positive, and finite");
    }
    if !not_negative(layer.friction_ns_per_m2) {
        return Err(c"friction_ns_per_m2: must be zero or positive, and finite");
    }
    if !not_negative(layer.puncture_n) {
        return Err(c"puncture_n: must be zero (ruptures at the far face) or positive, and finite");
    }
    Ok(Layer {
        name: String::new(),
        thickness_m: layer.thickness_m,
        stiffness_n_per_m: layer.stiffness_n_per_m,
        friction_ns_per_m2: layer.friction_ns_per_m2,
        puncture_n: (layer.puncture_n > 0.0).then_some(layer.puncture_n),
    })
}

/// Creates a tissue of `count` layers, whose front face is at `surface_m`. `*tissue` is the handle, to be freed with
/// `stylet_tissue_free`. If `why` is not null, `*why` is set to a static message, empty on success.
///
/// # Safety
/// `layers` is null or points to `count` layers; `tissue` is null or points to a pointer; so does `why`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stylet_tissue_new(
    layers: *const StyletLayer,
    count: usize,
    surface_m: f64,
    tissue: *mut *mut StyletTissue,
    why: *mut *const c_char,
) -> StyletStatus {
    let report = |status: StyletStatus, text: &'static CStr| {
        // SAFETY: guaranteed by the caller.
        if let Some(why) = unsafe { why.as_mut() } {
            *why = text.as_ptr();
        }
        status
    };
    if layers.is_null() || tissue.is_null() {
        return report(StyletStatus::StyletNull, c"layers or tissue is null");
    }
    if count == 0 {
        return report(StyletStatus::StyletBadConfig, c"count: give at least one layer");
    }
    if !surface_m.is_finite() {
        return report(StyletStatus::StyletBadConfig, c"surface_m: must be finite");
    }
    // SAFETY: guaranteed by the caller.
    let given = unsafe { std::slice::from_raw_parts(layers, count) };
    let made = catch_unwind(|| {
        let layers = given.iter().map(to_layer).collect::<Result<_, _>>()?;
        let law = ForceLaw::base(&Tissue { surface_m, layers });
        Ok(Box::into_raw(Box::new(StyletTissue { law, state: ForceLawState::default() })))
    });
    match made {
        Ok(Ok(handle)) => {
            // SAFETY: not null; guaranteed by the caller.
            unsafe { *tissue = handle };
            report(StyletStatus::StyletOk, c"")
        }
        Ok(Err(text)) => report(StyletStatus::StyletBadConfig, text),
        Err(_) => report(StyletStatus::StyletInternal, c"internal error; please report it"),
    }
}

/// Force at a sample: time in s (not decreasing), tip position in m (positive into the tissue), tip velocity in m/s. A layer that has
/// ruptured stays ruptured. Allocates nothing. A sample that is not finite gives NaN and changes nothing.
///
/// # Safety
/// `tissue` is null or from `stylet_tissue_new` and not freed; `force` is null or points to a `StyletForce`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stylet_tissue_step(
    tissue: *mut StyletTissue,
    time_s: f64,
    position_m: f64,
    velocity_mps: f64,
    force: *mut StyletForce,
) -> StyletStatus {
    // SAFETY: guaranteed by the caller.
    let (Some(tissue), Some(force)) = (unsafe { tissue.as_mut() }, unsafe { force.as_mut() }) else {
        return StyletStatus::StyletNull;
    };
    let StyletTissue { law, state } = tissue;
    let stepped =
        catch_unwind(AssertUnwindSafe(|| law.step(state, time_s, position_m, velocity_mps, |_| {})));
    let Ok(f) = stepped else { return StyletStatus::StyletInternal };
    *force = StyletForce {
        total_n: f.total_n,
        elastic_n: f.elastic_n,
        friction_n: f.friction_n,
        tip_n: f.tip_n,
        active_layer: f.active_layer as u32,
    };
    StyletStatus::StyletOk
}

/// Frees a tissue; null is ignored.
///
/// # Safety
/// `tissue` is null or from `stylet_tissue_new` and not freed yet.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stylet_tissue_free(tissue: *mut StyletTissue) {
    if !tissue.is_null() {
        // SAFETY: from `Box::into_raw`; guaranteed by the caller.
        drop(unsafe { Box::from_raw(tissue) });
    }
}
