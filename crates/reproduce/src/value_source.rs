//! Source class of each number on the page.

use crate::all_runs::NOISE_MN;
use crate::assumed_value_changes::AssumedValue;
use crate::paper_experiments::Case;
use stylet_report::{Cell, Table, significant};
use stylet_scenario::{Motion, Scenario};

/// Source of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// Printed in the paper's supplement.
    Paper,
    /// Published with the authors' laboratory software (facts only).
    Laboratory,
    /// Measured by others, taken from secondary literature.
    Literature,
    /// Chosen here.
    Ours,
    /// Computed by this program from runs.
    Computed,
}

impl Class {
    /// Label on the page.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Class::Paper => "the paper's",
            Class::Laboratory => "the laboratory's",
            Class::Literature => "literature",
            Class::Ours => "ours",
            Class::Computed => "computed",
        }
    }
}

/// A table with the source class of its numbers, in a separate column if it differs by row.
#[derive(Clone, Debug, PartialEq)]
pub struct SourcedTable {
    classes: &'static [Class],
    table: Table,
}

impl SourcedTable {
    /// Every number in the table was computed from runs.
    #[must_use]
    pub const fn computed(table: Table) -> Self {
        Self { classes: &[Class::Computed], table }
    }

    /// Some numbers have the classes that their row or column names, the others were computed.
    #[must_use]
    pub const fn named(table: Table) -> Self {
        Self { classes: &[], table }
    }

    /// The table, its classes in the title.
    #[must_use]
    pub fn into_table(self) -> Table {
        let mut table = self.table;
        let named: Vec<&str> = self.classes.iter().map(|c| c.words()).collect();
        let note = if named.is_empty() { "sources by row or column".to_owned() } else { named.join(", ") };
        table.title =
            if table.title.is_empty() { format!("[{note}]") } else { format!("{} [{note}]", table.title) };
        table
    }
}

/// An input value of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Name.
    pub name: String,
    /// Value with unit.
    pub value: String,
    /// Source.
    pub class: Class,
    /// Reference or reason.
    pub why: &'static str,
    /// Name of its halved and doubled variants, if there are any.
    pub assumed_value: Option<AssumedValue>,
}

fn list(scenario: &Scenario, scale: f64, of: impl Fn(&stylet_tissue::Layer) -> f64) -> String {
    let values = scenario.tissue.layers.iter().map(|l| significant(scale * of(l), 4));
    values.collect::<Vec<_>>().join(" / ")
}

