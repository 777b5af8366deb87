//! Bounded, damped least squares of all numbers of a model, the instants of its ruptures included.
//!
//! | module | what |
//! |---|---|
//! | `column`, `tangent` | how the residuals change with every number; the linear picture of a model |
//! | `step` | one damped step within bounds, and how far along it |
//! | `kinks` | a fit that a kink of the law does not end |
//! | `spread` | how much recordings differ, as a fit tells it |

mod column;
mod kinks;
mod spread;
mod step;
mod tangent;
#[cfg(test)]
mod tests;

pub use column::Column;
pub use kinks::fit_past_kinks;
pub use tangent::Tangent;

use crate::model::Model;
use crate::objective::{Data, Residuals, residuals};
use spread::rescatter;
use step::{clamp, further, moved, step};

/// A fitted model.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// What it leaves.
    pub residuals: Residuals,
}

impl Fit {
    /// Nats, with the noise of the data as it is.
    #[must_use]
    pub fn nats(&self) -> f64 {
        self.residuals.nats
    }

    /// Root mean square in N of what is left at the blocks that are compared.
    #[must_use]
    pub fn rms_n(&self, data: &Data) -> f64 {
        let (mut sum, mut n) = (0.0, 0.0);
        for (b, e) in data.blocks.iter().zip(&self.residuals.e) {
            for k in (0..b.len()).filter(|k| b.used[*k]) {
                sum += e[k] * e[k];
                n += 1.0;
            }
        }
        (sum / f64::max(n, 1.0)).sqrt()
    }
}

/// How long a fit goes on.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Steps at most.
    pub turns: usize,
    /// It ends when a step gains less than so many nats.
    pub enough: f64,
}

impl Effort {
    /// A short one, to rank.
    pub const SHORT: Self = Self { turns: 3, enough: 0.3 };
    /// To the end.
    pub const FULL: Self = Self { turns: 14, enough: 0.03 };
}

/// Damping of the first step, and steps that are tried from a tangent.
const FIRST_DAMPING: f64 = 1e-4;
const TRIES: usize = 7;

/// Fits a model from where it stands.
#[must_use]
pub fn fit(model: &Model, data: &Data, effort: Effort) -> Option<Fit> {
    fit_below(model, data, effort, f64::INFINITY)
}

/// As [`fit`], but given up where it would not come below `wanted` nats if every step left gained as much as the last.
#[must_use]
pub fn fit_below(model: &Model, data: &Data, effort: Effort, wanted: f64) -> Option<Fit> {
    descend(model, data, effort, wanted, rescatter)
}

/// As [`fit`]; where ruptures scatter, also from numbers under which they do not. Under a wide scatter what is a little off
/// costs nothing, and stays.
#[must_use]
pub fn fit_sharp(model: &Model, data: &Data, effort: Effort) -> Option<Fit> {
    let wide = fit(model, data, effort)?;
    let mut none = wide.model.clone();
    (none.scatter.force, none.scatter.place_m) = (0.0, 0.0);
    if none.scatter == wide.model.scatter {
        return Some(wide);
    }
    let held = Effort { turns: 2, ..effort };
    let sharp =
        descend(&none, data, held, f64::INFINITY, |_, _| ()).and_then(|f| fit(&f.model, data, effort));
    Some(sharp.filter(|f| f.nats() < wide.nats()).unwrap_or(wide))
}

/// Steps downhill; after each the scatter is told by `scatter`.
fn descend(
    model: &Model,
    data: &Data,
    effort: Effort,
    wanted: f64,
    scatter: impl Fn(&mut Model, &mut Residuals),
) -> Option<Fit> {
    let mut best = model.clone();
    clamp(&mut best);
    let mut at = residuals(&best, data)?;
    scatter(&mut best, &mut at);
    let mut damping = FIRST_DAMPING;
    for turn in 1..=effort.turns {
        let tangent = Tangent::new(&best, data, &at);
        let before = at.nats;
        let mut gained = false;
        for _ in 0..TRIES {
            let Some(delta) = step(&best, data, &tangent, damping, |_| true) else { break };
            let next = moved(&best, data, &tangent, &delta, 1.0);
            let Some(left) = residuals(&next, data) else {
                damping *= 10.0;
                continue;
            };
            if left.nats < at.nats {
                let further = further(&tangent, &delta, at.nats - left.nats)
                    .map(|share| moved(&best, data, &tangent, &delta, share))
                    .and_then(|next| residuals(&next, data).map(|left| (next, left)))
                    .filter(|(_, f)| f.nats < left.nats);
                (best, at) = further.unwrap_or((next, left));
                scatter(&mut best, &mut at);
                damping = (damping * 0.1).max(1e-9);
                gained = true;
                break;
            }
            damping = (damping * 8.0).max(1e-6);
        }
        let gain = before - at.nats;
        let reach = at.nats - gain * (effort.turns - turn) as f64;
        if !gained || gain < effort.enough || (turn > 1 && reach > wanted) {
            break;
        }
    }
    Some(Fit { model: best, residuals: at })
}
