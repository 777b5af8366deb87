//! Tests of the testbed, one file per promise; one program, because linking takes longer than testing.

mod arm_equals_rapier;
mod arm_follows_the_line;
mod arm_force_equals_replay;
mod common;
mod force_sensor;
mod measured_with_another_seed;
mod rapier_arm_equals_dynamics;
mod replay_equals_rapier;
mod virtual_sensor_measures_tissue_force;