/// Class and reason of thickness, stiffness, friction and puncture force of a phantom's layers.
fn tissue(case: Case) -> [(Class, &'static str); 4] {
    use Class::{Laboratory, Literature, Ours, Paper};
    let none = (Ours, "none: the far face ends the layer");
    match case {
        _ if case.is_stack() => [
            (Laboratory, "gel stack"),
            (Ours, "drops of 1 to 3 N"),
            (Ours, "growing with concentration as in S Fig. 2"),
            (Ours, "the latex gives way just before the far face"),
        ],
        _ if case.is_liver() => [
            (Ours, "a little more than the puncture's depth; a liver of 47.5 mm"),
            (Literature, "Okamura 2004: 2.3 N at 16.7 mm; the second layer's is ours: a third"),
            (Literature, "Okamura 2004: dry and viscous friction, as viscous friction at 2.3 mm/s"),
            (Literature, "Okamura 2004; van Gerwen 2012, median"),
        ],
        _ if case.is_abdomen() => [
            (Laboratory, "abdomen, kidney path"),
            (Laboratory, "200 N/m: range of a demonstration; the second layer's 20 N/m is ours"),
            (Laboratory, "700 to 1000 N s/m² in a demonstration; the value in it is ours"),
            none,
        ],
        Case::Gel70Constant | Case::Gel70Sinusoidal => [
            (Laboratory, "single 70 % gel"),
            (Ours, "a tenth of the force at 2.3 mm/s: S sec. III supposes all force is friction"),
            (Ours, "as in the stack; friction grows with concentration, S Fig. 2"),
            none,
        ],
        _ => [
            (Paper, "S Figs 3 and 4: seconds to the exit at 2.3 mm/s"),
            (Ours, "a tenth of the force at 2.3 mm/s: S sec. III supposes all force is friction"),
            (Ours, "25 %: the 0.5 N of S sec. III are not exceeded; 50 %: as in the stack"),
            none,
        ],
    }
}

const fn assumed_values(case: Case) -> [Option<AssumedValue>; 4] {
    if case.is_stack() {
        [
            None,
            Some(AssumedValue::StackStiffness),
            Some(AssumedValue::StackFriction),
            Some(AssumedValue::LatexPuncture),
        ]
    } else if case.is_liver() {
        [
            Some(AssumedValue::LiverThickness),
            Some(AssumedValue::LiverStiffness),
            Some(AssumedValue::LiverFriction),
            Some(AssumedValue::LiverPuncture),
        ]
    } else if case.is_abdomen() {
        [None, Some(AssumedValue::AbdomenStiffness), Some(AssumedValue::AbdomenFriction), None]
    } else {
        [None, Some(AssumedValue::GelStiffness), Some(AssumedValue::GelFriction), None]
    }
}

/// All input values of an experiment, as in its scenario.
#[must_use]
pub fn inputs(case: Case, scenario: &Scenario) -> Vec<Input> {
    let mut all = Vec::new();
    let mut add = |name: &str, value: String, class, why, assumed_value| {
        all.push(Input { name: name.to_owned(), value, class, why, assumed_value });
    };
    let [thickness, stiffness, friction, puncture] = tissue(case);
    let assumed = assumed_values(case);
    add(
        "thickness",
        format!("{} mm", list(scenario, 1e3, |l| l.thickness_m)),
        thickness.0,
        thickness.1,
        assumed[0],
    );
    add(
        "K",
        format!("{} N/m", list(scenario, 1.0, |l| l.stiffness_n_per_m)),
        stiffness.0,
        stiffness.1,
        assumed[1],
    );
    add(
        "b",
        format!("{} N s/m²", list(scenario, 1.0, |l| l.friction_ns_per_m2)),
        friction.0,
        friction.1,
        assumed[2],
    );
    if scenario.tissue.layers.iter().any(|l| l.puncture_n.is_some()) {
        let text = |l: &stylet_tissue::Layer| l.puncture_n.map_or("–".to_owned(), |f| significant(f, 3));
        let values: Vec<String> = scenario.tissue.layers.iter().map(text).collect();
        add("puncture force", format!("{} N", values.join(" / ")), puncture.0, puncture.1, assumed[3]);
    }
    let behind = AssumedValue::TimeBehindTarget.enters(case).then_some(AssumedValue::TimeBehindTarget);
    match scenario.motion {
        Motion::Constant { start_m, velocity_mps, duration_s } => {
            let speed = format!("{} mm/s", significant(velocity_mps * 1e3, 3));
            add("speed", speed, Class::Paper, "S sec. III", None);
            let start = format!("{} mm", significant(-start_m * 1e3, 3));
            add(
                "way in air",
                start,
                Class::Ours,
                "air to learn the noise in",
                Some(AssumedValue::TravelInAir),
            );
            add("duration", format!("{} s", significant(duration_s, 3)), Class::Ours, "air behind", behind);
        }
        Motion::Sinusoidal { start_m, amplitude_m, frequency_hz, duration_s, .. } => {
            let motion = format!(
                "{} m at {} Hz, from rest",
                significant(amplitude_m, 3),
                significant(frequency_hz, 3)
            );
            add("motion", motion, Class::Laboratory, "published tuning", None);
            let start = format!("{} mm", significant(-start_m * 1e3, 3));
            add(
                "way in air",
                start,
                Class::Ours,
                "with it the speed at contact",
                Some(AssumedValue::TravelInAir),
            );
            let why = "a quarter period or less";
            add("duration", format!("{} s", significant(duration_s, 3)), Class::Ours, why, behind);
        }
        _ => {}
    }
    let noise = format!("{NOISE_MN} mN, white");
    let why =
        "the laboratory's s0 read as the sensor's noise; the laboratory's range 5 to 20 mN is in the tables";
    add("noise of the force/torque sensor", noise, Class::Ours, why, Some(AssumedValue::Noise));
    if let Some(virtual_sensor) = scenario.sensor.virtual_sensor() {
        add("observer gain", "5 /s".to_owned(), Class::Laboratory, "published tuning", None);
        let noise = format!("{} N m", significant(virtual_sensor.torque_noise_nm, 2));
        add("noise of the joint torques", noise, Class::Ours, "assumed", Some(AssumedValue::TorqueNoise));
        let why = "the lower end of the laboratory's range, which is not said to hold for this sensor";
        add("s1", "0.03 N".to_owned(), Class::Laboratory, why, Some(AssumedValue::VirtualSigma));
        let why = "the paper's KUKA LWR has no source that can be used";
        add("arm", "Panda, no joint friction".to_owned(), Class::Ours, why, None);
    }
    let rate = format!("{} Hz, resets at 40 Hz", significant(scenario.sample_hz, 3));
    add("sampling", rate, Class::Laboratory, "200 Hz; 40 Hz also S sec. II", None);
    all
}

/// The table of a figure's inputs.
#[must_use]
pub fn table(case: Case, scenario: &Scenario) -> SourcedTable {
    let rows = inputs(case, scenario).into_iter().map(|i| {
        vec![Cell::text(i.name), Cell::text(i.value), Cell::text(i.class.words()), Cell::text(i.why)]
    });
    SourcedTable::named(Table {
        title: "What went in".to_owned(),
        headers: ["number", "value", "whose", "source or reason"].map(String::from).to_vec(),
        rows: rows.collect(),
        ..Table::default()
    })
}

/// The inputs of several experiments in one table, without repeating common values.
#[must_use]
pub fn table_of(cases: &[Case]) -> SourcedTable {
    let mut all: Vec<(Input, Vec<&str>)> = Vec::new();
    for case in cases {
        let Ok(scenario) = case.scenario() else { continue };
        for input in inputs(*case, &scenario) {
            match all.iter_mut().find(|(other, _)| *other == input) {
                Some((_, names)) => names.push(case.name()),
                None => all.push((input, vec![case.name()])),
            }
        }
    }
    let rows = all.into_iter().map(|(i, names)| {
        let of = if names.len() == cases.len() { "all".to_owned() } else { names.join("; ") };
        vec![
            Cell::text(i.name),
            Cell::text(of),
            Cell::text(i.value),
            Cell::text(i.class.words()),
            Cell::text(i.why),
        ]
    });
    SourcedTable::named(Table {
        title: "What went in".to_owned(),
        headers: ["number", "of", "value", "whose", "source or reason"].map(String::from).to_vec(),
        rows: rows.collect(),
        ..Table::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_input_of_every_experiment_has_a_value_a_class_and_a_reason() {
        for case in Case::ALL {
            let scenario = case.scenario().expect("valid");
            let all = inputs(case, &scenario);
            for name in ["thickness", "K", "b", "noise of the force/torque sensor"] {
                assert!(all.iter().any(|i| i.name == name), "{case:?} {name}");
            }
            for input in &all {
                assert!(!input.value.is_empty() && !input.why.is_empty(), "{case:?} {}", input.name);
                assert_ne!(input.class, Class::Computed, "{case:?} {}", input.name);
                assert!(
                    input
                        .assumed_value
                        .is_none_or(|n| matches!(n, AssumedValue::Noise | AssumedValue::VirtualSigma)
                            || n.enters(case)),
                    "{case:?}"
                );
            }
        }
    }
}
