//! Simulator of tissue, needle and sensor, implemented from docs/reference/model.md; of this project it uses the recording
//! type only.
//!
//! | module | contents |
//! |---|---|
//! | [`tissue`] | layers with their true parameters |
//! | [`motion_path`] | motions of the needle's base, pieces with known borders |
//! | [`effect`] | effects, by id and parameter path |
//! | [`force_law`] | interface of a force law |
//! | [`plain_world`] | the base law with all effects, event by event |
//! | [`rich_world`] | a law of another form, which contains the base law |
//! | [`force_sensor`] | from the force at the needle's base to the recorded one |
//! | [`sensor_noise`] | noise of the sensor |
//! | [`insertion`] | one simulated insertion |

pub mod effect;
pub mod force_law;
pub mod force_sensor;
pub mod insertion;
pub mod motion_path;
pub mod plain_world;
pub mod rich_world;
pub mod sensor_noise;
pub mod tissue;
