//! One number for all joints, or a list of seven.

use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use stylet_dynamics::JointGain;

/// Gain of the momentum observer in 1/s: `5.0`, or `[5.0, 5.0, 5.0, 5.0, 8.0, 8.0, 8.0]` from the base
/// outwards. The residual follows an external torque with the time constant `1/gain`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObserverGain {
    /// The same for all joints.
    Uniform(f64),
    /// From the base outwards.
    PerJoint([f64; 7]),
}

impl ObserverGain {
    /// The gains of all joints.
    #[must_use]
    pub fn per_joint(&self) -> [f64; 7] {
        match *self {
            Self::Uniform(gain) => [gain; 7],
            Self::PerJoint(gains) => gains,
        }
    }

    /// The slowest joint's.
    #[must_use]
    pub fn smallest(&self) -> f64 {
        self.per_joint().into_iter().fold(f64::INFINITY, f64::min)
    }
}

impl From<ObserverGain> for JointGain<7> {
    fn from(gain: ObserverGain) -> Self {
        match gain {
            ObserverGain::Uniform(gain) => JointGain::Uniform(gain),
            ObserverGain::PerJoint(gains) => JointGain::PerJoint(gains),
        }
    }
}

impl Serialize for ObserverGain {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Uniform(gain) => serializer.serialize_f64(*gain),
            Self::PerJoint(gains) => gains.as_slice().serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for ObserverGain {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(GainVisitor)
    }
}

struct GainVisitor;

impl<'de> Visitor<'de> for GainVisitor {
    type Value = ObserverGain;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number of 1/s, or a list of seven, one per joint")
    }

    fn visit_f64<E: Error>(self, gain: f64) -> Result<ObserverGain, E> {
        Ok(ObserverGain::Uniform(gain))
    }

    fn visit_i64<E: Error>(self, gain: i64) -> Result<ObserverGain, E> {
        Ok(ObserverGain::Uniform(gain as f64))
    }

    fn visit_u64<E: Error>(self, gain: u64) -> Result<ObserverGain, E> {
        Ok(ObserverGain::Uniform(gain as f64))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<ObserverGain, A::Error> {
        let mut gains = [0.0; 7];
        for (i, gain) in gains.iter_mut().enumerate() {
            *gain = seq.next_element()?.ok_or_else(|| A::Error::invalid_length(i, &self))?;
        }
        if seq.next_element::<f64>()?.is_some() {
            return Err(A::Error::invalid_length(8, &self));
        }
        Ok(ObserverGain::PerJoint(gains))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ron_dialect::ron_options;

    #[test]
    fn one_number_or_seven_are_read_and_written_back() {
        for (text, gain) in [
            ("5.0", ObserverGain::Uniform(5.0)),
            ("50", ObserverGain::Uniform(50.0)),
            ("[1.0,2.0,3.0,4.0,5.0,6.0,7.0]", ObserverGain::PerJoint([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])),
        ] {
            let read: ObserverGain = ron_options().from_str(text).expect("valid");
            assert_eq!(read, gain);
            let written = ron_options().to_string(&read).expect("writable");
            assert_eq!(ron_options().from_str::<ObserverGain>(&written).expect("valid"), gain);
        }
    }

    #[test]
    fn six_or_eight_numbers_are_refused_with_what_would_be_right() {
        for text in ["[1,2,3,4,5,6]", "[1,2,3,4,5,6,7,8]", "\"fast\""] {
            let error = ron_options().from_str::<ObserverGain>(text).expect_err("not a gain").to_string();
            assert!(error.contains("a list of seven"), "{error}");
        }
    }
}
