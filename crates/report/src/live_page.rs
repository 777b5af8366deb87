//! The page that `stylet listen` serves: force and stiffness over the last 30 s. Self-contained.

/// The page; it reads `/events`.
#[must_use]
pub fn page() -> &'static str {
    include_str!("../assets/live.html")
}
