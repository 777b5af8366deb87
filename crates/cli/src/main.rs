//! The `stylet` binary.
fn main() {}
