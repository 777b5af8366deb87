//! The law over a recording: with the ruptures that the data show, or with its own.

use crate::run::Columns;
use crate::shape::{Own, Shape};
use stylet_tissue::{Law, LawState};

/// Force of the law in N, ruptures taken where the data show them; layers that show none rupture by the
/// law. `at_rupture` takes per layer the elastic force in N at its rupture (zero: it did not).
///
/// False when the law cannot be built or its force is not finite.
pub fn imposed(
    shape: &Shape,
    x: &[f64],
    own: &Own,
    data: &Columns,
    force: &mut Vec<f64>,
    at_rupture: &mut Vec<f64>,
) -> bool {
    let (tissue, effects) = shape.tissue(x, own);
    let Ok(law) = Law::new(&tissue, &effects) else { return false };
    let mut state = LawState::default();
    let layers = data.ruptures.len();
    force.clear();
    at_rupture.clear();
    at_rupture.resize(layers, 0.0);
    let mut ruptured = 0;
    let mut yields = false;
    for i in 0..data.t.len() {
        while let Some(at) = data.ruptures.get(ruptured) {
            let now = match at {
                Some(at) => i >= *at,
                None => std::mem::take(&mut yields),
            };
            if !now {
                break;
            }
            ruptured += 1;
        }
        let f = law.step_imposed(&mut state, data.t[i], data.z[i], data.v[i], ruptured, |strain| {
            if strain.layer <= ruptured {
                at_rupture[strain.layer - 1] = strain.elastic_n;
            } else {
                yields = strain.breaks();
            }
        });
        force.push(f.total_n);
    }
    force.iter().all(|f| f.is_finite())
}

/// Force of the law in N with its own ruptures; false when the law cannot be built.
pub fn free(shape: &Shape, x: &[f64], own: &Own, data: &Columns, force: &mut Vec<f64>) -> bool {
    let (tissue, effects) = shape.tissue(x, own);
    let Ok(law) = Law::new(&tissue, &effects) else { return false };
    let mut state = LawState::default();
    force.clear();
    for i in 0..data.t.len() {
        force.push(law.step(&mut state, data.t[i], data.z[i], data.v[i], |_| {}).total_n);
    }
    force.iter().all(|f| f.is_finite())
}

/// Friction along the shaft in N as the law has it, with layers ruptured where `data` says (and nowhere else):
/// what a compensation may take from a measured force at every instant.
#[must_use]
pub fn friction(shape: &Shape, x: &[f64], own: &Own, data: &Columns) -> Option<Vec<f64>> {
    let (tissue, effects) = shape.tissue(x, own);
    let law = Law::new(&tissue, &effects).ok()?;
    let mut state = LawState::default();
    let mut out = Vec::with_capacity(data.t.len());
    for i in 0..data.t.len() {
        let ruptured = data.ruptures.iter().take_while(|at| at.is_some_and(|at| i >= at)).count();
        out.push(law.step_imposed(&mut state, data.t[i], data.z[i], data.v[i], ruptured, |_| {}).friction_n);
    }
    Some(out)
}
