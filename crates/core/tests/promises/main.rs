//! The promises of the online core, one file each; one program, because linking takes longer than testing.

mod blocks;
mod detection;
mod estimation;
mod not_a_rupture;
mod paper_stays_bit_for_bit;
mod robustness;
mod state_machine;
mod stylet_falls;
mod stylet_finds;
mod stylet_gaps;
mod stylet_holds;
mod stylet_intervals;
mod stylet_late_logs;
mod stylet_origins;
mod stylet_without_a_law;
mod support;
