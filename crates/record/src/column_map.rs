//! Column maps: names, units and signs of the columns of another program's log.
//!
//! In RON (micrometres, newtons, microseconds; the sign of the force flipped):
//! ```ron
//! Columns(
//!     time: (name: "time", scale: 1e-6),
//!     position: (name: "pz", scale: 1e-6),
//!     force: (name: "fz", scale: -1.0, offset: 0.05),
//! )
//! ```

use serde::{Deserialize, Serialize};

use crate::error::RecordError;

/// Column of one quantity and its conversion to SI: `value = scale * raw + offset`.
///
/// The offset is added after scaling, in the SI unit of the quantity: a sensor that reads 0.3 N in air needs
/// `offset: -0.3`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Column {
    /// Name in the header, without surrounding spaces; case-sensitive.
    pub name: String,
    /// SI units per unit of the file; finite, not zero. A negative scale flips the sign. Default 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// Added after scaling (SI unit of the quantity); finite. Default 0.
    #[serde(default)]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}

impl Column {
    /// A column in SI units.
    pub fn si(name: impl Into<String>) -> Self {
        Self { name: name.into(), scale: 1.0, offset: 0.0 }
    }

    /// A column with a scale.
    pub fn scaled(name: impl Into<String>, scale: f64) -> Self {
        Self { name: name.into(), scale, offset: 0.0 }
    }

    /// `scale * raw + offset`. A scale of 1 and an offset of 0 keep every bit, including the sign of zero.
    pub fn apply(&self, raw: f64) -> f64 {
        let scaled = if self.scale == 1.0 { raw } else { self.scale * raw };
        if self.offset == 0.0 { scaled } else { scaled + self.offset }
    }
}

/// Names and units of the columns of a recording.
///
/// A map names everything that is read: with a map, the optional columns of Stylet's own files
/// (`velocity_mps`, `joint_torque_1_nm`...) are read only when the map names them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Columns", deny_unknown_fields)]
pub struct ColumnMap {
    /// Time, to seconds; the scale must be positive.
    pub time: Column,
    /// Tip position, to metres, positive into the tissue.
    pub position: Column,
    /// Axial force, to newtons, positive when it resists the insertion.
    pub force: Column,
    /// Tip velocity, to m/s; when absent, the slope of the position is used.
    #[serde(default)]
    pub velocity: Option<Column>,
    /// Axial force of a virtual sensor, to newtons.
    #[serde(default)]
    pub force_virtual: Option<Column>,
}

impl Default for ColumnMap {
    /// Stylet's own names, SI units: `time_s`, `position_m`, `force_n`.
    fn default() -> Self {
        Self {
            time: Column::si("time_s"),
            position: Column::si("position_m"),
            force: Column::si("force_n"),
            velocity: None,
            force_virtual: None,
        }
    }
}

impl ColumnMap {
    /// Checks scales, offsets and names of the map; readers call it.
    ///
    /// # Errors
    /// [`RecordError::BadColumnMap`] when a scale is zero, NaN or infinite, when the scale of the time is negative or
    /// when an offset is not finite; [`RecordError::EmptyColumnName`].
    pub fn check(&self) -> Result<(), RecordError> {
        let required = [
            (Some(&self.time), ["time.name", "time.scale", "time.offset"]),
            (Some(&self.position), ["position.name", "position.scale", "position.offset"]),
            (Some(&self.force), ["force.name", "force.scale", "force.offset"]),
            (self.velocity.as_ref(), ["velocity.name", "velocity.scale", "velocity.offset"]),
            (
                self.force_virtual.as_ref(),
                ["force_virtual.name", "force_virtual.scale", "force_virtual.offset"],
            ),
        ];
        for (column, [name, scale, offset]) in required {
            let Some(column) = column else { continue };
            let bad = |field, value, must_be| {
                Err(RecordError::BadColumnMap { field, column: column.name.clone(), value, must_be })
            };
            if column.name.trim().is_empty() {
                return Err(RecordError::EmptyColumnName { field: name });
            }
            if !column.scale.is_finite() || column.scale == 0.0 {
                return bad(
                    scale,
                    column.scale,
                    "finite and not zero: SI units per unit of the file, e.g. 1e-3 for mm",
                );
            }
            if !column.offset.is_finite() {
                return bad(offset, column.offset, "finite, in the SI unit of the quantity");
            }
        }
        if self.time.scale < 0.0 {
            return Err(RecordError::BadColumnMap {
                field: "time.scale",
                column: self.time.name.clone(),
                value: self.time.scale,
                must_be: "positive: seconds per unit of the file, e.g. 1e-6 for microseconds",
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documented_form_loads_with_its_defaults() -> Result<(), ron::error::SpannedError> {
        let map: ColumnMap = ron::from_str(
            r#"Columns(time: (name: "time", scale: 1e-6), position: (name: "pz", scale: 1e-3),
               force: (name: "fz", scale: 1.0, offset: 0.0), velocity: Some((name: "vz")))"#,
        )?;
        let wanted = ColumnMap {
            time: Column::scaled("time", 1e-6),
            position: Column::scaled("pz", 1e-3),
            force: Column::si("fz"),
            velocity: Some(Column::si("vz")),
            force_virtual: None,
        };
        assert_eq!(map, wanted);
        Ok(())
    }

    #[test]
    fn a_misspelt_field_of_a_map_is_refused() {
        let text = r#"Columns(time: (name: "t", scales: 1.0), position: (name: "p"), force: (name: "f"))"#;
        let message = ron::from_str::<ColumnMap>(text).expect_err("scales").to_string();
        assert!(message.contains("scales"), "{message}");
    }

    #[test]
    fn an_invalid_scale_is_refused_with_its_field() {
        for (scale, words) in [(0.0, "not zero"), (f64::NAN, "finite"), (f64::INFINITY, "finite")] {
            let map = ColumnMap { force: Column::scaled("fz", scale), ..ColumnMap::default() };
            let message = map.check().expect_err("a bad scale").to_string();
            assert!(
                message.contains("force.scale") && message.contains("\"fz\"") && message.contains(words),
                "{message}"
            );
        }
        let map = ColumnMap { time: Column::scaled("t", -1.0), ..ColumnMap::default() };
        assert!(map.check().expect_err("time backward").to_string().contains("must be positive"));
        let map = ColumnMap { position: Column::si(" "), ..ColumnMap::default() };
        assert!(map.check().expect_err("no name").to_string().contains("position.name is empty"));
    }

    #[test]
    fn the_offset_is_added_after_scaling_and_a_negative_scale_flips_the_sign() {
        let column = Column { name: "fz".to_owned(), scale: -2.0, offset: 0.5 };
        assert_eq!(column.apply(3.0), -5.5);
        assert!(Column::si("f").apply(-0.0).is_sign_negative());
    }
}
