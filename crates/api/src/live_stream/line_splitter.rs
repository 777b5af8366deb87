//! Splitting of a byte stream into lines, in bounded memory.

/// Longest line in bytes; the rest of a longer one is skipped.
pub const MAX_LINE_BYTES: usize = 65_536;

/// Collects pieces of a stream and passes on whole lines.
#[derive(Debug, Default)]
pub struct LineSplitter {
    partial: Vec<u8>,
}

impl LineSplitter {
    /// Adds the next piece and calls `each` with every complete line. A line longer than [`MAX_LINE_BYTES`] is cut to one
    /// byte more than that.
    pub fn push(&mut self, piece: &[u8], mut each: impl FnMut(&[u8])) {
        let mut lines = piece.split(|byte| *byte == b'\n').peekable();
        while let Some(line) = lines.next() {
            let complete = lines.peek().is_some();
            if complete && self.partial.is_empty() {
                each(&line[..line.len().min(MAX_LINE_BYTES + 1)]);
                continue;
            }
            let room = (MAX_LINE_BYTES + 1).saturating_sub(self.partial.len());
            self.partial.extend_from_slice(&line[..line.len().min(room)]);
            if complete {
                each(&self.partial);
                self.partial.clear();
            }
        }
    }

    /// Passes on a last line without a line break.
    pub fn finish(self, each: impl FnOnce(&[u8])) {
        if !self.partial.is_empty() {
            each(&self.partial);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(pieces: &[&[u8]]) -> Vec<Vec<u8>> {
        let (mut splitter, mut out) = (LineSplitter::default(), Vec::new());
        for piece in pieces {
            splitter.push(piece, |line| out.push(line.to_vec()));
        }
        splitter.finish(|line| out.push(line.to_vec()));
        out
    }

    #[test]
    fn lines_do_not_depend_on_the_pieces_in_which_they_arrive() {
        let text = b"1,2,3\n\n4,\xff,6\r\nlast";
        let whole = lines(&[text]);
        assert_eq!(whole, [&b"1,2,3"[..], b"", b"4,\xff,6\r", b"last"]);
        for at in 0..text.len() {
            assert_eq!(lines(&[&text[..at], &text[at..]]), whole, "cut at {at}");
        }
        let bytes: Vec<&[u8]> = text.chunks(1).collect();
        assert_eq!(lines(&bytes), whole);
        assert_eq!(lines(&[b"a\n"]), [b"a"]);
    }

    #[test]
    fn a_line_without_end_takes_bounded_memory() {
        let mut splitter = LineSplitter::default();
        for _ in 0..1000 {
            splitter.push(&[b'x'; 10_000], |_| {});
            assert!(splitter.partial.capacity() <= 4 * MAX_LINE_BYTES);
        }
        let mut found = Vec::new();
        splitter.push(b"\n1,2,3\n", |line| found.push(line.len()));
        assert_eq!(found, [MAX_LINE_BYTES + 1, 5]);
        splitter.push(&[vec![b'y'; 100_000], b"\n".to_vec()].concat(), |line| found.push(line.len()));
        assert_eq!(found[2..], [MAX_LINE_BYTES + 1]);
    }
}
