//! A recording of any length, heard in little memory: sample by sample from disk through the core into the folder of the results.

use super::picture::Picture;
use super::table::{beside, header};
use super::{Extent, Heard, Table, Told};
use crate::enhance::combination;
use crate::error::Error;
use crate::folder::Claim;
use crate::hash::{self, ResultHash, hashed};
use crate::law::FittedLaw;
use std::io::{self, Write};
use stylet_core::config::Model;
use stylet_core::{Output, Sample};
use stylet_record::scratch::TableWriter;
use stylet_record::write::RowWriter;
use stylet_record::{LongRecording, QualityNote, Recording};
use stylet_scenario::EnhanceFile;
use stylet_score::{Hearing, core_for};

/// As [`hear`](super::hear) for a recording on disk: files, hash and findings have the same bytes, but for the report of a recording of
/// over 20 000 samples, which shows a selection. `enhanced.csv` goes into the claimed folder at once, as part of a set that is
/// announced when its other files are written.
///
/// # Errors
/// [`Error::Output`] when the folder does not take the results, [`Error::Recording`] when the samples cannot be read again.
pub fn hear_long(
    recording: &LongRecording,
    notes: Vec<QualityNote>,
    config: EnhanceFile,
    models: &[Model],
    law: Option<&FittedLaw>,
    claim: &Claim,
) -> Result<Heard, Error> {
    let out_of = |why: io::Error| Error::output(claim.folder(), why);
    let samples = recording.len();
    let mut ran: Vec<_> = models.iter().map(|&model| combination(&config, model)).collect();
    let sample_hz = recording.sample_hz()?;
    let mut hearings: Vec<Hearing<_>> = ran
        .iter()
        .map(|r| {
            let shaft = law.map(|law| law.shaft(sample_hz));
            let law = shaft.map(|mut shaft| {
                move |s: &Sample, ruptured| shaft.step(s.time_s, s.position_m, s.velocity_mps, ruptured)
            });
            Hearing::with(core_for(samples, &r.config, config.surface_m), law)
        })
        .collect();
    let both = Both { part: claim.begin("enhanced.csv")?, hash: ResultHash::default() };
    let mut table = RowWriter::new(&header(recording.names()), both).map_err(out_of)?;
    // The hash wants one column after the other.
    let mut columns = TableWriter::new(claim.folder(), models.len() * hash::COLUMNS).map_err(out_of)?;
    let mut picture = Picture::new(samples, models.len());
    let mut outs = vec![Output::default(); models.len()];
    let (mut index, mut hashed_row) = (0, Vec::new());
    recording.each(|s, row| -> Result<(), Error> {
        let sample = Sample {
            time_s: s.time_s,
            position_m: s.position_m,
            velocity_mps: s.velocity_mps,
            force_n: s.force_n,
        };
        hashed_row.clear();
        for ((hearing, out), ran) in hearings.iter_mut().zip(&mut outs).zip(&mut ran) {
            *out = hearing.step(sample);
            ran.trace.note(out);
            hashed_row.extend(hashed(out));
        }
        if let Some(first) = outs.first() {
            table.row(row, &beside(first), first.state.name()).map_err(out_of)?;
        }
        columns.push(&hashed_row).map_err(out_of)?;
        picture.take(index, &s, &outs);
        index += 1;
        Ok(())
    })?;
    drop(hearings);
    let Both { part, mut hash } = table.finish().map_err(out_of)?;
    let columns = columns.finish().map_err(out_of)?;
    let (mut piece, mut bytes) = (Vec::new(), Vec::new());
    for column in 0..columns.columns() {
        for block in 0..columns.count_blocks() {
            columns.block(block, column, &mut piece, &mut bytes).map_err(out_of)?;
            hash.column(&piece);
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
            ran.trace.contact_s = recording.first_at_s(contact_m)?;
        }
    }
    let extent = Extent { samples, duration_s: recording.duration_s()?, sample_hz };
    let table = Table::There(part.finish()?);
    let law = law.map(|law| Told::new(law, &ran));
    Ok(Heard { recording: shown, extent, notes, ran, hash: hash.finish(), config, law, table })
}

/// The table's bytes go into the file and into the hash of the results.
struct Both<W> {
    part: W,
    hash: ResultHash,
}

impl<W: Write> Write for Both<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.part.write(bytes)?;
        self.hash.text(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.part.flush()
    }
}
