//! Every field of a scenario with its default, unit and range, as a table for people.

use crate::ron_outline::RonOutline;
use crate::scenario::Scenario;
use std::fmt::Write;

/// A field: path, unit, range, meaning. `[]` is any place in a list; behind `/` stands a variant.
type Row = (&'static str, &'static str, &'static str, &'static str);

/// What a scenario cannot do without; the rest of it is defaults.
const SMALLEST: &str = r#"(
    name: "x",
    tissue: (layers: [(thickness_m: 1, stiffness_n_per_m: 1, friction_ns_per_m2: 1)]),
    motion: Recorded,
)"#;

/// Defaults that a resolved scenario does not show.
const NOT_WRITTEN: &[(&str, &str)] = &[
    ("name", "required"),
    ("tissue.layers[].name", "\"\""),
    ("tissue.layers[].puncture_n", "none"),
    ("motion", "required"),
    ("motion/Sinusoidal.phase_rad", "-1.5707963267948966"),
    ("sensor/ForceTorque.range_n", "none"),
    ("robot/Arm.start_rad", "ready pose, needle straight down"),
    ("robot/Arm.tip_m", "where start_rad puts it"),
    ("robot/Arm.direction", "the needle's axis at start_rad"),
    ("robot/Arm.controller.natural_frequency_radps", "50.0"),
    ("robot/Arm.controller.elbow_damping_per_s", "20.0"),
    ("robot/Arm.controller.disturbance_gain_per_s", "50.0"),
    ("robot/Arm.joint_friction", "None"),
    ("robot/Arm.friction_scale", "1.0"),
    ("robot/Arm.payload_error_kg", "0.0"),
    ("robot/Arm.link_mass_error", "0.0"),
    ("sensor/Virtual.gain_per_s", "5.0"),
    ("sensor/Virtual.torque_noise_nm", "0.02"),
    ("sensor/Virtual.zero", "BeforeContact(lead_s: 0.8, average_s: 0.5)"),
    ("sensor/Virtual.wrench", "Full"),
    ("enhance_virtual", "as enhance"),
];

