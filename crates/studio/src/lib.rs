#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod commands;
mod dispatch;
mod explain;
mod http;
mod job;
mod live;
mod look;
mod messages;
mod open;
mod page;
mod phantom;
mod phantom_view;
mod preview;
mod results;
mod server;
mod sliders;
mod studio;
mod workspace;

pub use live::LiveServer;
pub use messages::Problem;
pub use server::Server;
pub use studio::Studio;
