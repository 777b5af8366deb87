//! A numeric field of a scenario addressed by its path, such as `tissue.layers[1].stiffness_n_per_m`.
//!
//! The scenario's types define which fields exist: the scenario is serialised to a JSON tree and the path is followed in it. A missing
//! optional field is validated by deserialising the tree. A trial deserialises only the sections with drawn fields.

use crate::input_error::closest_name;
use crate::scenario::Scenario;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// One step of a path.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Name(String),
    Index(usize),
}

/// Type of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FieldType {
    Number,
    Integer,
    Boolean,
}

/// Sections of a scenario that a field may be in.
const SECTIONS: [&str; 8] =
    ["tissue", "effects", "motion", "sensor", "enhance", "sample_hz", "physics_hz", "tolerance"];

/// A numeric field of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct ScenarioField {
    path: String,
    steps: Vec<Step>,
    field_type: FieldType,
}

impl ScenarioField {
    /// Finds a field.
    ///
    /// # Errors
    /// A message with the closest spelling and the fields that exist at that level.
    pub fn find(scenario: &Scenario, path: &str) -> Result<Self, String> {
        let steps = split(path)?;
        let mut tree = serde_json::to_value(scenario).map_err(|e| e.to_string())?;
        match steps.first() {
            Some(Step::Name(first)) if SECTIONS.contains(&first.as_str()) => {}
            Some(Step::Name(first)) if first == "seed" => {
                return Err("`seed` is not drawn: every trial has its own seed".to_owned());
            }
            first => {
                let found = match first {
                    Some(Step::Name(name)) => name.as_str(),
                    _ => "",
                };
                return Err(unknown(found, "", &SECTIONS.map(str::to_owned)));
            }
        }
        let mut so_far = String::new();
        let mut place = &mut tree;
        for (depth, step) in steps.iter().enumerate() {
            place = inner(place);
            match step {
                Step::Index(index) => {
                    let Value::Array(items) = place else {
                        return Err(format!("`{so_far}` is not a list, so `[{index}]` has no meaning there"));
                    };
                    let count = items.len();
                    place = items.get_mut(*index).ok_or_else(|| match count {
                        0 => format!("`{so_far}` is empty; there is no entry [{index}]"),
                        _ => format!(
                            "`{so_far}` has {count} entries, [0] to [{}]; there is no [{index}]",
                            count - 1
                        ),
                    })?;
                    so_far.push_str(&format!("[{index}]"));
                }
                Step::Name(name) => {
                    let last = depth + 1 == steps.len();
                    let Value::Object(fields) = place else {
                        return Err(no_fields(place, &so_far, name));
                    };
                    if !fields.contains_key(name) {
                        let mut known: Vec<String> = fields.keys().cloned().collect();
                        let optional = fields_at_level(scenario, &steps[..depth]);
                        known.extend(
                            optional.iter().filter(|k| !fields.contains_key(*k)).cloned().collect::<Vec<_>>(),
                        );
                        if !(last && optional.contains(name)) {
                            return Err(unknown(name, &so_far, &known));
                        }
                        fields.insert(name.clone(), Value::from(1.0));
                    }
                    if !so_far.is_empty() {
                        so_far.push('.');
                    }
                    so_far.push_str(name);
                    place = fields.get_mut(name).ok_or_else(|| unknown(name, &so_far, &[]))?;
                }
            }
        }
        let field_type = match place {
            Value::Number(n) if n.is_f64() => FieldType::Number,
            Value::Number(_) => FieldType::Integer,
            Value::Bool(_) => FieldType::Boolean,
            Value::Object(fields) => {
                let names: Vec<String> = content(fields).keys().cloned().collect();
                return Err(format!(
                    "`{path}` is not a number but holds fields: {}; name one of them",
                    list(&names)
                ));
            }
            Value::Array(items) => {
                return Err(format!("`{path}` is a list of {}; name an entry, `{path}[0]`", items.len()));
            }
            Value::String(text) => {
                return Err(format!("`{path}` is `{text}`, a name; only numbers can be drawn"));
            }
            Value::Null => return Err(format!("`{path}` has no value that could be drawn")),
        };
        let field = Self { path: path.to_owned(), steps, field_type };
        // A missing optional field must exist in the schema.
        serde_json::from_value::<Scenario>(tree).map_err(|e| format!("`{path}`: {e}"))?;
        Ok(field)
    }

    /// The path as written.
    #[must_use]
    pub fn path(&self) -> &str {
        &self.path
    }

    /// The value converted to the type of the field: integers are rounded, booleans are 0 or 1.
    #[must_use]
    pub fn round_to_type(&self, value: f64) -> f64 {
        match self.field_type {
            FieldType::Number => value,
            FieldType::Integer => libm::rint(value).max(0.0),
            FieldType::Boolean => f64::from(value >= 0.5),
        }
    }

    fn value(&self, value: f64) -> Value {
        match self.field_type {
            FieldType::Number => Value::from(value),
            FieldType::Integer => Value::from(self.round_to_type(value) as u64),
            FieldType::Boolean => Value::from(value >= 0.5),
        }
    }

    /// Index of the effect that the field belongs to, if any.
    #[must_use]
    pub fn effect_index(&self) -> Option<usize> {
        match self.steps.as_slice() {
            [Step::Name(section), Step::Index(index), ..] if section == "effects" => Some(*index),
            _ => None,
        }
    }
}

