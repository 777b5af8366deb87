//! The page that `stylet listen` serves: curves that grow while the needle moves. It needs nothing from anywhere else.

/// The page; it reads `/events`.
#[must_use]
pub fn page() -> &'static str {
    include_str!("../assets/live.html")
}
