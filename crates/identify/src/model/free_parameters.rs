/// Which numbers beside `K, b, F` and the effects' are free.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FreeParameters {
    /// The position of the surface.
    pub surface: bool,
    /// The thicknesses.
    pub thickness: bool,
    /// They may be off by more than their tolerances.
    pub wide_thickness: bool,
    /// A surface of each recording's own.
    pub recording_surface: bool,
    /// Friction of each recording's own.
    pub recording_friction: bool,
    /// Of each recording's own what effects say differs between insertions ([`stylet_tissue::ParameterInfo::differs`]).
    pub recording_effects: bool,
    /// A surface of each day's own.
    pub day_surface: bool,
    /// Friction of each day's own.
    pub day_friction: bool,
}