/// Sets fields of a scenario, section by section.
///
/// # Errors
/// A message when a value does not fit the type of its field.
pub fn set_fields(scenario: &mut Scenario, fields: &[ScenarioField], values: &[f64]) -> Result<(), String> {
    for section in SECTIONS {
        let mine: Vec<(&ScenarioField, f64)> = fields
            .iter()
            .zip(values)
            .filter(|(f, _)| matches!(f.steps.first(), Some(Step::Name(name)) if name == section))
            .map(|(f, v)| (f, *v))
            .collect();
        let Some((_, first)) = mine.first() else { continue };
        match section {
            "tissue" => scenario.tissue = changed(&scenario.tissue, &mine)?,
            "effects" => scenario.effects = changed(&scenario.effects, &mine)?,
            "motion" => scenario.motion = changed(&scenario.motion, &mine)?,
            "sensor" => scenario.sensor = changed(&scenario.sensor, &mine)?,
            "enhance" => scenario.enhance = changed(&scenario.enhance, &mine)?,
            "sample_hz" => scenario.sample_hz = *first,
            "physics_hz" => scenario.physics_hz = *first,
            _ => scenario.tolerance = *first,
        }
    }
    Ok(())
}

fn changed<T: serde::Serialize + DeserializeOwned>(
    section: &T,
    fields: &[(&ScenarioField, f64)],
) -> Result<T, String> {
    let mut tree = serde_json::to_value(section).map_err(|e| e.to_string())?;
    for (field, value) in fields {
        let mut place = &mut tree;
        let last = field.steps.len() - 1;
        for (depth, step) in field.steps.iter().enumerate().skip(1) {
            place = inner(place);
            if let (Step::Name(name), Value::Object(fields)) = (step, &mut *place)
                && depth == last
                && !fields.contains_key(name)
            {
                fields.insert(name.clone(), Value::Null);
            }
            place =
                child(place, step).ok_or_else(|| format!("`{}` does not exist in this trial", field.path))?;
        }
        *place = field.value(*value);
    }
    serde_json::from_value(tree).map_err(|e| e.to_string())
}

/// `tissue.layers[1].stiffness_n_per_m` in steps.
fn split(path: &str) -> Result<Vec<Step>, String> {
    let wrong = || format!("`{path}` is not a path; write one like `tissue.layers[1].stiffness_n_per_m`");
    let mut steps = Vec::new();
    for part in path.split('.') {
        let (name, indices) = part.split_at(part.find('[').unwrap_or(part.len()));
        if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || c == '_') {
            return Err(wrong());
        }
        steps.push(Step::Name(name.to_owned()));
        let mut rest = indices;
        while !rest.is_empty() {
            let inside = rest.strip_prefix('[').and_then(|r| r.split_once(']')).ok_or_else(wrong)?;
            steps.push(Step::Index(inside.0.trim().parse().map_err(|_| wrong())?));
            rest = inside.1;
        }
    }
    Ok(steps)
}

/// The entry of a list or the field of an object.
fn child<'a>(place: &'a mut Value, step: &Step) -> Option<&'a mut Value> {
    match (step, place) {
        (Step::Index(index), Value::Array(items)) => items.get_mut(*index),
        (Step::Name(name), Value::Object(fields)) => fields.get_mut(name),
        _ => None,
    }
}

fn is_variant(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_uppercase())
}

/// Skips the name of an enum variant, which a path does not contain.
fn inner(place: &mut Value) -> &mut Value {
    let variant = match &*place {
        Value::Object(fields) if fields.len() == 1 => fields.keys().next().filter(|k| is_variant(k)).cloned(),
        _ => None,
    };
    match variant {
        Some(name) => &mut place[name.as_str()],
        None => place,
    }
}

fn content(fields: &Map<String, Value>) -> &Map<String, Value> {
    match fields.iter().next() {
        Some((name, Value::Object(inside))) if fields.len() == 1 && is_variant(name) => inside,
        _ => fields,
    }
}

/// All fields of the schema at a level, missing optional ones included: deserialising an unknown field makes serde list the known
/// ones.
fn fields_at_level(scenario: &Scenario, steps: &[Step]) -> Vec<String> {
    let Ok(mut tree) = serde_json::to_value(scenario) else { return Vec::new() };
    let mut place = &mut tree;
    for step in steps {
        let Some(next) = child(inner(place), step) else { return Vec::new() };
        place = next;
    }
    if let Value::Object(fields) = inner(place) {
        fields.insert("?".to_owned(), Value::Null);
    }
    match serde_json::from_value::<Scenario>(tree) {
        Ok(_) => Vec::new(),
        Err(error) => {
            let text = error.to_string();
            let names = text.split("expected").nth(1).unwrap_or_default();
            names.split('`').skip(1).step_by(2).map(str::to_owned).collect()
        }
    }
}

fn list(names: &[String]) -> String {
    names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ")
}

fn unknown(found: &str, so_far: &str, known: &[String]) -> String {
    let names: Vec<&str> = known.iter().map(String::as_str).collect();
    let within = if so_far.is_empty() { "the scenario".to_owned() } else { format!("`{so_far}`") };
    if let Some(renamed) = crate::renamed_names::renamed_path(found) {
        return format!("{within} has no field `{found}`: {renamed}");
    }
    let near = closest_name(found, &names).map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    format!("{within} has no field `{found}`{near} Known: {}", list(known)).replace("` Known", "`; known")
}

fn no_fields(place: &Value, so_far: &str, name: &str) -> String {
    match place {
        Value::Array(items) => {
            format!("`{so_far}` is a list of {}; name an entry first, `{so_far}[0].{name}`", items.len())
        }
        Value::String(text) => format!("`{so_far}` is `{text}`, which has no field `{name}`"),
        _ => format!("`{so_far}` is a number; it has no field `{name}`"),
    }
}
