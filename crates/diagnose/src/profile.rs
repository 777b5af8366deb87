//! Numbers that the instants of ruptures follow: a lag that is a little longer with ruptures a little earlier
//! fits nearly as well, so that the curvature with the instants held promises too much. Such a number is
//! sought, and its uncertainty told, along the profile: the objective with everything else fitted anew.

use crate::model::{Choice, Role};
use crate::refine::{covariance_diagonal, refine};
use crate::search::{Candidate, Search};

/// Effects with such a number, their first.
const COUPLED: [&str; 4] = ["low_pass_lag", "time_delay", "soft_boundary", "needle_compliance"];
/// Steps along the profile at most.
const STEPS: usize = 8;
/// Nats that the neighbours must rise for their parabola to be trusted, and may at most.
const RISE: [f64; 2] = [0.5, 12.0];

/// Whether an effect has such a number.
#[must_use]
pub fn is_coupled(choice: &Choice) -> bool {
    COUPLED.contains(&choice.info.id)
}

/// The candidate at the lowest point of the profile of each such number, and their standard deviations (a
/// logarithm's where the number is fitted in its logarithm).
#[must_use]
pub fn settled(search: &Search, best: &Candidate) -> (Candidate, Vec<(Role, f64)>) {
    let mut best = best.clone();
    let mut told = Vec::new();
    for effect in 0..best.model.effects.len() {
        if is_coupled(&best.model.effects[effect]) {
            let role = Role::Effect { effect, parameter: 0 };
            if let Some(sd) = along(search, &mut best, role) {
                told.push((role, sd.hypot(clock(search, &best.model.effects[effect]))));
            }
        }
    }
    (best, told)
}

/// Share of a sampling interval to which a recording's clock is believed: what was measured, stepped and filtered
/// faster than it was recorded has steps of its own. (Drawn cases step five times as fast; intervals of lags held
/// the truth in 15 of 34 without it: `docs/diagnosis.md`.)
const CLOCK: f64 = 0.02;

/// Standard deviation of the logarithm of a time by the recording's clock.
fn clock(search: &Search, choice: &Choice) -> f64 {
    let Some(track) = search.data.tracks.first() else { return 0.0 };
    match (choice.info.id, choice.values.first()) {
        ("low_pass_lag" | "time_delay", Some(&time_s)) if time_s > 0.0 => CLOCK / (track.sample_hz * time_s),
        _ => 0.0,
    }
}

/// Walks down the profile of one number; its standard deviation by the parabola at the bottom.
fn along(search: &Search, best: &mut Candidate, role: Role) -> Option<f64> {
    let spread = covariance_diagonal(&best.model, &search.data_of(best))?;
    let (_, mut x, sd) = *spread.iter().find(|s| s.0 == role)?;
    let mut h = if sd.is_finite() { 2.0 * sd.max(1e-5) } else { 1e-2 };
    let mut centre = at(search, best, role, x)?;
    for _ in 0..STEPS {
        let (low, high) =
            rayon::join(|| at(search, &centre, role, x - h), || at(search, &centre, role, x + h));
        let (low, high) = (low?, high?);
        let (fall, rise) = (low.nats - centre.nats, high.nats - centre.nats);
        if fall.min(rise) < 0.0 {
            let down = if fall < rise { -h } else { h };
            centre = if fall < rise { low } else { high };
            x += down;
            h *= if fall.max(rise) > RISE[1] { 1.0 } else { 1.6 };
            continue;
        }
        if fall.max(rise) < RISE[0] {
            h *= 2.0;
            continue;
        }
        if fall.min(rise) > RISE[1] {
            h *= 0.5;
            continue;
        }
        let bottom = x + 0.5 * h * (fall - rise) / (fall + rise);
        let lowest = at(search, &centre, role, bottom).filter(|c| c.nats < centre.nats).unwrap_or(centre);
        if lowest.nats < best.nats {
            *best = lowest;
        }
        return Some(h / (fall + rise).sqrt());
    }
    if centre.nats < best.nats {
        *best = centre;
    }
    None
}

/// Everything else fitted with a number held.
fn at(search: &Search, from: &Candidate, role: Role, x: f64) -> Option<Candidate> {
    let mut model = from.model.clone();
    let slots = model.slots();
    let mut p = model.vector(&slots);
    p[slots.iter().position(|s| s.role == role)?] = x;
    model.set(&slots, &p);
    model.held = Some(role);
    let mut there = search.data_of(from);
    let mut fitted = refine(&model, &mut there, 2, 4, false)?;
    fitted.model.held = None;
    Some(Candidate { model: fitted.model, ruptures: there.ruptures, nats: fitted.nats })
}

#[cfg(test)]
mod tests {
    use super::settled;
    use crate::hidden::{self, Kind};
    use crate::refine::{covariance_diagonal, refine};
    use crate::search::{Candidate, Search, Settings, choice, nats};
    use crate::track::Track;
    use stylet_tissue::LowPassLag;

    /// From a fitted lag moved off by half a per cent the bottom of the profile is found again, with an interval as wide
    /// as that with the instants held at least.
    #[test]
    fn the_bottom_of_the_profile_is_the_lag_that_was_hidden() {
        const TRUTH_S: f64 = 0.05;
        let mut drawn = hidden::sketch_of(5, 2, Kind::Clean, 2).drawn;
        drawn.effects.push(LowPassLag { time_constant_s: TRUTH_S }.into());
        let case = hidden::case(&drawn);
        let tracks: Vec<Track> = case.recordings.iter().map(|r| Track::new(r, &[])).collect();
        let search = Search::base(&case.believed.tissue, 0.3, &[], tracks, 0.0, Settings::default())
            .expect("base fit");
        let lag = choice("low_pass_lag", &[0.9 * TRUTH_S]).expect("in the library");
        let mut there = search.data_of(&search.base);
        let mut model = refine(&search.base.model.with(lag), &mut there, 3, 8, true).expect("a fit").model;
        model.effects[0].values[0] *= 1.005;
        let begun = Candidate { nats: nats(&model, &there), model, ruptures: there.ruptures };
        let (found, told) = settled(&search, &begun);
        let value = found.model.effects[0].values[0];
        assert!((value / TRUTH_S - 1.0).abs() < 0.004 && found.nats < begun.nats, "{value}");
        assert_eq!(told.len(), 1, "one number: {told:?}");
        let (role, sd) = told[0];
        let held = covariance_diagonal(&found.model, &search.data_of(&found)).expect("a curvature");
        let held = held.iter().find(|h| h.0 == role).expect("its number").2;
        assert!(sd > 0.8 * held && sd < 0.02, "{sd} against {held}");
    }
}
