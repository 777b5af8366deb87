//! What can be said before any fit: where faces may be, how large forces are.

use crate::run::Run;
use crate::shape::Frame;
use crate::stats::median;
use stylet_tissue::Tissue;

/// The frame of a believed tissue for these runs.
#[must_use]
pub fn frame(believed: &Tissue, runs: &[&Run]) -> Frame {
    let layers = believed.layers.len();
    let of = |what: &dyn Fn(&Run) -> Option<f64>| {
        let mut all: Vec<f64> = runs.iter().filter_map(|run| what(run)).collect();
        if all.is_empty() { None } else { Some(median(&mut all)) }
    };
    let contact = of(&|run| Some(run.contact_m)).unwrap_or(believed.surface_m);
    let deepest =
        of(&|run| run.recording.position_m.iter().copied().reduce(f64::max)).unwrap_or(contact + 0.01);
    let force_n =
        runs.iter().flat_map(|run| run.recording.force_n.iter()).fold(0.0_f64, |most, f| most.max(f.abs()));
    let mut fronts_m = Vec::with_capacity(layers);
    let mut loads = Vec::with_capacity(layers);
    for i in 0..layers {
        let front = if i == 0 {
            (contact - 4e-3, (contact + 3e-3).min(deepest - 1e-3), contact - 5e-4)
        } else {
            let release = of(&|run| run.releases_m[i]);
            let believed = believed.front_m(i) - believed.surface_m + contact;
            let (low, high, likely) = match release {
                Some(z) => (z - 5e-3, z + 2e-3, z - 5e-4),
                None => (believed - 6e-3, believed + 6e-3, believed),
            };
            let low = low.max(contact + 1e-3);
            (low, high.min(deepest - 1e-3).max(low + 1e-3), likely)
        };
        let rupture = of(&|run| run.ruptures[i].map(|at| run.recording.position_m[at]));
        let load = of(&|run| {
            let at = run.ruptures[i]?;
            let before = run.recording.force_n[at.saturating_sub(4)];
            Some(before)
        });
        let indentation = (rupture.unwrap_or(deepest) - front.2).max(2e-3);
        // Deeper layers share the force with friction of those before them.
        let share = if i == 0 { 1.0 } else { 0.7 };
        loads.push((share * load.unwrap_or(force_n), indentation));
        fronts_m.push(front);
    }
    let unseen = (0..layers).map(|i| runs.iter().any(|run| run.ruptures[i].is_none())).collect();
    let several_speeds = crate::gain::speeds(runs).len() > 1;
    Frame { believed: believed.clone(), fronts_m, loads, force_n, several_speeds, unseen }
}
