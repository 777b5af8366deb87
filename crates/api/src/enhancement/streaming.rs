//! A recording of any length, heard in little memory: sample by sample from disk through the core into the folder of the results.

use super::enhanced_csv::{enhanced_values, header};
use super::plot_samples::PlotSampler;
use super::{AppliedModel, EnhancementResult, RecordingExtent, Table};
use crate::enhance::empty_run;
use crate::error::Error;
use crate::identified_model::IdentifiedModel;
use crate::output_folder::OutputLock;
use crate::result_hash::{self, ResultHash, hashed_values};
use std::io::{self, Write};
use stylet_core::config::Model;
use stylet_core::{Output, Sample};
use stylet_record::csv_writer::RowWriter;
use stylet_record::disk_table::DiskTableWriter;
use stylet_record::{LongRecording, QualityNote, Recording};
use stylet_scenario::EnhancerConfigFile;
use stylet_score::{EnhancerWithModel, enhancer_for};

/// As [`hear`](super::hear) for a recording on disk: files, hash and findings have the same bytes, but for the report of a recording of
/// over 20 000 samples, which shows a selection. `enhanced.csv` goes into the claimed folder at once, as part of a set that is
/// announced when its other files are written.
///
/// # Errors
/// [`Error::Output`] when the folder does not take the results, [`Error::Recording`] when the samples cannot be read again.
pub fn enhance_long_recording(
    recording: &LongRecording,
    notes: Vec<QualityNote>,
    config: EnhancerConfigFile,
    models: &[Model],
    law: Option<&IdentifiedModel>,
    claim: &OutputLock,
) -> Result<EnhancementResult, Error> {
    let out_of = |why: io::Error| Error::output(claim.folder(), why);
    let samples = recording.len();
    let mut ran: Vec<_> = models.iter().map(|&model| empty_run(&config, model)).collect();
    let sample_hz = recording.sample_hz()?;
    let mut hearings: Vec<EnhancerWithModel<_>> = ran
        .iter()
        .map(|r| {
            let shaft = law.map(|law| law.shaft_friction(sample_hz));
            let law = shaft.map(|mut shaft| {
                move |s: &Sample, ruptured| shaft.step(s.time_s, s.position_m, s.velocity_mps, ruptured)
            });
            EnhancerWithModel::new(enhancer_for(samples, &r.config, config.surface_m), law)
        })
        .collect();
    let both = Both { part: claim.stage_file("enhanced.csv")?, hash: ResultHash::default() };
    let mut table = RowWriter::new(&header(recording.column_names()), both).map_err(out_of)?;
    // The hash wants one column after the other.
    let mut columns =
        DiskTableWriter::new(claim.folder(), models.len() * result_hash::HASHED_COLUMNS).map_err(out_of)?;
    let mut picture = PlotSampler::new(samples, models.len());
    let mut outs = vec![Output::default(); models.len()];
    let (mut index, mut hashed_row) = (0, Vec::new());
    recording.for_each_sample(|s, row| -> Result<(), Error> {
        let sample = Sample {
            time_s: s.time_s,
            position_m: s.position_m,
            velocity_mps: s.velocity_mps,
            force_n: s.force_n,
        };
        hashed_row.clear();
        for ((hearing, out), ran) in hearings.iter_mut().zip(&mut outs).zip(&mut ran) {
            *out = hearing.step(sample);
            ran.trace.record_events(out);
            hashed_row.extend(hashed_values(out));
        }
        if let Some(first) = outs.first() {
            table.write_row(row, &enhanced_values(first), first.state.name()).map_err(out_of)?;
        }
        columns.push(&hashed_row).map_err(out_of)?;
        picture.add(index, &s, &outs);
        index += 1;
        Ok(())
    })?;
    drop(hearings);
    let Both { part, mut hash } = table.finish().map_err(out_of)?;
    let columns = columns.finish().map_err(out_of)?;
    let (mut piece, mut bytes) = (Vec::new(), Vec::new());
    for column in 0..columns.columns() {
        for block in 0..columns.block_count() {
            columns.read_block(block, column, &mut piece, &mut bytes).map_err(out_of)?;
            hash.update_column(&piece);
        }
    }
    let mut shown = Recording { velocity_measured: true, ..Recording::default() };
    for moment in picture.finish() {
        shown.time_s.push(moment.sample.time_s);
        shown.position_m.push(moment.sample.position_m);
        shown.velocity_mps.push(moment.sample.velocity_mps);
        shown.force_n.push(moment.sample.force_n);
        ran.iter_mut().zip(&moment.outs).for_each(|(ran, out)| ran.trace.push(out));
    }
    for ran in &mut ran {
        if let Some(contact_m) = ran.trace.contact_m {
            ran.trace.contact_s = recording.first_time_beyond_s(contact_m)?;
        }
    }
    let extent = RecordingExtent { samples, duration_s: recording.duration_s()?, sample_hz };
    let table = Table::There(part.finish()?);
    let law = law.map(|law| AppliedModel::new(law, &ran));
    Ok(EnhancementResult {
        recording: shown,
        extent,
        notes,
        algorithm_runs: ran,
        hash: hash.finish(),
        config,
        model: law,
        table,
    })
}

/// The table's bytes go into the file and into the hash of the results.
struct Both<W> {
    part: W,
    hash: ResultHash,
}

impl<W: Write> Write for Both<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.part.write(bytes)?;
        self.hash.update_text(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.part.flush()
    }
}
