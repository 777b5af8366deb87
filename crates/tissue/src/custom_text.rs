//! A custom effect as a scenario writes it.

use alloc::string::String;
use alloc::vec::Vec;

/// Where a custom effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Place {
    /// A force added to the elastic force of the active layer, after the effects of the library. A rupture releases it, and
    /// resets the states.
    Elastic,
    /// A force added to the friction along the shaft.
    #[default]
    Friction,
    /// A force added at the tip.
    Tip,
    /// The force behind the tool as a function of `force`, before gain, lag and delay of the sensor.
    Sensor,
    /// A length by which the tissue moves in the direction of insertion, as a function of time and position.
    Motion,
}

/// A custom effect: formulas and parameters. [`Custom::from_text`](crate::Custom::from_text) compiles it.
///
/// Without `force` it names an effect whose equation is code, see [`Custom::define`](crate::Custom::define).
#[derive(Clone, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct CustomText {
    /// Name in snake case, as in results.
    pub name: String,
    /// Where it acts.
    #[cfg_attr(feature = "serde", serde(default))]
    pub place: Place,
    /// The added force in N; at `Sensor` the force behind the tool, at `Motion` a length in m. None where it is code.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub force: Option<String>,
    /// Parameters.
    pub parameters: NamedList<ParameterText>,
    /// States, zero at the start, each with its equation `"dx/dt = ..."`, which is empty where it is code.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "NamedList::is_empty"))]
    pub state: NamedList<String>,
    /// Literature, or where it was measured.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "String::is_empty"))]
    pub source: String,
}

impl CustomText {
    /// The text without values of parameters: what all effects of a definition share.
    pub(crate) fn without_values(&self) -> Self {
        let mut text = self.clone();
        for (_, parameter) in &mut text.parameters.0 {
            parameter.value = None;
        }
        text
    }
}

/// A parameter of a custom effect.
#[derive(Clone, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ParameterText {
    /// Typical value: the start of a search, and the value where none is given.
    pub start: f64,
    /// Value in this scenario; as `start` when left out.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub value: Option<f64>,
    /// Where the parameter is expected; around `start` within a factor of ten when left out.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub prior: Option<Prior>,
    /// Unit, for example `"N s/m"`; empty for a ratio.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "String::is_empty"))]
    pub unit: String,
    /// Value at which the effect vanishes; only strengths have one, and one parameter must be a strength.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub inactive: Option<f64>,
    /// Meaning, for reports.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "String::is_empty"))]
    pub meaning: String,
}

/// Where a parameter is expected. A search looks between the points that leave 2.5 % on either side. The prior of a parameter
/// that is not a strength also enters the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Prior {
    /// Normal distribution.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        sd: f64,
    },
    /// Log-normal distribution, for parameters that are positive.
    LogNormal {
        /// Median.
        median: f64,
        /// Factor of one standard deviation, above 1.
        factor: f64,
    },
    /// Uniform distribution; values outside are refused.
    Uniform {
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
    },
}

/// Named entries in the order of the text.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedList<T>(pub Vec<(String, T)>);

impl<T> Default for NamedList<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> NamedList<T> {
    /// Whether there is no entry.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// As a map whose keys are names without quotes.
#[cfg(feature = "serde")]
mod named_list_serde {
    use super::NamedList;
    use alloc::string::String;
    use alloc::vec::Vec;
    use core::fmt;
    use core::marker::PhantomData;
    use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
    use serde::ser::{Serialize, SerializeMap, Serializer};

    struct Name(String);

    impl<'de> Deserialize<'de> for Name {
        fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
            struct Names;
            impl Visitor<'_> for Names {
                type Value = Name;
                fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                    f.write_str("a name")
                }
                fn visit_str<E: Error>(self, name: &str) -> Result<Name, E> {
                    Ok(Name(name.into()))
                }
            }
            from.deserialize_identifier(Names)
        }
    }

    struct Entries<T>(PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
        type Value = NamedList<T>;
        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("named entries in braces, `{name: ...}`")
        }
        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<NamedList<T>, A::Error> {
            let mut out: Vec<(String, T)> = Vec::new();
            while let Some((Name(name), value)) = map.next_entry()? {
                if out.iter().any(|(known, _)| *known == name) {
                    return Err(A::Error::custom(format_args!("`{name}` is given twice; keep one")));
                }
                out.push((name, value));
            }
            Ok(NamedList(out))
        }
    }

    impl<'de, T: Deserialize<'de>> Deserialize<'de> for NamedList<T> {
        fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
            from.deserialize_map(Entries(PhantomData))
        }
    }

    /// A key written without quotes, as formats write the names of variants. Such names have static lifetime, as those of
    /// definitions have.
    struct Key(&'static str);

    impl Serialize for Key {
        fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
            to.serialize_unit_variant("Name", 0, self.0)
        }
    }

    impl<T: Serialize> Serialize for NamedList<T> {
        fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
            let mut map = to.serialize_map(Some(self.0.len()))?;
            for (name, value) in &self.0 {
                map.serialize_entry(&Key(crate::custom_names::static_name(name)), value)?;
            }
            map.end()
        }
    }
}
