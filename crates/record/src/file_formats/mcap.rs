//! MCAP files: messages in JSON, or ROS 2 messages in CDR.

use super::topics::{Message, MessageLog, Topics};
use crate::memory_limit;
use mcap::McapError;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use std::io::Cursor;

/// The bytes of a file.
pub(super) struct Log<'a>(&'a [u8]);

/// Opens a file.
pub(super) fn open(bytes: &[u8]) -> Result<Topics<Log<'_>>, String> {
    Topics::open(Log(bytes))
}

/// The messages of a file. Chunk checksums are verified, and records are limited in size, since a damaged length field may
/// require any amount of memory.
fn stream(bytes: &[u8]) -> MessageReader<Cursor<&[u8]>> {
    const MIN_LIMIT_BYTES: usize = 1 << 24;
    const MAX_LIMIT_BYTES: usize = 1 << 30;
    // A chunk and its messages.
    let most = usize::try_from(memory_limit::limit_bytes() / 2).unwrap_or(usize::MAX);
    let options = LinearReaderOptions {
        // A truncated log has no footer.
        skip_end_magic: true,
        prevalidate_chunk_crcs: true,
        record_length_limit: Some(
            most.min(bytes.len().saturating_mul(100).clamp(MIN_LIMIT_BYTES, MAX_LIMIT_BYTES)),
        ),
        ..LinearReaderOptions::default()
    };
    MessageReader::new_with_options(Cursor::new(bytes), options)
}

impl MessageLog for Log<'_> {
    fn for_each(&self, each: &mut dyn FnMut(&Message<'_>) -> Result<(), String>) -> Result<(), String> {
        for (k, message) in stream(self.0).enumerate() {
            let message = match message {
                // A recorder that was killed leaves a log that ends in the middle of a record.
                Err(McapError::UnexpectedEof) if k > 0 => break,
                message => message.map_err(|e| format!("message {} cannot be read ({e})", k + 1))?,
            };
            let schema = message.channel.schema.as_ref();
            each(&Message {
                topic: &message.channel.topic,
                encoding: &message.channel.message_encoding,
                schema_encoding: schema.map_or("", |s| s.encoding.as_str()),
                schema_name: schema.map_or("", |s| s.name.as_str()),
                schema: schema.map_or(&[], |s| &s.data),
                log_ns: message.log_time,
                data: &message.data,
            })?;
        }
        Ok(())
    }
}
