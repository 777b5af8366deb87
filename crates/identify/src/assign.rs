//! Which drop belongs to which layer: the cheapest assignment in the order of the layers.
//!
//! A layer is expected to give way where its force or its far face says, to within what is believed; where the force shows
//! no drop, the law's own place is taken at the price of the drop that should have been seen.

use crate::blocks::Blocks;
use crate::drops::Drop;
use crate::model::{Model, NEVER};

/// A drop that no layer takes costs this share of its nats, up to [`MOST`].
const SPARE_SHARE: f64 = 0.15;
/// Most nats that a drop without layer, or a layer without drop, may cost.
const MOST: f64 = 12.0;
/// Standard deviation of the logarithm of a drop's size.
const SIZE_SD: f64 = 0.6;
/// A layer that the needle has passed by so many standard deviations must have given way.
const PASSED_SD: f64 = 2.5;

/// What is expected of a layer.
#[derive(Clone, Copy, Debug)]
struct Expected {
    front_m: f64,
    place_m: f64,
    sd_m: f64,
    stiffness: f64,
}

/// Where layers are expected to give way; `trust` scales what is believed to be uncertain.
fn expected(model: &Model, trust: f64) -> Vec<Expected> {
    let b = &model.belief;
    let mut front = model.tissue.surface_m;
    let mut variance = (0.6 * b.surface_tolerance_m).powi(2);
    let mut out = Vec::new();
    for (l, layer) in model.tissue.layers.iter().enumerate() {
        let thickness_sd = 0.6 * b.thickness_tolerance[l] * layer.thickness_m;
        let by_face = front + layer.thickness_m;
        let face_sd = (variance + thickness_sd * thickness_sd).sqrt();
        let stretch = layer.puncture_n.map_or(f64::INFINITY, |f| f / layer.stiffness_n_per_m.max(1e-9));
        let stretch_sd = 0.85 * b.tolerance[l] * stretch;
        let (place_m, sd) = if front + stretch < by_face {
            (front + stretch, (variance + stretch_sd * stretch_sd).sqrt())
        } else if stretch.is_finite() {
            // Either may come first.
            (by_face, face_sd.hypot(0.3 * stretch_sd))
        } else {
            (by_face, face_sd)
        };
        out.push(Expected {
            front_m: front,
            place_m,
            sd_m: (trust * sd).hypot(2e-4 + 0.01 * layer.thickness_m),
            stiffness: layer.stiffness_n_per_m,
        });
        front = by_face;
        variance += thickness_sd * thickness_sd;
    }
    out
}

/// The instants (s) of all layers of one recording.
#[must_use]
pub fn assign(model: &Model, b: &Blocks, drops: &[Drop], trust: f64, noise_n: f64) -> Vec<f64> {
    let layers = expected(model, trust);
    let z: Vec<f64> = (0..b.len()).map(|k| b.motion.at(0.5 * (b.from_s[k] + b.to_s[k])).0).collect();
    let deepest = z.iter().fold(f64::NEG_INFINITY, |m, z| m.max(*z));
    let crossing =
        |place: f64| z.iter().position(|z| *z >= place).map_or(NEVER, |k| 0.5 * (b.from_s[k] + b.to_s[k]));
    // Candidates of every layer: instant and cost; taking a drop saves what it costs spare.
    let spare = |d: &Drop| (SPARE_SHARE * 0.5 * d.score * d.score).min(MOST);
    let candidates: Vec<Vec<(f64, f64)>> = layers
        .iter()
        .map(|l| {
            let mut c: Vec<(f64, f64)> = drops
                .iter()
                .filter(|d| d.position_m > l.front_m - 2.0 * l.sd_m)
                .map(|d| {
                    let off = (d.position_m - l.place_m) / l.sd_m;
                    let size = l.stiffness * (d.position_m - l.front_m).max(1e-4);
                    let ratio = libm::log(d.size_n.max(1e-6) / size.max(1e-6)) / SIZE_SD;
                    (d.time_s, 0.5 * off * off + (0.5 * ratio * ratio).min(4.0) - spare(d))
                })
                .collect();
            let seen = l.stiffness * (l.place_m - l.front_m) / noise_n.max(1e-9);
            if deepest >= l.place_m {
                c.push((crossing(l.place_m), (0.02 * seen * seen).min(MOST)));
            }
            let beyond = ((deepest - l.place_m) / l.sd_m - PASSED_SD).max(0.0);
            c.push((NEVER, 0.5 * beyond * beyond + if beyond > 0.0 { 2.0 } else { 0.0 }));
            c
        })
        .collect();
    // Cheapest chain of instants that never fall.
    let mut cost: Vec<Vec<(f64, usize)>> = Vec::new();
    for (l, own) in candidates.iter().enumerate() {
        let row = own
            .iter()
            .map(|(t, c)| {
                if l == 0 {
                    return (*c, 0);
                }
                let before = candidates[l - 1].iter().zip(&cost[l - 1]).enumerate();
                let allowed = before.filter(|(_, (p, _))| p.0 < *t || (p.0 == NEVER && *t == NEVER));
                allowed
                    .map(|(k, (_, best))| (best.0 + c, k))
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .unwrap_or((f64::INFINITY, 0))
            })
            .collect();
        cost.push(row);
    }
    let mut out = vec![NEVER; layers.len()];
    let mut at = cost
        .last()
        .map_or(0, |row| (0..row.len()).min_by(|a, b| row[*a].0.total_cmp(&row[*b].0)).unwrap_or(0));
    for l in (0..layers.len()).rev() {
        if !cost[l][at].0.is_finite() {
            break;
        }
        out[l] = candidates[l][at].0;
        at = cost[l][at].1;
    }
    out
}
