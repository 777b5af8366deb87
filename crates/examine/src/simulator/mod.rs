//! What was there and what was measured, written from the page (docs/reference/model.md) without any other crate of ours
//! but the recording's columns.
//!
//! | module | what lives there |
//! |---|---|
//! | [`tissue`] | layers with their true numbers |
//! | [`motion`] | paths of the needle's base, pieces with known borders |
//! | [`effect`] | the departures from the base law, by id and parameter path |
//! | [`law`] | what a law has to answer |
//! | [`plain`] | the base law with all departures, event by event |
//! | [`rich`] | a law of another form, of which the base law is the neutral case |
//! | [`sensor`] | from the force at the needle's base to the recorded one |
//! | [`noise`] | what the sensor adds |
//! | [`insertion`] | one needle going through all of it |

pub mod effect;
pub mod force_law;
pub mod force_sensor;
pub mod insertion;
pub mod motion_path;
pub mod plain_world;
pub mod rich_world;
pub mod sensor_noise;
pub mod tissue;
