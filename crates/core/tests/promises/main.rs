//! Tests of the online core, one file per promise, in one binary because linking takes longer than testing.

mod batch_processing;
mod paper_detection;
mod paper_estimation;
mod paper_false_ruptures;
mod paper_golden_hashes;
mod paper_robustness;
mod random_streams;
mod scale_invariance;
mod state_machine;
mod stylet_contact;
mod stylet_detection;
mod stylet_differentiated_velocity;
mod stylet_drops;
mod stylet_dry_friction;
mod stylet_free_tip;
mod stylet_intervals;
mod stylet_late_force;
mod stylet_numerical_validity;
mod stylet_offsets;
mod stylet_random_insertions;
mod stylet_relaxation;
mod stylet_stops;
mod stylet_zero_steps;
mod support;
mod time_jumps;
