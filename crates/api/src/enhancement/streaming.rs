//! Enhancement of a recording of any length in bounded memory: sample by sample from disk through the core into the output
//! folder.

use super::enhanced_csv::{enhanced_values, header, state_word};
use super::identified_model::IdentifiedModel;
use super::plot_samples::PlotSampler;
use super::result::{AppliedModel, EnhancedTable, EnhancementResult, RecordingExtent};
use super::whole_recording::empty_run;
use crate::error::Error;
use crate::output_folder::{OutputLock, StagedFileWriter};
use crate::result_hash::{self, ResultHash, hashed_values};
use crate::run_report::AlgorithmRun;
use std::io::{self, Write};
use stylet_core::config::{Contact, Model};
use stylet_core::{Output, Sample};
use stylet_record::csv_writer::RowWriter;
use stylet_record::disk_table::DiskTableWriter;
use stylet_record::{LongRecording, QualityNote, Recording};
use stylet_scenario::EnhancerConfigFile;
use stylet_score::{ContactAssessor, ContactFinding, EnhancerWithModel, RecordingScale, enhancer_in_units};

/// As [`enhance_recording`](super::enhance_recording) for a recording on disk: files and hash are bitwise the same, except the
/// report of a recording of over 20 000 samples, which shows a selection. `enhanced.csv` is written to the locked folder at once,
/// as part of a set that is completed by the other files.
///
/// # Errors
/// [`Error::Output`] when the folder cannot be written, [`Error::Recording`] when the samples cannot be read again.
pub fn enhance_long_recording(
    recording: &LongRecording,
    notes: Vec<QualityNote>,
    config: EnhancerConfigFile,
    regressors: &[Model],
    model: Option<&IdentifiedModel>,
    lock: &OutputLock,
) -> Result<EnhancementResult, Error> {
    let failed = |why: io::Error| Error::output(lock.folder(), why);
    let mut scale = RecordingScale::default();
    recording.for_each_sample(|s, _| -> Result<(), Error> {
        scale.push(s.position_m, s.force_n);
        Ok(())
    })?;
    let new_runs = || regressors.iter().map(|&regressor| empty_run(&config, regressor)).collect();
    let surface_m = config.surface_m;
    let mut pass = Pass::run(recording, new_runs(), surface_m, &scale, model, lock)?;
    if pass.runs.iter().any(|run| run.trace.contact.is_loaded_unexpectedly()) {
        // As in memory: those runs are repeated without a contact.
        let findings: Vec<ContactFinding> = pass.runs.into_iter().map(|run| run.trace.contact).collect();
        drop((pass.table, pass.columns));
        let mut runs: Vec<AlgorithmRun> = new_runs();
        for (run, _) in runs.iter_mut().zip(&findings).filter(|(_, f)| f.is_loaded_unexpectedly()) {
            run.config.contact = Contact::None;
        }
        pass = Pass::run(recording, runs, surface_m, &scale, model, lock)?;
        for (run, found) in pass.runs.iter_mut().zip(&findings).filter(|(_, f)| f.is_loaded_unexpectedly()) {
            run.trace.contact = found.without_contact();
        }
    }
    let Pass { mut runs, table, columns, plot } = pass;
    let samples = recording.len();
    let HashingWriter { file, mut hash } = table.finish().map_err(failed)?;
    let columns = columns.finish().map_err(failed)?;
    let (mut piece, mut bytes) = (Vec::new(), Vec::new());
    for column in 0..columns.columns() {
        for block in 0..columns.block_count() {
            columns.read_block(block, column, &mut piece, &mut bytes).map_err(failed)?;
            hash.update_column(&piece);
        }
    }
    let mut shown = Recording { velocity_measured: true, ..Recording::default() };
    for selected in plot.finish() {
        shown.time_s.push(selected.sample.time_s);
        shown.position_m.push(selected.sample.position_m);
        shown.velocity_mps.push(selected.sample.velocity_mps);
        shown.force_n.push(selected.sample.force_n);
        runs.iter_mut().zip(&selected.outs).for_each(|(run, out)| run.trace.push(out));
    }
    for run in &mut runs {
        if let Some(contact_m) = run.trace.contact_m {
            let first = run.trace.recorded_before_restart;
            run.trace.contact_s = recording.first_time_beyond_s(first, contact_m)?;
        }
    }
    let duration_s = recording.duration_s()?;
    let mean_hz = samples.saturating_sub(1) as f64 / duration_s;
    let extent = RecordingExtent { samples, duration_s, sample_hz: mean_hz };
    let table = EnhancedTable::Staged(file.finish()?);
    let model = model.map(|model| AppliedModel::new(model, &runs));
    Ok(EnhancementResult {
        recording: shown,
        extent,
        notes,
        algorithm_runs: runs,
        hash: hash.finish(),
        config,
        model,
        table,
    })
}

