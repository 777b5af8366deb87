//! Units of columns: from names such as `Force [kN]`, `Time (s)`, `pos_mm`, or from a row of units.

use serde::{Deserialize, Serialize};

/// Dimension of a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dimension {
    /// Time.
    Time,
    /// Length.
    Length,
    /// Force.
    Force,
    /// Velocity.
    Velocity,
    /// None of the quantities of a recording: torque, angle, pressure, voltage, per cent, ...
    Other,
}

/// A unit with its factor to SI.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unit {
    /// Usual symbol.
    pub symbol: &'static str,
    /// Dimension.
    pub dimension: Dimension,
    /// SI units per unit.
    pub to_si: f64,
}

/// Standard gravity (m/s²): newtons per kilogram-force.
pub const STANDARD_GRAVITY: f64 = 9.806_65;
/// Newtons per pound-force.
const POUND_FORCE_N: f64 = 4.448_221_615_260_5;

const fn unit(symbol: &'static str, dimension: Dimension, to_si: f64) -> Unit {
    Unit { symbol, dimension, to_si }
}

/// Units with their spellings, in lower case; the first spelling is the symbol as written.
const UNITS: &[(Unit, &[&str])] = &[
    (
        unit("s", Dimension::Time, 1.0),
        &["s", "sec", "secs", "second", "seconds", "sek", "sekunden", "sekundy", "secondes"],
    ),
    (unit("ms", Dimension::Time, 1e-3), &["ms", "msec", "msecs", "millisecond", "milliseconds", "millis"]),
    (
        unit("µs", Dimension::Time, 1e-6),
        &["us", "µs", "μs", "usec", "usecs", "microsecond", "microseconds", "micros"],
    ),
    (unit("ns", Dimension::Time, 1e-9), &["ns", "nsec", "nsecs", "nanosecond", "nanoseconds", "nanos"]),
    (unit("min", Dimension::Time, 60.0), &["min", "mins", "minute", "minutes"]),
    (unit("h", Dimension::Time, 3600.0), &["h", "hour", "hours"]),
    (unit("m", Dimension::Length, 1.0), &["m", "meter", "meters", "metre", "metres"]),
    (unit("mm", Dimension::Length, 1e-3), &["mm", "millimeter", "millimeters", "millimetre", "millimetres"]),
    (unit("cm", Dimension::Length, 1e-2), &["cm", "centimeter", "centimeters", "centimetre", "centimetres"]),
    (
        unit("µm", Dimension::Length, 1e-6),
        &["um", "µm", "μm", "micron", "microns", "micrometer", "micrometers", "micrometre", "micrometres"],
    ),
    (unit("nm", Dimension::Length, 1e-9), &["nanometer", "nanometers", "nanometre", "nanometres"]),
    (unit("in", Dimension::Length, 0.0254), &["in", "inch", "inches", "\""]),
    (unit("ft", Dimension::Length, 0.3048), &["foot", "feet"]),
    (unit("N", Dimension::Force, 1.0), &["n", "newton", "newtons"]),
    (unit("mN", Dimension::Force, 1e-3), &["mn", "millinewton", "millinewtons"]),
    (unit("µN", Dimension::Force, 1e-6), &["un", "µn", "μn", "micronewton", "micronewtons"]),
    (unit("kN", Dimension::Force, 1e3), &["kn", "kilonewton", "kilonewtons"]),
    (unit("cN", Dimension::Force, 1e-2), &["cn", "centinewton", "centinewtons"]),
    (
        unit("gf", Dimension::Force, 1e-3 * STANDARD_GRAVITY),
        &["gf", "g", "gram", "grams", "gramm", "gram-force", "grams-force", "gram force", "p", "pond"],
    ),
    (
        unit("kgf", Dimension::Force, STANDARD_GRAVITY),
        &["kgf", "kg", "kp", "kilogram", "kilograms", "kilogram-force"],
    ),
    (unit("lbf", Dimension::Force, POUND_FORCE_N), &["lbf", "lb", "lbs", "pound", "pounds", "pound-force"]),
    (unit("ozf", Dimension::Force, POUND_FORCE_N / 16.0), &["ozf", "oz"]),
    (unit("m/s", Dimension::Velocity, 1.0), &["m/s", "mps", "m s^-1", "m*s^-1"]),
    (unit("mm/s", Dimension::Velocity, 1e-3), &["mm/s", "mmps", "mm s^-1"]),
    (unit("µm/s", Dimension::Velocity, 1e-6), &["um/s", "µm/s", "μm/s"]),
    (unit("mm/min", Dimension::Velocity, 1e-3 / 60.0), &["mm/min"]),
    (unit("cm/s", Dimension::Velocity, 1e-2), &["cm/s"]),
    (unit("in/s", Dimension::Velocity, 0.0254), &["in/s"]),
    (unit("in/min", Dimension::Velocity, 0.0254 / 60.0), &["in/min"]),
    (unit("N m", Dimension::Other, 1.0), &["nm", "n m", "n*m", "n·m", "n.m", "mnm", "n mm", "nmm", "n·mm"]),
    (
        unit("deg", Dimension::Other, 1.0),
        &["deg", "degree", "degrees", "°", "rad", "radian", "radians", "mrad"],
    ),
    (
        unit("Pa", Dimension::Other, 1.0),
        &["pa", "kpa", "mpa", "gpa", "bar", "mbar", "psi", "n/mm²", "n/mm2", "n/mm^2"],
    ),
    (
        unit("%", Dimension::Other, 1.0),
        &["%", "percent", "mm/mm", "-", "1", "a.u.", "au", "counts", "count", "bool", "state"],
    ),
    (
        unit("V", Dimension::Other, 1.0),
        &["v", "mv", "uv", "µv", "volt", "volts", "mv/v", "a", "ma", "ampere"],
    ),
    (
        unit("°C", Dimension::Other, 1.0),
        &[
            "°c", "degc", "c", "k", "kelvin", "°f", "hz", "khz", "j", "mj", "w", "n/m", "n/mm", "rpm",
            "m/s²", "m/s^2", "mm/s²", "mm/s^2",
        ],
    ),
];

