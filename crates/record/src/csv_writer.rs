//! CSV out: what [`crate::read_csv`] reads back bit for bit.

use std::io::{self, BufWriter, Write};

use crate::csv_header::joint_torque_name;
use crate::error::RecordError;
use crate::ground_truth::Truth;
use crate::recording::{JOINTS, Recording, check_length};

/// Writes a recording as CSV: `time_s,position_m,force_n`, then as far as there are any `velocity_mps`,
/// `force_virtual_n`, `joint_torque_1_nm` to `joint_torque_7_nm`, the truth as `true_tip_force_n`, `true_elastic_n`, `true_friction_n`,
/// `true_active_layer`, and the extra columns under their names.
///
/// Numbers are decimal, the shortest that mean the same bits; reading gives the same [`Recording`] bit for bit. A velocity
/// that was differentiated is not written: reading differentiates again, by the same rule. Extra columns are for
/// people and plots (reading ignores them), so they may hold gaps: `NaN` is written as an empty field.
///
/// # Errors
/// What [`Recording::check`] and [`Truth::check`] find, [`RecordError::LengthMismatch`] and
/// [`RecordError::BadColumnName`] for extra columns, and [`RecordError::Write`]. Nothing is written
/// before the data are found to be in order.
pub fn write_csv(
    recording: &Recording,
    truth: Option<&Truth>,
    extra: &[(&str, &[f64])],
    output: impl Write,
) -> Result<(), RecordError> {
    recording.check()?;
    let samples = recording.len();
    if let Some(truth) = truth {
        truth.check(samples)?;
    }
    let mut names = column_names(recording, truth);
    for &(name, values) in extra {
        check_name(name, &names)?;
        check_length(name, values.len(), samples)?;
        names.push(name.to_owned());
    }
    let mut output = BufWriter::new(output);
    writeln!(output, "{}", names.join(","))?;
    let columns = numbers(recording);
    for index in 0..samples {
        // `{:?}` is the shortest text that reads back to the same bits; it takes an exponent where that is shorter.
        write!(output, "{:?}", recording.time_s[index])?;
        for column in &columns {
            write!(output, ",{:?}", column[index])?;
        }
        for torque in recording.joint_torque_nm.get(index).into_iter().flatten() {
            write!(output, ",{torque:?}")?;
        }
        if let Some(truth) = truth {
            for value in [truth.tip_force_n[index], truth.elastic_n[index], truth.friction_n[index]] {
                write!(output, ",{value:?}")?;
            }
            write!(output, ",{}", truth.active_layer[index])?;
        }
        for (_, values) in extra {
            if values[index].is_nan() {
                write!(output, ",")?;
            } else {
                write!(output, ",{:?}", values[index])?;
            }
        }
        writeln!(output)?;
    }
    output.flush()?;
    Ok(())
}

/// A table that is written row by row: numbers of a recording, numbers beside them, and a word.
#[derive(Debug)]
pub struct RowWriter<W: Write> {
    output: BufWriter<W>,
}

impl<W: Write> RowWriter<W> {
    /// Begins a table with the names of its columns.
    ///
    /// # Errors
    /// What the destination says.
    pub fn new(names: &[String], output: W) -> io::Result<Self> {
        let mut output = BufWriter::with_capacity(1 << 16, output);
        writeln!(output, "{}", names.join(","))?;
        Ok(Self { output })
    }

    /// Writes a row: numbers as [`write_csv`] writes them, those beside them empty where they are not numbers, and the word.
    ///
    /// # Errors
    /// What the destination says.
    #[inline]
    pub fn write_row(&mut self, measured: &[f64], beside: &[f64], word: &str) -> io::Result<()> {
        for value in measured {
            write!(self.output, "{value:?},")?;
        }
        for value in beside {
            if value.is_nan() {
                self.output.write_all(b",")?;
            } else {
                write!(self.output, "{value:?},")?;
            }
        }
        self.output.write_all(word.as_bytes())?;
        self.output.write_all(b"\n")
    }

    /// Ends the table.
    ///
    /// # Errors
    /// What the destination says.
    pub fn finish(self) -> io::Result<W> {
        self.output.into_inner().map_err(io::IntoInnerError::into_error)
    }
}

/// Names of a recording's columns and of those of the truth, in the order in which they are written.
pub fn column_names(recording: &Recording, truth: Option<&Truth>) -> Vec<String> {
    let mut names = vec!["time_s".to_owned(), "position_m".to_owned(), "force_n".to_owned()];
    if recording.velocity_measured {
        names.push("velocity_mps".to_owned());
    }
    if recording.force_virtual_n.is_some() {
        names.push("force_virtual_n".to_owned());
    }
    if !recording.joint_torque_nm.is_empty() {
        names.extend((0..JOINTS).map(joint_torque_name));
    }
    if truth.is_some() {
        let truth = ["true_tip_force_n", "true_elastic_n", "true_friction_n", "true_active_layer"];
        names.extend(truth.map(str::to_owned));
    }
    names
}

/// The columns after the time and before the torques, in the order of [`names`].
fn numbers(recording: &Recording) -> Vec<&[f64]> {
    let mut columns: Vec<&[f64]> = vec![&recording.position_m, &recording.force_n];
    if recording.velocity_measured {
        columns.push(&recording.velocity_mps);
    }
    if let Some(force_virtual_n) = &recording.force_virtual_n {
        columns.push(force_virtual_n);
    }
    columns
}

fn check_name(name: &str, taken: &[String]) -> Result<(), RecordError> {
    let bad = |why| Err(RecordError::BadColumnName { name: name.to_owned(), why });
    if name.trim().is_empty() {
        return bad("it is empty");
    }
    if name.trim() != name || name.contains([',', ';', '\t', '"', '\n', '\r', '\0']) {
        return bad("it holds a delimiter, a quotation mark, a line end or spaces around it");
    }
    let reads_as_own =
        name == "velocity_mps" || name == "force_virtual_n" || name.starts_with("joint_torque_");
    if reads_as_own || taken.iter().any(|existing| existing == name) {
        return bad("it is the name of another column of recordings");
    }
    Ok(())
}
