//! ROS 2 bags in sqlite (`.db3`).

use super::ros_definitions::definition;
use super::topics::{Message, MessageLog, Topics};
use rusqlite::{Connection, MAIN_DB};
use std::collections::BTreeMap;
use std::io::Cursor;

/// An open bag.
pub(super) struct Bag {
    connection: Connection,
    /// Message definitions by type.
    definitions: BTreeMap<String, String>,
}

fn damaged(why: impl std::fmt::Display) -> String {
    format!("it cannot be read ({why}); is it a ROS 2 bag, and complete?")
}

/// Opens a bag.
pub(super) fn open(bytes: &[u8]) -> Result<Topics<Bag>, String> {
    let mut connection = Connection::open_in_memory().map_err(damaged)?;
    // The bytes are a copy: nothing is written to the file.
    connection.deserialize_read_exact(MAIN_DB, Cursor::new(bytes), bytes.len(), false).map_err(damaged)?;
    let mut definitions = BTreeMap::new();
    // Bags since ROS 2 Iron hold the definitions.
    if let Ok(mut stored) =
        connection.prepare("SELECT topic_type, encoded_message_definition FROM message_definitions")
    {
        let rows = stored
            .query_map([], |row| Ok((row.get::<_, String>(0)?, row.get::<_, String>(1)?)))
            .map_err(damaged)?;
        definitions.extend(rows.filter_map(Result::ok));
    }
    Topics::open(Bag { connection, definitions })
}

impl MessageLog for Bag {
    fn for_each(&self, each: &mut dyn FnMut(&Message<'_>) -> Result<(), String>) -> Result<(), String> {
        let mut statement = self
            .connection
            .prepare(
                "SELECT topics.name, topics.type, topics.serialization_format, messages.timestamp, messages.data FROM messages \
                 JOIN topics ON messages.topic_id = topics.id ORDER BY messages.timestamp, messages.id",
            )
            .map_err(damaged)?;
        let mut rows = statement.query([]).map_err(damaged)?;
        while let Some(row) = rows.next().map_err(damaged)? {
            let text = |at: usize| row.get_ref(at).map_err(damaged)?.as_str().map_err(damaged);
            let (topic, kind, encoding) = (text(0)?, text(1)?, text(2)?);
            let log_ns: i64 = row.get(3).map_err(damaged)?;
            let data = row.get_ref(4).map_err(damaged)?.as_blob().map_err(damaged)?;
            let schema = self
                .definitions
                .get(kind)
                .map(String::as_str)
                .filter(|text| !text.is_empty())
                .or_else(|| definition(kind));
            each(&Message {
                topic,
                encoding,
                schema_encoding: if schema.is_some() { "ros2msg" } else { "unknown type" },
                schema_name: kind,
                schema: schema.unwrap_or_default().as_bytes(),
                log_ns: log_ns.max(0) as u64,
                data,
            })?;
        }
        Ok(())
    }
}
