//! The promises of the testbed, one file each; one program, because linking takes longer than testing.

mod arm_follows_the_line;
mod arm_force_equals_replay;
mod common;
mod rapier_arm_equals_dynamics;
mod remeasured;
mod replay_equals_rapier;
mod sensor;
mod virtual_sensor_feels_the_tissue;
