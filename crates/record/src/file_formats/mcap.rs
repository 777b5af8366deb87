//! MCAP files: messages in JSON, or ROS 2 messages in CDR.

use super::columns_to_csv::NumericColumns;
use super::ros_messages::{Definition, MAX_ARRAY_LENGTH};
use mcap::Channel;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::Cursor;

/// Field of every topic with the log time of a message.
const LOG_TIME: &str = "log_time";

/// Decoder of the messages of a topic.
enum Decoder {
    Json,
    Ros(Definition),
    /// Unsupported, with the reason.
    Unsupported(String),
}

impl Decoder {
    fn of(channel: &Channel) -> Self {
        let schema = channel.schema.as_ref();
        match (channel.message_encoding.as_str(), schema.map_or("", |s| s.encoding.as_str())) {
            ("json", _) => Self::Json,
            ("cdr", "ros2msg") => {
                let made = schema.ok_or_else(String::new).and_then(|s| Definition::new(&s.name, &s.data));
                made.map_or_else(Self::Unsupported, Self::Ros)
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

/// An open file.
pub(super) struct File<'a> {
    bytes: &'a [u8],
    topics: BTreeMap<String, Topic>,
}

/// The messages of a file. Chunk checksums are verified, and records are limited in size, since a damaged length field may
/// require any amount of memory.
fn stream(bytes: &[u8]) -> MessageReader<Cursor<&[u8]>> {
    const MIN_LIMIT_BYTES: usize = 1 << 24;
    const MAX_LIMIT_BYTES: usize = 1 << 30;
    let options = LinearReaderOptions {
        // A truncated log has no footer.
        skip_end_magic: true,
        prevalidate_chunk_crcs: true,
        record_length_limit: Some(bytes.len().saturating_mul(100).clamp(MIN_LIMIT_BYTES, MAX_LIMIT_BYTES)),
        ..LinearReaderOptions::default()
    };
    MessageReader::new_with_options(Cursor::new(bytes), options)
}

fn seconds(nanoseconds: u64) -> f64 {
    nanoseconds as f64 * 1e-9
}

impl<'a> File<'a> {
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, String> {
        let mut topics: BTreeMap<String, Topic> = BTreeMap::new();
        let mut numbers = Vec::new();
        for (k, message) in stream(bytes).enumerate() {
            let message = message.map_err(|e| format!("message {} cannot be read ({e})", k + 1))?;
            if topics.contains_key(&message.channel.topic) {
                continue;
            }
            let mut decoder = Decoder::of(&message.channel);
            if let Err(why) = decoder.decode(&message.data, &mut numbers) {
                decoder = Decoder::Unsupported(why);
                numbers.clear();
            }
            let mut fields: Vec<String> = numbers.drain(..).map(|(name, _)| name).collect();
            fields.push(LOG_TIME.to_owned());
            topics.insert(message.channel.topic.clone(), Topic { decoder, fields });
        }
        Ok(Self { bytes, topics })
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

impl NumericColumns for File<'_> {
    fn column_names(&self) -> Vec<String> {
        let all = self.topics.iter();
        all.flat_map(|(topic, t)| t.fields.iter().map(move |f| format!("{topic}.{f}"))).collect()
    }

    fn read_columns(&self, wanted: &[&str], main: &str) -> Result<Vec<Vec<f64>>, String> {
        let mut parts = Vec::with_capacity(wanted.len());
        for name in wanted {
            parts.push(self.split(name).ok_or_else(|| format!("no \"{name}\""))?);
        }
        let (main_topic, _) = self.split(main).ok_or_else(|| format!("no \"{main}\""))?;
        let mut logged: Vec<Logged> = wanted.iter().map(|_| Logged::default()).collect();
        let mut numbers = Vec::new();
        let zero_s = stream(self.bytes).next().and_then(Result::ok).map_or(0, |m| m.log_time);
        for (k, message) in stream(self.bytes).enumerate() {
            let message = message.map_err(|e| format!("message {} cannot be read ({e})", k + 1))?;
            let topic = message.channel.topic.as_str();
            if !parts.iter().any(|(t, _)| *t == topic) {
                continue;
            }
            let failed = |why: String| format!("message {} on {topic}: {why}", k + 1);
            if let Some(known) = self.topics.get(topic)
                && parts.iter().any(|(t, field)| *t == topic && *field != LOG_TIME)
            {
                known.decoder.decode(&message.data, &mut numbers).map_err(failed)?;
            }
            let at_s = seconds(message.log_time.saturating_sub(zero_s));
            for ((_, field), out) in parts.iter().zip(&mut logged).filter(|((t, _), _)| *t == topic) {
                let value = if *field == LOG_TIME {
                    Some(at_s)
                } else {
                    numbers.iter().find(|(name, _)| name == field).map(|(_, x)| *x)
                };
                out.at_s.push(at_s);
                out.values.push(value.unwrap_or(f64::NAN));
            }
        }
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