const ROWS: &[Row] = &[
    ("name", "", "not empty", "what it is, for people"),
    ("source", "", "", "paper and figure, or where the numbers come from"),
    ("tissue.surface_m", "m", "finite", "front face of the first layer along the insertion axis"),
    ("tissue.layers[].name", "", "", "what the layer is, for people"),
    ("tissue.layers[].thickness_m", "m", "above 0, up to 1", "thickness"),
    ("tissue.layers[].stiffness_n_per_m", "N/m", ">= 0", "elastic force per metre of indentation"),
    ("tissue.layers[].friction_ns_per_m2", "N s/m²", ">= 0", "viscous friction per metre of needle inside"),
    (
        "tissue.layers[].puncture_n",
        "N",
        "above 0",
        "elastic force at which the layer gives way before its far face",
    ),
    ("effects", "", "at most 16 in the tissue", "how reality departs from the base law"),
    (
        "motion",
        "",
        "Constant, Sinusoidal, Program, Recorded",
        "the motion; must reach the surface; 50 million samples at most",
    ),
    ("motion/Constant.start_m", "m", "finite", "tip at time zero"),
    ("motion/Constant.velocity_mps", "m/s", "-1 to 1", "speed"),
    ("motion/Constant.duration_s", "s", "above 0", "duration"),
    ("motion/Sinusoidal.start_m", "m", "finite", "tip at time zero"),
    ("motion/Sinusoidal.amplitude_m", "m", "above 0, peak speed up to 1 m/s", "amplitude"),
    ("motion/Sinusoidal.frequency_hz", "Hz", "above 0, below sample_hz/2", "frequency"),
    ("motion/Sinusoidal.phase_rad", "rad", "finite", "phase; the default starts from rest"),
    ("motion/Sinusoidal.duration_s", "s", "above 0", "duration"),
    ("motion/Program.start_m", "m", "finite", "tip at time zero"),
    ("motion/Program.segments", "", "at least one", "Move, Hold, Ripple, one after another"),
    ("motion/Program.segments[]/Move.velocity_mps", "m/s", "-1 to 1", "speed; negative retracts"),
    ("motion/Program.segments[]/Move.duration_s", "s", "above 0", "duration"),
    ("motion/Program.segments[]/Hold.duration_s", "s", "above 0", "duration"),
    ("motion/Program.segments[]/Ripple.velocity_mps", "m/s", "-1 to 1", "mean speed"),
    ("motion/Program.segments[]/Ripple.amplitude_mps", "m/s", "-1 to 1", "amplitude of the speed"),
    ("motion/Program.segments[]/Ripple.frequency_hz", "Hz", "above 0, below sample_hz/2", "frequency"),
    ("motion/Program.segments[]/Ripple.duration_s", "s", "above 0", "duration"),
    ("robot", "", "Slide, Replay, Arm(...)", "what carries the needle"),
    (
        "robot/Arm.start_rad",
        "rad",
        "seven, within the joints' limits",
        "joint angles near which the start pose is looked for",
    ),
    ("robot/Arm.tip_m", "m", "reachable", "tip at the motion's start in the arm's base frame, z up"),
    ("robot/Arm.direction", "", "not all zero", "insertion direction in the base frame, of any length"),
    (
        "robot/Arm.controller.natural_frequency_radps",
        "rad/s",
        "above 0, up to half of physics_hz",
        "of the tip's error",
    ),
    (
        "robot/Arm.controller.elbow_damping_per_s",
        "1/s",
        "0 to half of physics_hz",
        "of motion that leaves the tip alone",
    ),
    (
        "robot/Arm.controller.disturbance_gain_per_s",
        "1/s",
        "0 to half of physics_hz",
        "of the force that is fed forward",
    ),
    (
        "robot/Arm.joint_friction",
        "",
        "None, Measured, MeasuredDirectional, PerJoint(joints), Sigmoid(joints)",
        "what the virtual sensor takes for an external force",
    ),
    ("robot/Arm.friction_scale", "", ">= 0", "multiplies the joint friction"),
    (
        "robot/Arm.payload_error_kg",
        "kg",
        "above minus the payload",
        "what the virtual sensor adds to the payload's mass",
    ),
    ("robot/Arm.link_mass_error", "", "-0.5 to 0.5", "what it adds to the links' masses, relative"),
    ("sensor", "", "ForceTorque, Virtual, Both(force_torque, virtual_sensor)", "what records the force"),
    ("sensor/ForceTorque.noise_n", "N", ">= 0", "standard deviation of the noise"),
    ("sensor/ForceTorque.ar1", "", "above -1, below 1", "pole of the noise per sample; 0 is white"),
    ("sensor/ForceTorque.bias_n", "N", "finite", "constant offset"),
    ("sensor/ForceTorque.drift_n_per_s", "N/s", "finite", "drift"),
    ("sensor/ForceTorque.quantisation_n", "N", ">= 0", "smallest step; 0 is none"),
    ("sensor/ForceTorque.range_n", "N", "above 0", "readings end at plus and minus this"),
    ("sensor/Virtual.gain_per_s", "1/s", ">= 0.1, one or seven", "gain of the momentum observer"),
    ("sensor/Virtual.torque_noise_nm", "N m", ">= 0", "white noise of each joint torque per physics step"),
    (
        "sensor/Virtual.zero",
        "",
        "BeforeContact(lead_s, average_s), AtRest(average_s), Never",
        "when the residual is averaged and taken as zero",
    ),
    ("sensor/Virtual.wrench", "", "Full, Point", "force and moment at the tip, or force alone"),
    (
        "enhance.algorithm",
        "",
        "Paper, Literal, Stylet",
        "Stylet's own (default), or the paper's with or without its completions",
    ),
    ("enhance.model", "", "MultiLayer, KelvinVoigt", "regressor"),
    ("enhance.reset", "", "Frequency, Trace, Ruptures", "when the covariance goes back to its prior"),
    ("enhance.reset/Frequency.hz", "Hz", "above 0", "resets per second"),
    ("enhance.reset/Trace.below", "", "above 0", "threshold on the covariance's trace"),
    ("enhance.contact", "", "Detected, Known", "how the first contact is known"),
    ("enhance.depths", "m", "Unknown, Known([above 0, ...])", "thicknesses that are known"),
    ("enhance.forgetting", "", "above 0, up to 1", "forgetting factor"),
    ("enhance.prior_stiffness", "(N/m)²", "above 0", "prior variance of the stiffness"),
    ("enhance.prior_friction", "its unit squared", "above 0", "prior variance of the friction"),
    ("enhance.cusum.enabled", "", "true, false", "CUSUM on or off"),
    ("enhance.cusum.sigma_ordinary_n", "N", "above 0", "sd of the error in ordinary insertion"),
    ("enhance.cusum.sigma_rupture_n", "N", "above sigma_ordinary_n", "sd of the error after a rupture"),
    ("enhance.derivative.enabled", "", "true, false", "force derivative on or off"),
    ("enhance.derivative.sense", "", "Rise, Drop", "loading or the drop itself"),
    ("enhance.derivative.on_n_per_s", "N/s", "above 0", "switches on above"),
    ("enhance.derivative.off_n_per_s", "N/s", "below on_n_per_s", "switches off below"),
    ("enhance.derivative.force_time_constant_s", "s", "above 0", "low-pass of the force"),
    ("enhance.derivative.derivative_time_constant_s", "s", "above 0", "low-pass of the derivative"),
    ("enhance.derivative.trailing_edge", "", "true, false", "switching off counts as a detection"),
    ("enhance.drop.travel_m", "m", "above 0", "travel of measuring the drop"),
    ("enhance.drop.max_duration_s", "s", "above 0", "longest time of measuring the drop"),
    ("enhance.drop.compensation_travel_m", "m", ">= 0", "travel of the compensation state"),
    ("enhance.drop.settle_s", "s", ">= 0", "shortest time of the compensation state"),
    ("enhance.drop.standstill_mps", "m/s", "above 0", "below it the needle stands"),
    ("enhance.drop.estimator", "", "Lines, Extremes", "how the drop is measured"),
    ("enhance.drop.reweight", "", "true, false", "the drop re-weights the prior"),
    ("enhance.drop.replay", "", "true, false", "the layer's samples are run again"),
    ("enhance.drop.compensate", "", "true, false", "the friction is added to the cumulative one"),
    ("enhance.drop.share_limits", "", "0 < first < second < 1", "limits of the drop's share of the force"),
    ("enhance.drop.replay_per_tick", "", ">= 1", "samples run again per call"),
    ("enhance.stylet.false_alarms_per_hour", "1/h", "above 0", "false alarms that are accepted, by Stylet"),
    (
        "enhance.stylet.min_drop_share",
        "",
        "0 to 1",
        "smaller falls, as a share of the largest force, are texture",
    ),
    ("enhance.stylet.law", "", "Auto, Viscous, CoulombViscous, Presliding", "friction along the shaft"),
    ("enhance.stylet.law/CoulombViscous.dry_mps", "m/s", ">= 0", "ratio of dry to viscous friction"),
    ("enhance.stylet.law/Presliding.dry_mps", "m/s", ">= 0", "ratio of dry to viscous friction"),
    ("enhance.stylet.law/Presliding.travel_m", "m", "above 0", "travel over which dry friction builds up"),
    ("enhance.stylet.track_retraction", "", "true, false", "slow changes on the way back count as friction"),
    ("enhance.contact_search.time_constant_s", "s", "above 0", "low-pass of the force"),
    ("enhance.contact_search.noise_sds", "", "above 0", "threshold in sds of the noise in air"),
    ("enhance.contact_search.samples", "", ">= 1", "samples above it in a row"),
    ("enhance.contact_search.min_noise_n", "N", ">= 0", "noise that is assumed at least"),
    ("enhance.contact_search.learn_s", "s", ">= 0", "time in air to learn the noise from"),
    ("enhance.contact_search.extrapolate_over_m", "m", ">= 0", "travel of the line back to zero force"),
    ("enhance.guard.blind_travel_m", "m", ">= 0", "no rupture within it after contact or rupture"),
    ("enhance.guard.acceleration_time_constant_s", "s", "above 0", "smoothing of the acceleration"),
    ("enhance.guard.sudden_mps2", "m/s²", "above 0", "a sudden change of speed"),
    ("enhance.guard.revisit_margin_m", "m", ">= 0", "ground is old this far above the deepest point"),
    ("enhance.guard.rest_s", "s", ">= 0", "detection rests after it"),
    ("enhance.guard.slowing_per_s", "1/s", ">= 0", "no trailing edge while slowing faster"),
    (
        "enhance_virtual",
        "",
        "fields of enhance",
        "the online algorithm on the virtual sensor's force; its model is that of enhance",
    ),
    ("compare", "", "list of models", "further models on the same data"),
    ("sample_hz", "Hz", "above 0", "samples per second"),
    ("physics_hz", "Hz", "positive; rounded up to a whole multiple of sample_hz", "physics steps per second"),
    ("tolerance", "", "above 0, below 1", "how far the tissue's numbers may be off, relative"),
    ("thickness_tolerance", "", "0 or above, below 1", "how far thicknesses may be off, relative"),
    ("surface_tolerance_m", "m", "0 or above, below 1", "how far the surface may be off"),
    ("seed", "", "whole number", "seed of every random number"),
];

