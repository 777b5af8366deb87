//! Part of Stylet.
