//! Text tables: encoding, layout, rows.

pub(crate) mod delimiter;
pub(crate) mod encoding;
pub(crate) mod find;
pub(crate) mod layout;
pub(crate) mod number;
mod ros;
pub(crate) mod rows;
pub(crate) mod source;
