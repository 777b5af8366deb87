//! Ranges of the settings of the online algorithm.

use crate::load_ron::FieldError;
use crate::range_checks::{CheckResult, check, not_negative, positive};
use stylet_core::config::{Depths, EnhanceConfig, FrictionLaw, Reset};

/// Checks settings with the path `at`; empty at the top of a file.
pub(crate) fn enhance(at: &str, c: &EnhanceConfig) -> CheckResult {
    let path = |field: &str| if at.is_empty() { field.to_owned() } else { format!("{at}.{field}") };
    match c.reset {
        Reset::Frequency { hz } => positive(path("reset.hz"), hz, "Hz")?,
        Reset::Trace { below } => {
            let prior = c.prior_stiffness + c.prior_friction;
            check(
                path("reset.below"),
                below,
                below > 0.0 && below < prior,
                &format!("it must lie between 0 and the trace of the prior, {prior:e}"),
            )?;
        }
        Reset::Ruptures => {}
    }
    let rate = path("stylet.false_alarms_per_hour");
    positive(rate, c.stylet.false_alarms_per_hour, "per hour")?;
    check(
        path("stylet.min_drop_share"),
        c.stylet.min_drop_share,
        (0.0..=1.0).contains(&c.stylet.min_drop_share),
        "it must lie between 0 and 1",
    )?;
    match c.stylet.friction_law {
        FrictionLaw::Auto | FrictionLaw::Viscous => {}
        FrictionLaw::CoulombViscous { dry_mps } => {
            not_negative(path("stylet.friction_law.dry_mps"), dry_mps, "m/s")?;
        }
        FrictionLaw::Presliding { dry_mps, travel_m } => {
            not_negative(path("stylet.friction_law.dry_mps"), dry_mps, "m/s")?;
            positive(path("stylet.friction_law.travel_m"), travel_m, "metres")?;
        }
    }
    if let Depths::Known(thicknesses) = &c.depths {
        if thicknesses.is_empty() {
            return Err(FieldError::new(path("depths"), "is empty; give one thickness in metres per layer"));
        }
        for (i, d) in thicknesses.iter().enumerate() {
            positive(format!("{}[{i}]", path("depths")), *d, "metres")?;
        }
    }
    check(
        path("forgetting"),
        c.forgetting,
        c.forgetting > 0.0 && c.forgetting <= 1.0,
        "it must lie above 0 and be at most 1",
    )?;
    positive(path("prior_stiffness"), c.prior_stiffness, "(N/m)²")?;
    positive(path("prior_friction"), c.prior_friction, "friction units squared")?;
    let s = &c.cusum;
    positive(path("cusum.sigma_ordinary_n"), s.sigma_ordinary_n, "N")?;
    check(
        path("cusum.sigma_rupture_n"),
        s.sigma_rupture_n,
        s.sigma_rupture_n > s.sigma_ordinary_n,
        &format!("it must be larger than sigma_ordinary_n, {}", s.sigma_ordinary_n),
    )
    .map_err(|p| p.with_related(path("cusum.sigma_ordinary_n")))?;
    let d = &c.derivative;
    positive(path("derivative.on_n_per_s"), d.on_n_per_s, "N/s")?;
    check(
        path("derivative.off_n_per_s"),
        d.off_n_per_s,
        d.off_n_per_s < d.on_n_per_s,
        &format!("it must be smaller than on_n_per_s, {}", d.on_n_per_s),
    )
    .map_err(|p| p.with_related(path("derivative.on_n_per_s")))?;
    positive(path("derivative.force_time_constant_s"), d.force_time_constant_s, "seconds")?;
    positive(path("derivative.derivative_time_constant_s"), d.derivative_time_constant_s, "seconds")?;
    let d = &c.drop;
    positive(path("drop.travel_m"), d.travel_m, "metres")?;
    positive(path("drop.max_duration_s"), d.max_duration_s, "seconds")?;
    not_negative(path("drop.compensation_travel_m"), d.compensation_travel_m, "metres")?;
    not_negative(path("drop.settle_s"), d.settle_s, "seconds")?;
    positive(path("drop.standstill_mps"), d.standstill_mps, "m/s")?;
    for (i, share) in d.share_limits.into_iter().enumerate() {
        let inside = share > 0.0 && share < 1.0;
        check(format!("{}[{i}]", path("drop.share_limits")), share, inside, "it must lie between 0 and 1")?;
    }
    let [low, high] = d.share_limits;
    if low >= high {
        let what = format!("is ({low}, {high}); the first must be smaller than the second");
        return Err(FieldError::new(path("drop.share_limits"), what));
    }
    if d.replay_per_tick == 0 {
        return Err(FieldError::new(path("drop.replay_per_tick"), "is 0; it must be at least 1"));
    }
    let k = &c.contact_search;
    positive(path("contact_search.time_constant_s"), k.time_constant_s, "seconds")?;
    positive(path("contact_search.noise_sds"), k.noise_sds, "standard deviations")?;
    if k.samples == 0 {
        return Err(FieldError::new(path("contact_search.samples"), "is 0; it must be at least 1"));
    }
    not_negative(path("contact_search.min_noise_n"), k.min_noise_n, "N")?;
    not_negative(path("contact_search.learn_s"), k.learn_s, "seconds")?;
    not_negative(path("contact_search.extrapolate_over_m"), k.extrapolate_over_m, "metres")?;
    let g = &c.guard;
    not_negative(path("guard.blind_travel_m"), g.blind_travel_m, "metres")?;
    positive(path("guard.acceleration_time_constant_s"), g.acceleration_time_constant_s, "seconds")?;
    positive(path("guard.sudden_mps2"), g.sudden_mps2, "m/s²")?;
    not_negative(path("guard.revisit_margin_m"), g.revisit_margin_m, "metres")?;
    not_negative(path("guard.rest_s"), g.rest_s, "seconds")?;
    not_negative(path("guard.slowing_per_s"), g.slowing_per_s, "1/s")
}
