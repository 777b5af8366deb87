//! Inspection of a file: encoding, layout, columns, sampling, candidates for time, position and force, and a column map.
//!
//! [`inspect`] reads any file that the readers know, reports all obstacles at once, and proposes a
//! [`ColumnMap`](crate::ColumnMap). It uses the steps of the readers, but tolerates what they reject.
//!
//! ```
//! use std::path::Path;
//! use stylet_record::inspect::{InspectOptions, inspect_bytes};
//!
//! let text = b"Zeit;Weg;Kraft\ns;mm;N\n0,00;0,0;0,01\n0,01;0,1;0,02\n0,02;0,2;0,04\n";
//! let found = inspect_bytes(text, Path::new("machine.csv"), &InspectOptions::default())?;
//! assert_eq!(found.columns[1].unit.as_deref(), Some("mm"));
//! assert!(found.is_readable() && found.text.is_some_and(|text| text.decimal == ','));
//! # Ok::<(), stylet_record::RecordError>(())
//! ```

mod candidates;
mod facts;
mod findings;
pub mod magnitude;
mod model;
mod obstacles;
mod sampling;
mod scan;
mod source;

pub use crate::text::layout::ColumnKind;
pub use magnitude::{UnitProposal, propose_units};
pub use model::{
    Candidate, Curves, Finding, InspectOptions, InspectedColumn, Inspection, Role, Sampling, TextFacts,
};
pub use source::{inspect, inspect_bytes};
