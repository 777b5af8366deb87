//! ROS 2 messages: `.msg` definitions and CDR decoding.

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::CdrDeserializer;
use re_ros_msg::MessageSchema;
use re_ros_msg::deserialize::primitive_array::PrimitiveArray;
use re_ros_msg::deserialize::{MapResolver, MessageSeed, Value};
use serde::de::DeserializeSeed as _;

/// Bytes of the CDR encapsulation header.
const HEADER_BYTES: usize = 4;
/// Most array elements that become columns.
pub(super) const MAX_ARRAY_LENGTH: usize = 64;

/// The definition of a message type.
pub(super) struct Definition {
    schema: MessageSchema,
}

impl Definition {
    /// Parses a definition.
    pub(super) fn new(name: &str, text: &[u8]) -> Result<Self, String> {
        let text =
            std::str::from_utf8(text).map_err(|e| format!("the definition of {name} is not text ({e})"))?;
        let schema = MessageSchema::parse(name, text)
            .map_err(|e| format!("the definition of {name} cannot be parsed ({e})"))?;
        Ok(Self { schema })
    }

    /// The numeric fields of a message with their names.
    pub(super) fn decode(&self, body: &[u8], out: &mut Vec<(String, f64)>) -> Result<(), String> {
        let Some((head, rest)) = body.split_at_checked(HEADER_BYTES) else {
            return Err("a message is shorter than its header".to_owned());
        };
        let known = self.schema.dependencies.iter().map(|d| (d.name.clone(), d));
        let resolver = MapResolver::new(known);
        let seed = MessageSeed::new(&self.schema.spec, &resolver);
        let value = if head[1] & 1 == 1 {
            seed.deserialize(&mut CdrDeserializer::<LittleEndian>::new(rest))
        } else {
            seed.deserialize(&mut CdrDeserializer::<BigEndian>::new(rest))
        };
        let value = value.map_err(|e| format!("a message does not fit its definition ({e})"))?;
        flatten(&value, "", out);
        Ok(())
    }
}

fn below(at: &str, name: &str) -> String {
    if at.is_empty() { name.to_owned() } else { format!("{at}.{name}") }
}

fn flatten(value: &Value, at: &str, out: &mut Vec<(String, f64)>) {
    let mut push = |x: f64| out.push((at.to_owned(), x));
    match value {
        Value::Bool(x) => push(f64::from(u8::from(*x))),
        Value::I8(x) => push(f64::from(*x)),
        Value::U8(x) => push(f64::from(*x)),
        Value::I16(x) => push(f64::from(*x)),
        Value::U16(x) => push(f64::from(*x)),
        Value::I32(x) => push(f64::from(*x)),
        Value::U32(x) => push(f64::from(*x)),
        Value::I64(x) => push(*x as f64),
        Value::U64(x) => push(*x as f64),
        Value::F32(x) => push(f64::from(*x)),
        Value::F64(x) => push(*x),
        Value::String(_) => {}
        Value::Array(all) | Value::Sequence(all) => {
            for (k, inner) in all.iter().take(MAX_ARRAY_LENGTH).enumerate() {
                flatten(inner, &below(at, &k.to_string()), out);
            }
        }
        Value::PrimitiveArray(all) | Value::PrimitiveSeq(all) => {
            for (k, x) in primitives(all).into_iter().enumerate() {
                out.push((below(at, &k.to_string()), x));
            }
        }
        Value::Message(fields) => {
            // A time stamp is one number of seconds.
            if let (2, Some(Value::I32(s)), Some(Value::U32(ns))) =
                (fields.len(), fields.get("sec"), fields.get("nanosec"))
            {
                out.push((at.to_owned(), f64::from(*s) + 1e-9 * f64::from(*ns)));
            }
            for (name, inner) in fields {
                flatten(inner, &below(at, name), out);
            }
        }
    }
}

fn primitives(all: &PrimitiveArray) -> Vec<f64> {
    fn few<T: Copy>(x: &[T], to: impl Fn(T) -> f64) -> Vec<f64> {
        x.iter().take(MAX_ARRAY_LENGTH).map(|x| to(*x)).collect()
    }
    match all {
        PrimitiveArray::Bool(x) => few(x, |x| f64::from(u8::from(x))),
        PrimitiveArray::I8(x) => few(x, f64::from),
        PrimitiveArray::U8(x) => few(x, f64::from),
        PrimitiveArray::I16(x) => few(x, f64::from),
        PrimitiveArray::U16(x) => few(x, f64::from),
        PrimitiveArray::I32(x) => few(x, f64::from),
        PrimitiveArray::U32(x) => few(x, f64::from),
        PrimitiveArray::I64(x) => few(x, |x| x as f64),
        PrimitiveArray::U64(x) => few(x, |x| x as f64),
        PrimitiveArray::F32(x) => few(x, f64::from),
        PrimitiveArray::F64(x) => few(x, |x| x),
        PrimitiveArray::String(_) => Vec::new(),
    }
}
