//! The cases: assumed scenario, true tissue, and the misspecification between them.

pub mod case_definition;
pub mod case_id;
pub mod case_recordings;
pub mod case_setup;
pub mod custom_effect;
pub mod distinguishable_effects;
pub mod draw_effect;
pub mod draw_motion;
pub mod draw_tissue;
pub mod effect_strength;
pub mod hide_effects;
pub mod misspecification_amounts;
pub mod rich_world_effects;
pub mod second_insertion;
pub mod unmodelled_shapes;
