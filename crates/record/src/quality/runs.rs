//! Stretches in which the force stays at one value.

use crate::along::{Along, Quantity};

/// Neighbouring samples with the same force.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub force_n: f64,
    pub samples: usize,
    pub start_s: f64,
    /// Smallest and largest position.
    pub between_m: (f64, f64),
}

/// Hands over all stretches of equal force, however short.
pub(super) fn runs<A: Along>(recording: &A, mut each: impl FnMut(&Run)) -> Result<(), A::Error> {
    let mut now: Option<Run> = None;
    recording.blocks(
        [Quantity::Time, Quantity::Position, Quantity::Force],
        |[time_s, position_m, force_n]| {
            for ((&time_s, &position_m), &force_n) in time_s.iter().zip(position_m).zip(force_n) {
                match &mut now {
                    Some(run) if run.force_n == force_n => {
                        run.samples += 1;
                        run.between_m = (run.between_m.0.min(position_m), run.between_m.1.max(position_m));
                    }
                    _ => {
                        let new =
                            Run { force_n, samples: 1, start_s: time_s, between_m: (position_m, position_m) };
                        if let Some(run) = now.replace(new) {
                            each(&run);
                        }
                    }
                }
            }
        },
    )?;
    if let Some(run) = now {
        each(&run);
    }
    Ok(())
}
