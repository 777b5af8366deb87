//! Numbers that another needle or another day may change, fitted to the new recordings while all others stand.

use crate::base::roughness;
use serde::{Deserialize, Serialize};
use stylet_identify::assign::assign_all;
use stylet_identify::drops::drops;
use stylet_identify::fit::{Effort, fit};
use stylet_identify::model::{Belief, Free, Model, Own};
use stylet_identify::objective::Data;
use stylet_identify::retime::retime;

/// A number that may be fitted again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Refit {
    /// The position of the surface.
    Surface,
    /// Friction: one factor for all layers.
    Friction,
}

/// How far the numbers that stand may move, relative: not at all, to what a fit resolves.
const PINNED: f64 = 1e-7;
/// Standard deviation of what a surface may be away before the recordings are seen, in m.
const WIDE_M: f64 = 5e-3;
/// The same of friction's logarithm.
const WIDE: f64 = 0.7;

/// What each recording says of the numbers that may be fitted again.
pub fn own(model: &Model, data: &Data, refit: &[Refit]) -> Option<Vec<Own>> {
    if refit.is_empty() {
        return Some(model.own.clone());
    }
    let layers = model.layers();
    let belief = Belief {
        tolerance: vec![PINNED; layers],
        thickness_tolerance: vec![0.0; layers],
        surface_tolerance_m: 0.0,
        ..Belief::clone(&model.belief)
    };
    let mut model = Model::base(belief.into(), data.recordings());
    model.free = Free {
        own_surface: refit.contains(&Refit::Surface),
        own_friction: refit.contains(&Refit::Friction),
        ..Free::default()
    };
    (model.scatter.surface_m, model.scatter.friction) = (WIDE_M, WIDE);
    let noise_n = roughness(&data.blocks);
    let found: Vec<_> = data.blocks.iter().map(drops).collect();
    model.instants = assign_all(&model, &data.blocks, &found, 0.5, noise_n);
    let times: Vec<Vec<f64>> = found.iter().map(|d| d.iter().map(|d| d.time_s).collect()).collect();
    let first = fit(&model, data, Effort { turns: 6, enough: 0.3 })?;
    let mut model = first.model;
    retime(&mut model, data, &times);
    Some(fit(&model, data, Effort::FULL)?.model.own)
}

/// What a recording is predicted by: the mean of what the others say; what it says itself if it is alone.
pub fn lent(own: &[Own], r: usize) -> Own {
    let others = own.iter().enumerate().filter(|(k, _)| own.len() == 1 || *k != r).map(|(_, o)| o);
    let (mut sum, mut n) = (Own::default(), 0.0);
    for o in others {
        sum.surface_m += o.surface_m;
        sum.friction += o.friction;
        n += 1.0;
    }
    Own {
        surface_m: sum.surface_m / f64::max(n, 1.0),
        friction: sum.friction / f64::max(n, 1.0),
        ..Own::default()
    }
}

#[cfg(test)]
mod tests {
    use super::lent;
    use stylet_identify::model::Own;

    #[test]
    fn a_recording_is_lent_the_mean_of_the_others_and_its_own_when_it_is_alone() {
        let own = |surface_m: f64, friction: f64| Own { surface_m, friction, differing: [3.0; 8] };
        let all = [own(1e-3, 0.2), own(4e-3, -0.5), own(-3e-4, 0.7)];
        let l = lent(&all, 1);
        assert!((l.surface_m - 3.5e-4).abs() < 1e-15 && (l.friction - 0.45).abs() < 1e-15);
        assert_eq!(l.differing, [0.0; 8]);
        let l = lent(&all[..2], 0);
        assert_eq!((l.surface_m, l.friction), (4e-3, -0.5));
        let l = lent(&all[..1], 0);
        assert_eq!((l.surface_m, l.friction), (1e-3, 0.2));
    }
}
