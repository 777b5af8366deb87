//! The online core: needle-tissue identification and force enhancement.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod config;
mod rls;

pub use config::EnhanceConfig;
pub use rls::Rls;
