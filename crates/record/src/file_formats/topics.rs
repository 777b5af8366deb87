//! Logs of messages on topics: one table on the time stamps of one topic.

use super::numeric_columns::{NamedColumn, NumericColumns};
use super::ros_messages::{Definition, MAX_ARRAY_LENGTH};
use crate::memory_limit::{self, VALUE_BYTES};
use crate::units::{Unit, parse_unit};
use serde_json::Value;
use std::collections::BTreeMap;

/// Field of every topic with the log time of a message.
const LOG_TIME: &str = "log_time";

/// Messages after which the memory that they take is compared with the limit.
const MESSAGES_PER_CHECK: usize = 1 << 16;

/// A message of a log.
pub(super) struct Message<'a> {
    pub topic: &'a str,
    pub encoding: &'a str,
    pub schema_encoding: &'a str,
    pub schema_name: &'a str,
    pub schema: &'a [u8],
    pub log_ns: u64,
    pub data: &'a [u8],
}

/// A log that can be read several times.
pub(super) trait MessageLog {
    /// Calls `each` with every message in the order of the log.
    fn for_each(&self, each: &mut dyn FnMut(&Message<'_>) -> Result<(), String>) -> Result<(), String>;
}

/// Decoder of the messages of a topic.
enum Decoder {
    Json,
    Ros(Definition),
    /// Unsupported, with the reason.
    Unsupported(String),
}

impl Decoder {
    fn of(message: &Message<'_>) -> Self {
        match (message.encoding, message.schema_encoding) {
            ("json", _) => Self::Json,
            ("cdr", "ros2msg") => {
                Definition::new(message.schema_name, message.schema).map_or_else(Self::Unsupported, Self::Ros)
            }
            (encoding, schema) => Self::Unsupported(format!(
                "messages in \"{encoding}\" by \"{schema}\" are not supported; JSON and ROS 2 .msg in CDR are"
            )),
        }
    }

    /// The numeric fields of a message with their names.
    fn decode(&self, data: &[u8], out: &mut Vec<(String, f64)>) -> Result<(), String> {
        out.clear();
        match self {
            Self::Json => {
                let value: Value =
                    serde_json::from_slice(data).map_err(|e| format!("a message is not JSON ({e})"))?;
                flatten(&value, "", out);
                Ok(())
            }
            Self::Ros(definition) => definition.decode(data, out),
            Self::Unsupported(why) => Err(why.clone()),
        }
    }

    /// The unit of a field: ROS messages are in SI units (REP 103).
    fn unit(&self, field: &str) -> Option<Unit> {
        let component = |stem: &str| {
            ["x", "y", "z"].iter().any(|axis| {
                field.strip_suffix(axis).and_then(|f| f.strip_suffix('.')).is_some_and(|f| f.ends_with(stem))
            })
        };
        match self {
            _ if field == LOG_TIME => parse_unit("s"),
            Self::Ros(_) if field.ends_with("stamp") => parse_unit("s"),
            Self::Ros(_) if component("force") => parse_unit("N"),
            Self::Ros(_) if component("position") || component("translation") || component("point") => {
                parse_unit("m")
            }
            _ => None,
        }
    }
}

fn flatten(value: &Value, at: &str, out: &mut Vec<(String, f64)>) {
    let below = |name: &str| if at.is_empty() { name.to_owned() } else { format!("{at}.{name}") };
    match value {
        Value::Number(x) => out.extend(x.as_f64().map(|x| (at.to_owned(), x))),
        Value::Bool(x) => out.push((at.to_owned(), f64::from(u8::from(*x)))),
        Value::Array(all) => {
            for (k, inner) in all.iter().take(MAX_ARRAY_LENGTH).enumerate() {
                flatten(inner, &below(&k.to_string()), out);
            }
        }
        Value::Object(fields) => {
            for (name, inner) in fields {
                flatten(inner, &below(name), out);
            }
        }
        Value::Null | Value::String(_) => {}
    }
}

/// A topic with the fields of its first message.
struct Topic {
    decoder: Decoder,
    fields: Vec<String>,
}

/// An open log.
pub(super) struct Topics<L> {
    log: L,
    topics: BTreeMap<String, Topic>,
    first_ns: u64,
}

fn seconds(nanoseconds: u64) -> f64 {
    nanoseconds as f64 * 1e-9
}

impl<L: MessageLog> Topics<L> {
    pub(super) fn open(log: L) -> Result<Self, String> {
        let mut topics: BTreeMap<String, Topic> = BTreeMap::new();
        let (mut numbers, mut first_ns) = (Vec::new(), None);
        log.for_each(&mut |message| {
            first_ns.get_or_insert(message.log_ns);
            if topics.contains_key(message.topic) {
                return Ok(());
            }
            let mut decoder = Decoder::of(message);
            if let Err(why) = decoder.decode(message.data, &mut numbers) {
                decoder = Decoder::Unsupported(why);
                numbers.clear();
            }
            let mut fields: Vec<String> = numbers.drain(..).map(|(name, _)| name).collect();
            fields.push(LOG_TIME.to_owned());
            topics.insert(message.topic.to_owned(), Topic { decoder, fields });
            Ok(())
        })?;
        Ok(Self { log, topics, first_ns: first_ns.unwrap_or(0) })
    }

    /// Splits a name into topic and field; topics may contain dots.
    fn split<'b>(&self, name: &'b str) -> Option<(&'b str, &'b str)> {
        let dots = name.match_indices('.').map(|(at, _)| (&name[..at], &name[at + 1..]));
        dots.into_iter().find(|(topic, field)| {
            self.topics.get(*topic).is_some_and(|t| t.fields.iter().any(|f| f == field))
        })
    }
}

/// Logged values of one column.
#[derive(Default)]
struct Logged {
    at_s: Vec<f64>,
    values: Vec<f64>,
}

impl<L: MessageLog> NumericColumns for Topics<L> {
    fn columns(&self) -> Vec<NamedColumn> {
        let all = self.topics.iter();
        let columns = all.flat_map(|(topic, t)| {
            t.fields
                .iter()
                .map(move |f| NamedColumn { name: format!("{topic}.{f}"), unit: t.decoder.unit(f) })
        });
        columns.collect()
    }

