//! Encoding of text files: UTF-8, UTF-16, Windows code pages.

use encoding_rs::{CoderResult, Decoder, Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1250, WINDOWS_1252};
use std::io::{self, Read};

/// Most bytes used to detect the encoding.
const SAMPLE_BYTES: usize = 1 << 18;
/// Share of zero bytes at even or odd places above which a text without byte order mark is UTF-16.
const MIN_ZERO_SHARE: f64 = 0.3;

/// The encoding of a text. `Err` if the bytes are not text, with the place of the first zero byte.
///
/// A byte order mark decides, then zero bytes at every second place, then validity as UTF-8. The rest is a Windows code page:
/// 1250 when bytes inside words are letters only there, else 1252.
pub(crate) fn detect(bytes: &[u8]) -> Result<&'static Encoding, usize> {
    if let Some((encoding, _)) = Encoding::for_bom(bytes) {
        return Ok(encoding);
    }
    let head = &bytes[..bytes.len().min(SAMPLE_BYTES)];
    if let Some(zero) = head.iter().position(|byte| *byte == 0) {
        let zeros = |odd: usize| head.iter().skip(odd).step_by(2).filter(|byte| **byte == 0).count() as f64;
        let half = (head.len() as f64 / 2.0).max(1.0);
        return match (zeros(0) / half, zeros(1) / half) {
            (even, odd) if odd > MIN_ZERO_SHARE && even < 0.01 => Ok(UTF_16LE),
            (even, odd) if even > MIN_ZERO_SHARE && odd < 0.01 => Ok(UTF_16BE),
            _ => Err(zero),
        };
    }
    match std::str::from_utf8(bytes) {
        Ok(_) => return Ok(UTF_8),
        // The head of a longer file may end inside a character.
        Err(error) if error.error_len().is_none() && bytes.len() - error.valid_up_to() < 4 => {
            return Ok(UTF_8);
        }
        Err(_) => {}
    }
    Ok(code_page(head))
}

/// The Windows code page of a text that is not UTF-8.
pub(crate) fn code_page(head: &[u8]) -> &'static Encoding {
    let letter = |at: Option<usize>| at.and_then(|at| head.get(at)).is_some_and(u8::is_ascii_alphabetic);
    let central = head.iter().enumerate().any(|(at, byte)| {
        // £ ¥ ª ¯ ³ ¹ º ¼ ¾ ¿ are the letters Ł Ą Ş Ż ł ą ş Ľ ľ ż in the code page 1250.
        matches!(byte, 0xA3 | 0xA5 | 0xAA | 0xAF | 0xB3 | 0xB9 | 0xBA | 0xBC | 0xBE | 0xBF)
            && letter(at.checked_sub(1))
            && letter(Some(at + 1))
    });
    if central { WINDOWS_1250 } else { WINDOWS_1252 }
}

/// The text of a whole file in UTF-8, without byte order mark.
pub(crate) fn decode(bytes: &[u8], encoding: &'static Encoding) -> Vec<u8> {
    encoding.decode_with_bom_removal(bytes).0.into_owned().into_bytes()
}

/// A reader that decodes to UTF-8 piece by piece.
pub(crate) struct DecodingReader<R> {
    from: R,
    decoder: Decoder,
    raw: Vec<u8>,
    /// Decoded bytes and how many of them were given out.
    text: Vec<u8>,
    given: usize,
    ended: bool,
}

/// Size of a read in bytes.
const PIECE_BYTES: usize = 1 << 16;

impl<R: Read> DecodingReader<R> {
    pub(crate) fn new(from: R, encoding: &'static Encoding) -> Self {
        let decoder = encoding.new_decoder_with_bom_removal();
        Self { from, decoder, raw: vec![0; PIECE_BYTES], text: Vec::new(), given: 0, ended: false }
    }

    fn refill(&mut self) -> io::Result<()> {
        let count = self.from.read(&mut self.raw)?;
        self.ended = count == 0;
        self.given = 0;
        let most = self.decoder.max_utf8_buffer_length(count).unwrap_or(4 * PIECE_BYTES);
        self.text.resize(most, 0);
        let (mut read, mut written) = (0, 0);
        loop {
            let (result, took, gave, _) =
                self.decoder.decode_to_utf8(&self.raw[read..count], &mut self.text[written..], self.ended);
            read += took;
            written += gave;
            match result {
                CoderResult::InputEmpty => break,
                CoderResult::OutputFull => self.text.resize(self.text.len() + PIECE_BYTES, 0),
            }
        }
        self.text.truncate(written);
        Ok(())
    }
}

impl<R: Read> Read for DecodingReader<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        while self.given == self.text.len() && !self.ended {
            self.refill()?;
        }
        let count = into.len().min(self.text.len() - self.given);
        into[..count].copy_from_slice(&self.text[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings_are_found_without_being_named() {
        let utf16: Vec<u8> = "Time [s]\tForce [N]\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(detect(&utf16), Ok(UTF_16LE));
        let swapped: Vec<u8> = utf16.chunks(2).flat_map(|pair| [pair[1], pair[0]]).collect();
        assert_eq!(detect(&swapped), Ok(UTF_16BE));
        assert_eq!(detect("Kraft in µN".as_bytes()), Ok(UTF_8));
        assert_eq!(detect(b"Kraft in \xB5N"), Ok(WINDOWS_1252));
        assert_eq!(detect(b"Si\xB3a (N)"), Ok(WINDOWS_1250));
        assert_eq!(decode(b"Si\xB3a (N)", WINDOWS_1250), "Siła (N)".as_bytes());
        assert_eq!(detect(b"\x89PNG\0\x01\x02"), Err(4));
    }

    #[test]
    fn decoding_in_pieces_equals_decoding_at_once() -> io::Result<()> {
        let text = "Zeit;Kraft\n".to_owned() + &"0,5;1,25 µN\n".repeat(20_000);
        let bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let mut piecewise = Vec::new();
        DecodingReader::new(bytes.as_slice(), UTF_16LE).read_to_end(&mut piecewise)?;
        assert_eq!(piecewise, text.as_bytes());
        assert_eq!(decode(&bytes, UTF_16LE), text.as_bytes());
        Ok(())
    }
}
