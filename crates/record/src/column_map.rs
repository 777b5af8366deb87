//! Column maps: names, units and signs of the columns of another program's file.
//!
//! In RON (micrometres, newtons, microseconds; the sign of the force flipped):
//! ```ron
//! Columns(
//!     time: (name: "time", scale: 1e-6),
//!     position: (name: "pz", scale: 1e-6),
//!     force: (name: "fz", scale: -1.0, offset: 0.05),
//! )
//! ```
//! Everything that a map leaves out is found in the file, as without a map.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::RecordError;

/// Column of one quantity and its conversion to SI: `value = scale * raw + offset`.
///
/// The column is given by `name` or by `column`, its number from 1. Three components, by `names` or `columns`, are projected on
/// the axis of the map; two of the time are seconds and nanoseconds. Without all of these the column is found by its name and
/// unit.
///
/// The offset is added after scaling, in the SI unit of the quantity: a sensor that reads 0.3 N in air needs
/// `offset: -0.3`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Column {
    /// Name in the header, without surrounding spaces; case-sensitive. A matrix of three columns stands for its components.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Number of the column, from 1, instead of a name.
    #[serde(with = "plain", skip_serializing_if = "Option::is_none")]
    pub column: Option<usize>,
    /// Names of three components, or of seconds and nanoseconds of a time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
    /// Numbers of three components, or of seconds and nanoseconds of a time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub columns: Vec<usize>,
    /// SI units per unit of the file; finite, not zero. A negative scale flips the sign. Default: the unit in the name or in the
    /// row of units, else 1.
    #[serde(with = "plain", skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Added after scaling (SI unit of the quantity); finite. Default 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub offset: f64,
    /// Another file that holds this column, in the same folder, joined by time.
    #[serde(with = "plain", skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

/// Optional fields without `Some`.
mod plain {
    use super::{Deserialize, Deserializer, Serialize, Serializer};

    #[allow(clippy::ref_option)] // serde's signature
    pub(super) fn serialize<T: Serialize, S: Serializer>(
        value: &Option<T>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        match value {
            Some(value) => value.serialize(to),
            None => to.serialize_none(),
        }
    }

    pub(super) fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Option<T>, D::Error> {
        T::deserialize(from).map(Some)
    }
}

impl Column {
    /// A column in SI units.
    pub fn si(name: impl Into<String>) -> Self {
        Self::scaled(name, 1.0)
    }

    /// A column with a scale.
    pub fn scaled(name: impl Into<String>, scale: f64) -> Self {
        Self { name: name.into(), scale: Some(scale), ..Self::default() }
    }

    /// A column in the unit given by its name or the row of units.
    pub fn named(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// Whether the map leaves the choice of the column open.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.name.is_empty() && self.column.is_none() && self.names.is_empty() && self.columns.is_empty()
    }

    /// The column for messages.
    #[must_use]
    pub fn label(&self) -> String {
        match self.column {
            _ if !self.names.is_empty() => self.names.join(", "),
            Some(number) => format!("column {number}"),
            None if !self.columns.is_empty() => {
                format!(
                    "columns {}",
                    self.columns.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
                )
            }
            None => self.name.clone(),
        }
    }
}

/// Names and units of the columns of a recording.
///
/// The optional columns of Stylet's own files (`velocity_mps`, `joint_torque_1_nm`...) are read only when the map names them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Columns", deny_unknown_fields)]
pub struct ColumnMap {
    /// Time, to seconds; the scale must be positive.
    #[serde(default, skip_serializing_if = "is_default")]
    pub time: Column,
    /// Tip position, to metres, positive into the tissue.
    #[serde(default, skip_serializing_if = "is_default")]
    pub position: Column,
    /// Axial force, to newtons, positive when it resists the insertion.
    #[serde(default, skip_serializing_if = "is_default")]
    pub force: Column,
    /// Tip velocity, to m/s; when absent, the slope of the position is used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Column>,
    /// Axial force of a virtual sensor, to newtons.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_virtual: Option<Column>,
    /// Sampling rate (Hz) of a file without time; with a column for the time, samples per second of a sample number.
    #[serde(default, with = "plain", skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Line of the names (of a spreadsheet: row), from 1.
    #[serde(default, with = "plain", skip_serializing_if = "Option::is_none")]
    pub header_line: Option<u64>,
    /// Decimal sign, `'.'` or `','`.
    #[serde(default, with = "plain", skip_serializing_if = "Option::is_none")]
    pub decimal: Option<char>,
    /// Encoding of a text, such as `"utf-16le"` or `"windows-1250"`.
    #[serde(default, with = "plain", skip_serializing_if = "Option::is_none")]
    pub encoding: Option<String>,
    /// Sheet of a spreadsheet.
    #[serde(default, with = "plain", skip_serializing_if = "Option::is_none")]
    pub sheet: Option<String>,
    /// Insertion axis on which three components are projected, of any length; fitted to the motion when absent.
    #[serde(default, with = "plain", skip_serializing_if = "Option::is_none")]
    pub axis: Option<(f64, f64, f64)>,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Default for ColumnMap {
    /// Stylet's own names, SI units: `time_s`, `position_m`, `force_n`.
    fn default() -> Self {
        Self {
            time: Column::si("time_s"),
            position: Column::si("position_m"),
            force: Column::si("force_n"),
            ..Self::open()
        }
    }
}

impl ColumnMap {
    /// A map that leaves everything open.
    #[must_use]
    pub fn open() -> Self {
        Self {
            time: Column::default(),
            position: Column::default(),
            force: Column::default(),
            velocity: None,
            force_virtual: None,
            rate_hz: None,
            header_line: None,
            decimal: None,
            encoding: None,
            sheet: None,
            axis: None,
        }
    }

