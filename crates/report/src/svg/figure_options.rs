//! Size and titles of a still picture.

/// Size and titles of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureOptions {
    /// Heading; may be empty.
    pub title: String,
    /// Line below the heading; may be empty.
    pub subtitle: String,
    /// Width in pixels; the height follows from the content.
    pub width_px: f64,
}

impl Default for FigureOptions {
    fn default() -> Self {
        Self { title: String::new(), subtitle: String::new(), width_px: 960.0 }
    }
}
