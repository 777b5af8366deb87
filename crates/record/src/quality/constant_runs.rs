//! Runs of samples with a constant force.

use crate::sample_stream::{Quantity, SampleStream};

/// Consecutive samples with the same force.
#[derive(Clone, Copy, Debug)]
pub(super) struct ConstantForceRun {
    pub force_n: f64,
    pub samples: usize,
    pub start_s: f64,
    /// Smallest and largest position.
    pub position_range_m: (f64, f64),
}

/// Calls `each` with every run, including those of one sample.
pub(super) fn for_each_constant_run<A: SampleStream>(
    recording: &A,
    mut each: impl FnMut(&ConstantForceRun),
) -> Result<(), A::Error> {
    let mut now: Option<ConstantForceRun> = None;
    recording.for_each_block(
        [Quantity::Time, Quantity::Position, Quantity::Force],
        |[time_s, position_m, force_n]| {
            for ((&time_s, &position_m), &force_n) in time_s.iter().zip(position_m).zip(force_n) {
                match &mut now {
                    Some(run) if run.force_n == force_n => {
                        run.samples += 1;
                        run.position_range_m =
                            (run.position_range_m.0.min(position_m), run.position_range_m.1.max(position_m));
                    }
                    _ => {
                        let new = ConstantForceRun {
                            force_n,
                            samples: 1,
                            start_s: time_s,
                            position_range_m: (position_m, position_m),
                        };
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
