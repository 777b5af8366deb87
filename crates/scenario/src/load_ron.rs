//! Reading RON files. Every failure is an [`InputError`] with its location.

use crate::input_error::InputError;
use crate::parse_error_message::explain_parse_error;
use crate::ron_dialect::ron_options;
use crate::ron_outline::RonOutline;
use serde::de::DeserializeOwned;
use std::io::Read;
use std::path::Path;

/// Longest file that is read, in bytes.
const MAX_FILE_BYTES: u64 = 4 << 20;

const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// A value that parses but is out of range: path of the field, cause and remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldError {
    /// Path such as `tissue.layers[1].thickness_m`.
    pub path: String,
    /// Another field involved, shown when the first is a default.
    pub related_path: Option<String>,
    /// Cause and remedy.
    pub message: String,
}

impl FieldError {
    /// An error of the field at `path`.
    pub fn new(path: impl Into<String>, what: impl Into<String>) -> Self {
        Self { path: path.into(), related_path: None, message: what.into() }
    }

    /// The field at `path` is involved, too.
    #[must_use]
    pub fn with_related(self, path: impl Into<String>) -> Self {
        Self { related_path: Some(path.into()), ..self }
    }

    /// The error with its location in `text`; the path alone when the text does not contain the field.
    #[must_use]
    pub fn in_file(&self, file: &str, text: &str) -> InputError {
        let outline = RonOutline::new(text);
        let what = if self.path.is_empty() {
            self.message.clone()
        } else {
            format!("{}: {}", self.path, self.message)
        };
        let entry = outline.locate(&self.path).or_else(|| outline.locate(self.related_path.as_ref()?));
        match entry {
            Some(entry) => InputError::at(file, text, entry.start, entry.end, what),
            None => InputError::file(file, what),
        }
    }
}

impl core::fmt::Display for FieldError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}: {}", self.path, self.message)
    }
}

impl core::error::Error for FieldError {}

/// Reads a text file.
///
/// # Errors
/// [`InputError`] when the file is missing, a directory, empty, or not UTF-8 text.
pub fn read_text(path: &Path) -> Result<String, InputError> {
    let file = path.display().to_string();
    if path.is_dir() {
        return Err(InputError::file(&file, "is a directory; name a RON file in it"));
    }
    let unreadable = |e: &std::io::Error| {
        let remedy = match e.kind() {
            std::io::ErrorKind::NotFound => {
                "there is no such file; check the spelling of the path".to_owned()
            }
            std::io::ErrorKind::PermissionDenied => {
                "cannot be read: permission denied; make it readable".to_owned()
            }
            _ => format!("cannot be read: {e}"),
        };
        InputError::file(&file, remedy)
    };
    let opened = std::fs::File::open(path).map_err(|e| unreadable(&e))?;
    let mut bytes = Vec::new();
    opened.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(|e| unreadable(&e))?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let what = format!("is longer than {} MB; RON files here are a few kB of text", MAX_FILE_BYTES >> 20);
        return Err(InputError::file(&file, what));
    }
    text(&file, bytes)
}

/// The bytes of a file as text.
fn text(file: &str, mut bytes: Vec<u8>) -> Result<String, InputError> {
    if bytes.starts_with(BYTE_ORDER_MARK) {
        bytes.drain(..BYTE_ORDER_MARK.len());
    }
    if bytes.contains(&0) {
        let what = "is a binary file (it holds zero bytes); a RON file is UTF-8 text";
        return Err(InputError::file(file, what));
    }
    let text = String::from_utf8(bytes).map_err(|e| {
        let good = String::from_utf8_lossy(&e.as_bytes()[..e.utf8_error().valid_up_to()]);
        InputError::at(
            file,
            &good,
            good.len(),
            good.len(),
            "is not UTF-8 text from here on; save it as UTF-8",
        )
    })?;
    if text.trim().is_empty() {
        let what = "is empty; a RON file begins like `Scenario(name: \"...\", ...)`";
        return Err(InputError::file(file, what));
    }
    Ok(text)
}

/// Parses RON text; `file` is named in errors.
///
/// # Errors
/// [`InputError`] with line and column.
pub fn parse<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, InputError> {
    ron_options().from_str(text).map_err(|error| explain_parse_error(file, text, &error))
}

/// Reads a motion as written by [`motion_to_ron`].
///
/// # Errors
/// [`InputError`] when the file is invalid.
pub fn load_motion(path: &Path) -> Result<crate::motion::Motion, InputError> {
    load(path)
}

/// A motion as RON, readable by [`load_motion`].
///
/// # Errors
/// When a value cannot be written as RON.
pub fn motion_to_ron(motion: &crate::motion::Motion) -> Result<String, ron::Error> {
    let pretty = ron::ser::PrettyConfig::new().struct_names(true).depth_limit(3);
    ron_options().to_string_pretty(motion, pretty)
}

/// Reads and parses a RON file.
///
/// # Errors
/// As [`read_text`] and [`parse`].
pub fn load<T: DeserializeOwned>(path: &Path) -> Result<T, InputError> {
    parse(&path.display().to_string(), &read_text(path)?)
}
