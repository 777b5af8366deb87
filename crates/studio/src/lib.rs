#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod background_job;
mod column_assignment;
mod commands;
mod diagnosis_jobs;
mod dispatch;
mod http;
mod live_server;
mod messages;
mod online_algorithm;
mod page;
mod phantom;
mod phantom_view;
mod preview;
mod server;
mod sliders;
mod studio;
mod workspace;
mod workspace_results;

pub use live_server::LiveServer;
pub use messages::Problem;
pub use server::Server;
pub use studio::Studio;
