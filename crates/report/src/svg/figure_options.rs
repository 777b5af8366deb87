//! Size, titles and colour theme of a still picture.

use serde::{Deserialize, Serialize};

/// Colour theme of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Theme {
    /// Light or dark by the reader's system setting (README pages).
    #[default]
    Auto,
    /// Light (papers).
    Light,
    /// Dark (slides).
    Dark,
}

/// Size and titles of a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FigureOptions {
    /// Heading; may be empty.
    pub title: String,
    /// Line below the heading; may be empty.
    pub subtitle: String,
    /// Width in pixels; the height follows from the content.
    pub width_px: f64,
    /// Colour theme.
    pub theme: Theme,
}

impl Default for FigureOptions {
    fn default() -> Self {
        Self { title: String::new(), subtitle: String::new(), width_px: 960.0, theme: Theme::Auto }
    }
}
