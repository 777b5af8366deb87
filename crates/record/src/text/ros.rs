//! Text that ROS prints: `ros2 topic echo --csv`, which has no names, and `rostopic echo -p`.

use super::delimiter::{Delimiter, split};
use crate::units::{Unit, parse_unit};

/// Names of the fields behind the header of a stamped message.
const MESSAGES: &[&[&str]] = &[
    &[
        "wrench.force.x",
        "wrench.force.y",
        "wrench.force.z",
        "wrench.torque.x",
        "wrench.torque.y",
        "wrench.torque.z",
    ],
    &[
        "pose.position.x",
        "pose.position.y",
        "pose.position.z",
        "pose.orientation.x",
        "pose.orientation.y",
        "pose.orientation.z",
        "pose.orientation.w",
    ],
    &["point.x", "point.y", "point.z"],
];

/// Names of the columns of a table without names: those of a ROS 2 message with the stamp in front, where it is one, else
/// `column 1`, `column 2`, ...
pub(super) fn echoed_names(first_row: &str, delimiter: Delimiter, width: usize) -> Vec<String> {
    let fields = split(first_row, delimiter);
    let integer = |at: usize| fields.get(at).and_then(|field: &String| field.parse::<i64>().ok());
    let is_stamp = integer(0).is_some_and(|s| (100_000_000..5_000_000_000).contains(&s))
        && integer(1).is_some_and(|ns| (0..1_000_000_000).contains(&ns))
        && fields.get(2).is_some_and(|frame| frame.parse::<f64>().is_err());
    let message = MESSAGES.iter().find(|names| is_stamp && names.len() + 3 == width);
    match message {
        Some(names) => {
            let header = ["header.stamp.sec", "header.stamp.nanosec", "header.frame_id"];
            header.iter().chain(names.iter()).map(|name| (*name).to_owned()).collect()
        }
        None => (1..=width).map(|k| format!("column {k}")).collect(),
    }
}

/// Units of the fields that `rostopic echo -p` prints: stamps in nanoseconds, the rest in SI units (REP 103).
pub(super) fn add_units(names: &[String], units: &mut [Option<Unit>]) {
    let printed = names.iter().any(|name| name.starts_with("field."));
    for (name, unit) in names.iter().zip(units) {
        let ends = |stem: &str| name.strip_suffix(['x', 'y', 'z']).is_some_and(|n| n.ends_with(stem));
        let symbol = match name.as_str() {
            "time" if printed => "ns",
            _ if printed && name.ends_with(".stamp") => "ns",
            _ if !(printed
                || name.starts_with("wrench.")
                || name.starts_with("pose.")
                || name.starts_with("point.")) =>
            {
                continue;
            }
            _ if ends("force.") => "N",
            _ if ends("position.") || ends("translation.") || ends("point.") => "m",
            _ => continue,
        };
        *unit = unit.or_else(|| parse_unit(symbol));
    }
}
