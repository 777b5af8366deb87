/// Which parameters are free in addition to `K, b, F` and effect parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FreeParameters {
    /// Position of the surface.
    pub surface: bool,
    /// Layer thicknesses.
    pub thickness: bool,
    /// Use of the wide thickness bounds ([`MAX_TOLERANCES_WIDE`](super::MAX_TOLERANCES_WIDE)).
    pub wide_thickness: bool,
    /// Surface offset per recording.
    pub recording_surface: bool,
    /// Friction factor per recording.
    pub recording_friction: bool,
    /// Per-recording deviations of varying effect parameters ([`stylet_tissue::ParameterInfo::between_recordings_sd`]).
    pub recording_effects: bool,
    /// Surface offset per day.
    pub day_surface: bool,
    /// Friction factor per day.
    pub day_friction: bool,
}