/// The unit that a text is, without surrounding brackets.
#[must_use]
pub fn parse_unit(text: &str) -> Option<Unit> {
    let text = strip_brackets(text.trim()).trim();
    if text.is_empty() || text.chars().count() > 24 {
        return None;
    }
    // Case distinguishes only the prefixes m and M, and M does not occur in recordings.
    let lower = text.to_lowercase();
    UNITS.iter().find(|(_, spellings)| spellings.contains(&lower.as_str())).map(|(unit, _)| *unit)
}

fn strip_brackets(text: &str) -> &str {
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')] {
        if let Some(inner) = text.strip_prefix(open).and_then(|t| t.strip_suffix(close)) {
            return inner;
        }
    }
    text
}

/// A name of a column in its parts.
#[derive(Debug, Clone, PartialEq)]
pub struct NameParts {
    /// The name without its unit.
    pub base: String,
    /// The unit in the name, if any.
    pub unit: Option<Unit>,
}

/// Splits a name into quantity and unit: `Force [kN]`, `Force (kN)`, `Force / kN`, `Force in kN`, `Force, kN`, `force_kn`,
/// `Force kN`. A unit of one letter behind `_` or a blank counts only when the name is of its quantity.
#[must_use]
pub fn split_name(name: &str) -> NameParts {
    // `Force_N_` and `Force..N.` are what MATLAB and R make of `Force (N)`.
    let name = name.trim().trim_end_matches(['_', '.']);
    let whole = || NameParts { base: name.to_owned(), unit: None };
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')] {
        if let (Some(from), Some(to)) = (name.rfind(open), name.rfind(close))
            && from < to
            && !name[from + 1..to].bytes().all(|b| b.is_ascii_digit())
            && let Some(unit) = parse_unit(&name[from + 1..to])
        {
            let rest = format!("{} {}", &name[..from], &name[to + close.len_utf8()..]);
            return NameParts { base: rest.trim().to_owned(), unit: Some(unit) };
        }
    }
    for separator in [" / ", "/", " in ", ", ", ","] {
        if let Some((base, text)) = name.rsplit_once(separator)
            && !base.trim().is_empty()
            && let Some(unit) = parse_unit(text)
            && (separator != "/" || quantity_of(base).is_some())
        {
            return NameParts { base: base.trim().to_owned(), unit: Some(unit) };
        }
    }
    for separator in ['_', ' ', '.', '-'] {
        if let Some((base, text)) = name.rsplit_once(separator)
            && !base.is_empty()
            && let Some(unit) = parse_unit(text)
        {
            let plain = text.chars().all(char::is_alphabetic);
            // `Fx_N` has the unit of `Fz_N`.
            let as_z = base.strip_suffix(['x', 'y']).map(|stem| format!("{stem}z"));
            let is_quantity = |base: &str| quantity_of(base) == Some(unit.dimension);
            let same = is_quantity(base) || as_z.is_some_and(|base| is_quantity(&base));
            let long = text.chars().count() > 1 && !matches!(text, "in" | "min" | "au" | "ma" | "mv");
            if plain && (same || (long && unit.dimension != Dimension::Other && quantity_of(base).is_none()))
            {
                return NameParts { base: base.to_owned(), unit: Some(unit) };
            }
        }
    }
    // A column called `seconds` or `ms`.
    match parse_unit(name) {
        Some(unit) if name.chars().count() > 1 && unit.dimension == Dimension::Time => {
            NameParts { base: name.to_owned(), unit: Some(unit) }
        }
        _ => whole(),
    }
}