    /// Checks scales, offsets and names of the map; readers call it.
    ///
    /// # Errors
    /// [`RecordError::BadColumnMap`] when a number is out of range, [`RecordError::EmptyColumnName`], or
    /// [`RecordError::BadMapField`].
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
                Err(RecordError::BadColumnMap { field, column: column.label(), value, must_be })
            };
            let wrong = |must_be| Err(RecordError::BadMapField { field: name, must_be });
            let blank = |name: &String| !name.is_empty() && name.trim().is_empty();
            if blank(&column.name) || column.names.iter().any(|name| name.trim().is_empty()) {
                return Err(RecordError::EmptyColumnName { field: name });
            }
            let ways = [
                !column.name.is_empty(),
                column.column.is_some(),
                !column.names.is_empty(),
                !column.columns.is_empty(),
            ];
            if ways.iter().filter(|given| **given).count() > 1 {
                return wrong("given in one way only: name, column, names or columns");
            }
            if column.column == Some(0) || column.columns.contains(&0) {
                return wrong("replaced by a number from 1: the first column is 1");
            }
            let parts = column.names.len().max(column.columns.len());
            if !(parts == 0 || parts == 3 || (parts == 2 && name == "time.name")) {
                return wrong("three components (of the time: seconds and nanoseconds)");
            }
            if let Some(value) = column.scale
                && (!value.is_finite() || value == 0.0)
            {
                return bad(
                    scale,
                    value,
                    "finite and not zero: SI units per unit of the file, e.g. 1e-3 for mm",
                );
            }
            if !column.offset.is_finite() {
                return bad(offset, column.offset, "finite, in the SI unit of the quantity");
            }
        }
        if let Some(value) = self.time.scale.filter(|scale| *scale < 0.0) {
            return Err(RecordError::BadColumnMap {
                field: "time.scale",
                column: self.time.label(),
                value,
                must_be: "positive: seconds per unit of the file, e.g. 1e-6 for microseconds",
            });
        }
        if self.rate_hz.is_some_and(|rate| !(rate.is_finite() && rate > 0.0)) {
            return Err(RecordError::BadMapField {
                field: "rate_hz",
                must_be: "positive: samples per second",
            });
        }
        if self.rate_hz.is_some() && self.time.scale.is_some() {
            return Err(RecordError::BadMapField {
                field: "rate_hz",
                must_be: "left out where time.scale is given: a time has one of both",
            });
        }
        if self.header_line == Some(0) {
            return Err(RecordError::BadMapField { field: "header_line", must_be: "a line number from 1" });
        }
        if self.decimal.is_some_and(|sign| !matches!(sign, '.' | ',')) {
            return Err(RecordError::BadMapField { field: "decimal", must_be: "'.' or ','" });
        }
        if let Some(name) = &self.encoding
            && encoding_rs::Encoding::for_label(name.as_bytes()).is_none()
        {
            return Err(RecordError::BadMapField {
                field: "encoding",
                must_be: "a known name such as \"utf-8\", \"utf-16le\", \"windows-1250\", \"windows-1252\", \"shift_jis\"",
            });
        }
        if let Some((x, y, z)) = self.axis
            && !((x * x + y * y + z * z).is_finite() && x * x + y * y + z * z > 0.0)
        {
            return Err(RecordError::BadMapField {
                field: "axis",
                must_be: "three finite numbers that are not all zero",
            });
        }
        Ok(())
    }

    /// The map as a RON file.
    #[must_use]
    pub fn to_ron(&self) -> String {
        let mut out = String::from("Columns(\n");
        let mut line = |name: &str, value: String| out.push_str(&format!("    {name}: {value},\n"));
        let columns = [
            ("time", Some(&self.time)),
            ("position", Some(&self.position)),
            ("force", Some(&self.force)),
            ("velocity", self.velocity.as_ref()),
            ("force_virtual", self.force_virtual.as_ref()),
        ];
        for (name, column) in columns {
            if let Some(column) = column.filter(|column| **column != Column::default()) {
                line(name, column.to_ron());
            }
        }
        let number = |x: f64| format!("{x:?}");
        if let Some(rate) = self.rate_hz {
            line("rate_hz", number(rate));
        }
        if let Some(names) = self.header_line {
            line("header_line", names.to_string());
        }
        if let Some(sign) = self.decimal {
            line("decimal", format!("'{sign}'"));
        }
        if let Some(name) = &self.encoding {
            line("encoding", format!("{name:?}"));
        }
        if let Some(name) = &self.sheet {
            line("sheet", quoted(name));
        }
        if let Some((x, y, z)) = self.axis {
            line("axis", format!("({x:?}, {y:?}, {z:?})"));
        }
        out.push_str(")\n");
        out
    }
}

