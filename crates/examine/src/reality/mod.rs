//! What was there and what was measured, written from the page (SPEC sections 2, 3 and 6) without any other crate of ours
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
pub mod insertion;
pub mod law;
pub mod motion;
pub mod noise;
pub mod plain;
pub mod rich;
pub mod sensor;
pub mod tissue;
