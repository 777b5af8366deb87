//! CSV writer: [`crate::read_csv`] reads its files back bit for bit.

use std::io::{self, BufWriter, Write};

use crate::columns::joint_torque_name;
use crate::error::RecordError;
use crate::ground_truth::Truth;
use crate::recording::{JOINTS, Recording, check_length};

/// Writes a recording as CSV: `time_s,position_m,force_n`, then if present `velocity_mps`, `force_virtual_n`, `joint_torque_1_nm` to
/// `joint_torque_7_nm`, the truth as `true_tip_force_n`, `true_elastic_n`, `true_friction_n`, `true_active_layer`, and the extra
/// columns under their names.
///
/// Numbers have the shortest decimal form that reads back to the same bits. A differentiated velocity is not written: the
/// reader differentiates again. Extra columns are ignored by the reader; `NaN` in them is written as an empty field.
///
/// # Errors
/// Those of [`Recording::check`] and [`Truth::check`], [`RecordError::LengthMismatch`] and
/// [`RecordError::BadColumnName`] for extra columns, and [`RecordError::Write`]. Nothing is written
/// before these checks pass.
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
    let columns = value_columns(recording);
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

/// Row-by-row CSV writer: values of a recording, further values, and a word.
#[derive(Debug)]
pub struct RowWriter<W: Write> {
    output: BufWriter<W>,
}

impl<W: Write> RowWriter<W> {
    /// Starts a table with its header.
    ///
    /// # Errors
    /// The error of the destination.
    pub fn new(names: &[String], output: W) -> io::Result<Self> {
        let mut output = BufWriter::with_capacity(1 << 16, output);
        writeln!(output, "{}", names.join(","))?;
        Ok(Self { output })
    }

    /// Writes a row: measured values, further values (empty where NaN), and a word.
    ///
    /// # Errors
    /// The error of the destination.
    #[inline]
    pub fn write_row(&mut self, measured: &[f64], further: &[f64], word: &str) -> io::Result<()> {
        for value in measured {
            write!(self.output, "{value:?},")?;
        }
        for value in further {
            if value.is_nan() {
                self.output.write_all(b",")?;
            } else {
                write!(self.output, "{value:?},")?;
            }
        }
        self.output.write_all(word.as_bytes())?;
        self.output.write_all(b"\n")
    }

    /// Finishes the table.
    ///
    /// # Errors
    /// The error of the destination.
    pub fn finish(self) -> io::Result<W> {
        self.output.into_inner().map_err(io::IntoInnerError::into_error)
    }
}

/// Names of the columns of a recording and its truth, in the order of writing.
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
fn value_columns(recording: &Recording) -> Vec<&[f64]> {
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
        return bad("it contains a delimiter, a quotation mark, a line end or surrounding spaces");
    }
    let is_own_name =
        name == "velocity_mps" || name == "force_virtual_n" || name.starts_with("joint_torque_");
    if is_own_name || taken.iter().any(|existing| existing == name) {
        return bad("it is the name of another column of recordings");
    }
    Ok(())
}
