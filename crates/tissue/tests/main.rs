//! Tests of the force laws and effects, one file per promise; one program, because linking takes longer than testing.

mod base_law;
mod common;
mod custom_effects;
mod effect_library;
mod elastic_and_rupture_effects;
mod friction_effects;
mod independent_simulator_agrees;
mod measurement_chain;
mod needle_compliance;
mod per_layer_effects;
mod shaft_slip;