/// A table in Markdown of all fields of a scenario and of the effects it may list.
///
/// Defaults are read from a scenario that gives none of them.
#[must_use]
pub fn scenario_reference() -> String {
    let defaults =
        Scenario::parse("defaults", SMALLEST).ok().and_then(|s| s.to_ron().ok()).unwrap_or_default();
    let outline = RonOutline::new(&defaults);
    let default = |path: &str| {
        let given = NOT_WRITTEN.iter().find(|(field, _)| *field == path).map(|(_, default)| *default);
        let written = || outline.locate(&without_variants(path)).and_then(|e| defaults.get(e.start..e.end));
        given.or_else(written).map_or("required".to_owned(), |value| match value.find('(') {
            Some(bracket) => format!("`{}(...)`", &value[..bracket]),
            None if value == "none" || value == "required" => value.to_owned(),
            None => format!("`{value}`"),
        })
    };
    let mut table = "| field | default | unit | range | meaning |\n|---|---|---|---|---|\n".to_owned();
    for (path, unit, range, meaning) in ROWS {
        // Writing to a string cannot fail.
        let _ = writeln!(table, "| `{path}` | {} | {unit} | {range} | {meaning} |", default(path));
    }
    for effect in stylet_tissue::general_effects().chain(stylet_tissue::per_layer_effects()) {
        for p in effect.extended.unwrap_or(effect).parameters {
            let path = p.path.replace(".0.", "[].");
            if p.path.contains(".1.") {
                continue;
            }
            let range = match (p.low, p.high) {
                (low, f64::INFINITY) => format!(">= {low}"),
                (low, high) => format!("{low} to {high}"),
            };
            let _ = writeln!(
                table,
                "| `effects[]/{}.{path}` | required | {} | {range} | {} |",
                camel(effect.id),
                p.unit,
                p.meaning
            );
        }
    }
    table
}

