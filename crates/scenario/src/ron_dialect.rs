//! The RON dialect of all files.

use ron::extensions::Extensions;

/// The RON dialect of all files: `Some` may be left out, effects and sensors take one pair of brackets.
#[must_use]
pub fn ron_options() -> ron::Options {
    ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES)
}