/// The unit of a column: from the row of units or its type, else from its name.
pub(crate) fn unit_at(units: &[Option<Unit>], names: &[String], index: usize) -> Option<Unit> {
    units.get(index).copied().flatten().or_else(|| split_name(names.get(index)?).unit)
}

const TIME_WORDS: &[&str] = &[
    "time",
    "t",
    "timestamp",
    "stamp",
    "zeit",
    "temps",
    "tiempo",
    "tempo",
    "czas",
    "čas",
    "cas",
    "tid",
    "tijd",
    "elapsed",
    "clock",
    "seconds",
    "datetime",
    "date",
];
const LENGTH_WORDS: &[&str] = &[
    "position",
    "pos",
    "displacement",
    "disp",
    "extension",
    "stroke",
    "travel",
    "depth",
    "z",
    "pz",
    "weg",
    "verschiebung",
    "traversenweg",
    "standardweg",
    "lvdt",
    "deplacement",
    "déplacement",
    "przemieszczenie",
    "droga",
    "posizione",
    "spostamento",
    "posición",
    "posicion",
    "desplazamiento",
    "crosshead",
    "indentation",
    "insertion",
    "penetration",
    "distance",
    "height",
    "hub",
    "eindringtiefe",
    "tiefe",
    "poloha",
    "dráha",
    "tip",
    "verplaatsing",
    "profondeur",
    "profundidad",
];
const FORCE_WORDS: &[&str] = &[
    "force",
    "load",
    "f",
    "fz",
    "kraft",
    "last",
    "belastung",
    "standardkraft",
    "thrust",
    "prüfkraft",
    "siła",
    "sila",
    "obciążenie",
    "effort",
    "charge",
    "fuerza",
    "carga",
    "forza",
    "carico",
    "kracht",
    "síla",
    "loadcell",
    "newtons",
];
/// Words of a quantity that is commanded, not measured.
const COMMAND_WORDS: &[&str] =
    &["cmd", "command", "commanded", "target", "setpoint", "desired", "goal", "soll", "demand", "reference"];
/// Words of what is neither time nor position nor force.
const OTHER_WORDS: &[&str] = &[
    "torque",
    "moment",
    "strain",
    "stress",
    "temperature",
    "orientation",
    "angle",
    "acceleration",
    "stiffness",
    "counts",
    "ticks",
    "sequence",
    "tau",
];
/// Further such words, unless another word says which quantity it is, as in `current position`.
const FURTHER_OTHER_WORDS: &[&str] =
    &["current", "voltage", "volt", "volts", "status", "index", "seq", "joint", "q", "dq"];
const VELOCITY_WORDS: &[&str] =
    &["velocity", "vel", "speed", "v", "vz", "geschwindigkeit", "vitesse", "prędkość", "velocidad"];

/// The words of `cartForce1` separated, in lower case; `None` for a name without a capital inside a word.
fn separated(name: &str) -> Option<String> {
    let is_start =
        |w: &[u8]| w[0].is_ascii_lowercase() && w[1].is_ascii_uppercase() && w[2].is_ascii_lowercase();
    let starts = name.as_bytes().windows(3).enumerate().filter(|(_, w)| is_start(w)).map(|(at, _)| at + 1);
    let mut out = String::new();
    let mut from = 0;
    for start in starts {
        out.push_str(&name[from..start]);
        out.push(' ');
        from = start;
    }
    (from > 0).then(|| (out + &name[from..]).to_lowercase())
}

/// Whether a name has one of these words, with or without a number behind it; a word of four letters may be a part of another one.
fn has_word(name: &str, list: &[&str]) -> bool {
    has_word_of(&name.to_lowercase(), list) || separated(name).is_some_and(|words| has_word_of(&words, list))
}