/// A RON string.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

impl Column {
    fn to_ron(&self) -> String {
        let mut parts = Vec::new();
        if let Some(file) = &self.file {
            parts.push(format!("file: {}", quoted(file)));
        }
        if !self.name.is_empty() {
            parts.push(format!("name: {}", quoted(&self.name)));
        }
        if let Some(number) = self.column {
            parts.push(format!("column: {number}"));
        }
        if !self.names.is_empty() {
            parts.push(format!(
                "names: [{}]",
                self.names.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(", ")
            ));
        }
        if !self.columns.is_empty() {
            parts.push(format!("columns: {:?}", self.columns));
        }
        if let Some(scale) = self.scale {
            parts.push(format!("scale: {scale:?}"));
        }
        if self.offset != 0.0 {
            parts.push(format!("offset: {:?}", self.offset));
        }
        format!("({})", parts.join(", "))
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
            velocity: Some(Column::named("vz")),
            ..ColumnMap::open()
        };
        assert_eq!(map, wanted);
        Ok(())
    }

    #[test]
    fn a_map_is_written_as_it_is_read() -> Result<(), ron::error::SpannedError> {
        let map = ColumnMap {
            time: Column { columns: vec![1, 2], ..Column::default() },
            position: Column {
                file: Some("pose \"1\".csv".to_owned()),
                names: vec!["x".to_owned(), "y".to_owned(), "z".to_owned()],
                scale: Some(1e-3),
                ..Column::default()
            },
            force: Column { column: Some(4), offset: -0.25, ..Column::default() },
            header_line: Some(5),
            decimal: Some(','),
            encoding: Some("windows-1250".to_owned()),
            sheet: Some("Sheet 1".to_owned()),
            axis: Some((0.0, 0.6, 0.8)),
            ..ColumnMap::open()
        };
        assert!(map.check().is_ok());
        assert_eq!(ron::from_str::<ColumnMap>(&map.to_ron())?, map);
        assert_eq!(ron::from_str::<ColumnMap>("Columns(rate_hz: 200)")?.rate_hz, Some(200.0));
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
    fn a_field_out_of_range_is_refused_with_its_name() {
        for (map, words) in [
            (ColumnMap { rate_hz: Some(0.0), ..ColumnMap::open() }, "rate_hz"),
            (ColumnMap { decimal: Some('x'), ..ColumnMap::open() }, "decimal"),
            (ColumnMap { encoding: Some("klingon".to_owned()), ..ColumnMap::open() }, "encoding"),
            (ColumnMap { axis: Some((0.0, 0.0, 0.0)), ..ColumnMap::open() }, "axis"),
            (
                ColumnMap { force: Column { column: Some(0), ..Column::default() }, ..ColumnMap::open() },
                "force.name",
            ),
            (
                ColumnMap { force: Column { columns: vec![1, 2], ..Column::default() }, ..ColumnMap::open() },
                "three",
            ),
        ] {
            let message = map.check().expect_err("out of range").to_string();
            assert!(message.contains(words), "{message}");
        }
    }
}