/// `coulomb_friction` as scenarios write it.
fn camel(id: &str) -> String {
    id.split('_')
        .flat_map(|word| word.chars().take(1).map(|c| c.to_ascii_uppercase()).chain(word.chars().skip(1)))
        .collect()
}

/// `enhance.reset/Frequency.hz` as a resolved scenario has it: `enhance.reset.hz`.
fn without_variants(path: &str) -> String {
    path.split('/').enumerate().fold(String::new(), |so_far, (i, part)| match part.split_once('.') {
        Some((_, field)) if i > 0 => format!("{so_far}.{field}"),
        _ => so_far + if i > 0 { "" } else { part },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_of_a_resolved_scenario_is_described_and_nothing_else() {
        let resolved = Scenario::parse("x", SMALLEST).expect("good").to_ron().expect("it can be written");
        let outline = RonOutline::new(&resolved);
        let described: Vec<String> = ROWS.iter().map(|row| without_variants(row.0)).collect();
        for entry in &outline.entries {
            let path = entry.path.replace("[0]", "[]").replace("[1]", "[]");
            let covered = path.is_empty()
                || described.iter().any(|d| {
                    *d == path || d.starts_with(&format!("{path}.")) || d.starts_with(&format!("{path}["))
                })
                || path.ends_with("share_limits[]");
            assert!(covered, "`{path}` is not described");
        }
        // What stands in the table and not in the resolved scenario belongs to a list, a variant or `None`.
        for (path, ..) in ROWS.iter().filter(|row| !row.0.contains(['/', '['])) {
            assert!(*path == "enhance_virtual" || outline.locate(path).is_some(), "`{path}` does not exist");
        }
    }

    #[test]
    fn the_table_shows_defaults_ranges_and_effects() {
        let table = scenario_reference();
        for row in [
            "| `sample_hz` | `200.0` | Hz | above 0 |",
            "| `enhance.reset/Frequency.hz` | `40.0` | Hz |",
            "| `sensor/ForceTorque.noise_n` | `0.02` | N |",
            "| `motion/Constant.velocity_mps` | required |",
            "| `effects[]/CoulombFriction.c_n_per_m` | required | N/m |",
            "| `effects[]/StressRelaxation.terms[].fraction` | required |  | 0 to 1 |",
        ] {
            assert!(table.contains(row), "{row}\n{table}");
        }
        assert_eq!(crate::VirtualSensor::default().gain_per_s, crate::ObserverGain::Uniform(5.0));
        assert_eq!(crate::PHASE_FROM_REST_RAD.to_string(), "-1.5707963267948966");
    }
}