/// One pass of the core over a recording.
struct Pass {
    runs: Vec<AlgorithmRun>,
    table: RowWriter<HashingWriter<StagedFileWriter>>,
    columns: DiskTableWriter,
    plot: PlotSampler,
}

impl Pass {
    fn run(
        recording: &LongRecording,
        mut runs: Vec<AlgorithmRun>,
        surface_m: f64,
        scale: &RecordingScale,
        model: Option<&IdentifiedModel>,
        lock: &OutputLock,
    ) -> Result<Self, Error> {
        let failed = |why: io::Error| Error::output(lock.folder(), why);
        let (samples, sample_hz) = (recording.len(), recording.sample_hz()?);
        let mut enhancers: Vec<EnhancerWithModel<_>> = runs
            .iter()
            .map(|r| {
                let shaft = model.map(|model| model.shaft_friction(sample_hz));
                let friction = shaft.map(|mut shaft| {
                    move |s: &Sample, ruptures| shaft.step(s.time_s, s.position_m, s.velocity_mps, ruptures)
                });
                EnhancerWithModel::new(
                    enhancer_in_units(samples, &r.config, surface_m, scale.units()),
                    friction,
                )
            })
            .collect();
        let hashing = HashingWriter { file: lock.stage_file("enhanced.csv")?, hash: ResultHash::default() };
        let mut table = RowWriter::new(&header(recording.column_names()), hashing).map_err(failed)?;
        // The hash takes one column after the other.
        let mut columns =
            DiskTableWriter::new(lock.folder(), runs.len() * result_hash::HASHED_COLUMNS).map_err(failed)?;
        let mut plot = PlotSampler::new(samples, runs.len());
        let mut outs = vec![Output::default(); runs.len()];
        let (mut index, mut hashed_row) = (0, Vec::new());
        let mut assessors: Vec<ContactAssessor> =
            runs.iter().map(|r| ContactAssessor::new(&r.config, surface_m, scale.units())).collect();
        recording.for_each_sample(|s, row| -> Result<(), Error> {
            let sample = Sample {
                time_s: s.time_s,
                position_m: s.position_m,
                velocity_mps: s.velocity_mps,
                force_n: s.force_n,
            };
            hashed_row.clear();
            let each = enhancers.iter_mut().zip(&mut outs).zip(&mut runs).zip(&mut assessors);
            for (((enhancer, out), run), assessor) in each {
                *out = enhancer.step(sample);
                assessor.push(&sample, out);
                run.trace.record_events(out);
                hashed_row.extend(hashed_values(out));
            }
            if let Some(first) = outs.first() {
                let word = state_word(first.state, first.unused_reason);
                table.write_row(row, &enhanced_values(first), word).map_err(failed)?;
            }
            columns.push(&hashed_row).map_err(failed)?;
            plot.add(index, &s, &outs);
            index += 1;
            Ok(())
        })?;
        for ((run, assessor), enhancer) in runs.iter_mut().zip(&assessors).zip(&enhancers) {
            run.trace.contact = assessor.finish(run.config.contact);
            run.trace.model_rejected_s = enhancer.model_rejected_s();
        }
        Ok(Self { runs, table, columns, plot })
    }
}

/// Writes bytes to a file and into the hash of the results.
struct HashingWriter<W> {
    file: W,
    hash: ResultHash,
}

impl<W: Write> Write for HashingWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write(bytes)?;
        self.hash.update_text(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