    fn unreadable(&self) -> Vec<String> {
        let all = self.topics.iter();
        let unsupported = all.filter_map(|(topic, t)| match &t.decoder {
            Decoder::Unsupported(why) => Some(format!("{topic}: {why}")),
            _ => None,
        });
        unsupported.collect()
    }

    fn read_columns(&self, wanted: &[&str], main: &str) -> Result<Vec<Vec<f64>>, String> {
        let mut parts = Vec::with_capacity(wanted.len());
        for name in wanted {
            parts.push(self.split(name).ok_or_else(|| format!("no \"{name}\""))?);
        }
        let (main_topic, _) = self.split(main).ok_or_else(|| format!("no \"{main}\""))?;
        let mut logged: Vec<Logged> = wanted.iter().map(|_| Logged::default()).collect();
        let (mut numbers, mut count) = (Vec::new(), 0_usize);
        self.log.for_each(&mut |message| {
            count += 1;
            if count.is_multiple_of(MESSAGES_PER_CHECK) {
                let needed =
                    (count as u64).saturating_mul(wanted.len() as u64).saturating_mul(2 * VALUE_BYTES);
                memory_limit::check(&format!("a log of more than {count} messages"), needed)?;
            }
            if !parts.iter().any(|(t, _)| *t == message.topic) {
                return Ok(());
            }
            if let Some(known) = self.topics.get(message.topic)
                && parts.iter().any(|(t, field)| *t == message.topic && *field != LOG_TIME)
            {
                let failed = |why: String| format!("message {count} on {}: {why}", message.topic);
                known.decoder.decode(message.data, &mut numbers).map_err(failed)?;
            }
            let at_s = seconds(message.log_ns.saturating_sub(self.first_ns));
            for ((_, field), out) in parts.iter().zip(&mut logged).filter(|((t, _), _)| *t == message.topic) {
                let value = if *field == LOG_TIME {
                    Some(at_s)
                } else {
                    numbers.iter().find(|(name, _)| name == field).map(|(_, x)| *x)
                };
                out.at_s.push(at_s);
                out.values.push(value.unwrap_or(f64::NAN));
            }
            Ok(())
        })?;
        Ok(resample_to_main(&parts, main_topic, logged))
    }
}

/// Columns at the times of the main topic's messages, within the time range common to all topics.
fn resample_to_main(parts: &[(&str, &str)], main: &str, logged: Vec<Logged>) -> Vec<Vec<f64>> {
    let Some(times) = parts.iter().zip(&logged).find(|((t, _), _)| *t == main).map(|(_, l)| l.at_s.clone())
    else {
        return Vec::new();
    };
    let ends = |l: &Logged| (l.at_s.first().copied(), l.at_s.last().copied());
    let from = logged.iter().filter_map(|l| ends(l).0).fold(f64::NEG_INFINITY, f64::max);
    let to = logged.iter().filter_map(|l| ends(l).1).fold(f64::INFINITY, f64::min);
    let kept: Vec<usize> = (0..times.len()).filter(|k| (from..=to).contains(&times[*k])).collect();
    parts
        .iter()
        .zip(logged)
        .map(|((topic, _), l)| {
            if *topic == main {
                kept.iter().map(|k| l.values[*k]).collect()
            } else {
                kept.iter().map(|k| stylet_stats::interpolate(&l.at_s, &l.values, times[*k])).collect()
            }
        })
        .collect()
}