fn has_word_of(lower: &str, list: &[&str]) -> bool {
    let mut words = lower.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty());
    words.any(|word| {
        let stem = word.trim_end_matches(|c: char| c.is_ascii_digit());
        let is_part =
            |known: &&str| known.chars().count() >= 4 && (word.starts_with(*known) || stem.ends_with(*known));
        list.contains(&word) || list.contains(&stem) || list.iter().any(is_part)
    })
}

/// Whether a name has a word of a time, even beside another quantity, as in `Time_Force`.
pub(crate) fn is_time(name: &str) -> bool {
    has_word(name, TIME_WORDS)
}

/// Whether a name denotes what is commanded, not measured.
pub(crate) fn is_commanded(name: &str) -> bool {
    has_word(name, COMMAND_WORDS)
}

/// Whether a name denotes none of the quantities of a recording, such as a torque, a current or a counter.
pub(crate) fn is_other_quantity(name: &str) -> bool {
    has_word(name, OTHER_WORDS) || (quantity_of(name).is_none() && has_word(name, FURTHER_OTHER_WORDS))
}

/// The name of the vector whose component a name denotes: `force` of `force.z`, `pose_` of `pose_2`.
pub(crate) fn vector_of(name: &str) -> Option<String> {
    let name = split_name(name).base.to_lowercase();
    let stem = name.strip_suffix(['x', 'y', 'z', '0', '1', '2', '3', '4', '5', '6'])?;
    Some(stem.to_owned())
}

/// Dimension of the quantity that a name without unit denotes.
#[must_use]
pub fn quantity_of(base: &str) -> Option<Dimension> {
    // `wrench.force.z` is a force, `pose.position.z` a position, `joint_velocity` a velocity.
    if has_word(base, OTHER_WORDS) {
        return None;
    }
    let find = |lower: &str| {
        [
            (FORCE_WORDS, Dimension::Force),
            (VELOCITY_WORDS, Dimension::Velocity),
            (LENGTH_WORDS, Dimension::Length),
            (TIME_WORDS, Dimension::Time),
        ]
        .into_iter()
        .find(|(list, _)| has_word_of(lower, list))
        .map(|(_, dimension)| dimension)
    };
    // The letter before `fPosition` is a type.
    find(&base.to_lowercase()).or_else(|| find(&separated(base)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(name: &str) -> (String, Option<&'static str>) {
        let parts = split_name(name);
        (parts.base, parts.unit.map(|u| u.symbol))
    }

    #[test]
    fn units_are_found_in_the_usual_spellings() {
        for (name, base, symbol) in [
            ("Force [kN]", "Force", "kN"),
            ("Force (mN)", "Force", "mN"),
            ("Kraft / N", "Kraft", "N"),
            ("Weg in mm", "Weg", "mm"),
            ("Time, s", "Time", "s"),
            ("Time_s", "Time", "s"),
            ("force_mn", "force", "mN"),
            ("pos_mm", "pos", "mm"),
            ("z_um", "z", "µm"),
            ("timestamp_ns", "timestamp", "ns"),
            ("Load (gf)", "Load", "gf"),
            ("Extension [in]", "Extension", "in"),
        ] {
            assert_eq!(parts(name), (base.to_owned(), Some(symbol)), "{name}");
        }
    }

    #[test]
    fn letters_that_are_no_units_stay_in_the_name() {
        for name in ["note_s", "class_m", "position_in", "fz", "Specimen 3", "index", "joint_1"] {
            let found = parts(name);
            assert!(found.1.is_none() || name == "position_in", "{name}: {found:?}");
        }
        assert_eq!(quantity_of("wrench.torque.z"), None);
        assert_eq!(quantity_of("cartForce1_Z"), Some(Dimension::Force));
        assert_eq!(quantity_of("cartPosMsr1_X"), Some(Dimension::Length));
        assert_eq!(quantity_of("fPosition"), Some(Dimension::Length));
        assert_eq!(quantity_of("CrossHead"), quantity_of("crosshead"));
        assert!(is_commanded("PositionSetPoint"));
        assert_eq!(quantity_of("/ft_sensor/wrench.wrench.force.z"), Some(Dimension::Force));
        assert_eq!(quantity_of("Przemieszczenie"), Some(Dimension::Length));
    }

    #[test]
    fn a_unit_row_entry_is_a_unit_with_or_without_brackets() {
        assert_eq!(parse_unit("(s)").map(|u| u.symbol), Some("s"));
        assert_eq!(parse_unit("[Newton]").map(|u| u.to_si), Some(1.0));
        assert_eq!(parse_unit("N·m").map(|u| u.dimension), Some(Dimension::Other));
        assert_eq!(parse_unit("7"), None);
    }
}
