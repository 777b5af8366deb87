//! Mutations of a corpus, and what a parser may do with them.

use super::support::root;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// SplitMix64: the same mutations everywhere.
pub struct Dice(pub u64);

impl Dice {
    pub fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.roll() % n.max(1) as u64) as usize
    }

    pub fn of<'a, T: ?Sized>(&mut self, all: &[&'a T]) -> &'a T {
        all[self.below(all.len())]
    }
}

/// What breaks parsers: numbers at the ends of their range, brackets, quotation marks, separators, other scripts.
const PIECES: [&[u8]; 32] = [
    b"NaN",
    b"-inf",
    b"1e400",
    b"1e300",
    b"-1",
    b"0",
    b"1e-320",
    b"18446744073709551616",
    b"-0.0",
    b"(",
    b")",
    b"[",
    b"]",
    b"\"",
    b"r#\"",
    b"/*",
    b"//",
    b"#!",
    b",",
    b";",
    b"\t",
    b"|",
    b"\n",
    b"\r",
    b"\0",
    b":",
    b"\xff",
    b"\xef\xbb\xbf",
    "é😀".as_bytes(),
    b"Some(",
    b"()",
    b"                                                                ",
];

/// One to six changes: bytes flipped, cut out, repeated, exchanged, pieces put in.
fn mutated(seed: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut out = seed.to_vec();
    for _ in 0..=dice.below(6) {
        let at = dice.below(out.len() + 1);
        let to = (at + dice.below(24)).min(out.len());
        match dice.below(8) {
            0 if at < out.len() => out[at] ^= 1 << dice.below(8),
            1 => drop(out.drain(at..to)),
            2 => {
                let again = out[at..to].to_vec();
                out.splice(at..at, again);
            }
            3 => out.truncate(at),
            4 => {
                let there = dice.below(out.len() + 1);
                let piece = out[at..to].to_vec();
                out.splice(there..there, piece);
            }
            // A whole number goes, another comes.
            5 => {
                let number = |b: &u8| b.is_ascii_digit() || *b == b'.' || *b == b'-';
                let from = out[at..].iter().position(number).map_or(at, |k| at + k);
                let end = out[from..].iter().position(|b| !number(b)).map_or(out.len(), |k| from + k);
                out.splice(from..end, dice.of(&PIECES[..9]).iter().copied());
            }
            _ => drop(out.splice(at..at, dice.of(&PIECES).iter().copied())),
        }
    }
    out
}

/// How many mutations of a corpus, and from which seed: `of`, or so many percent of them as `STYLET_MUTATIONS` says, or for what parses
/// text as many as `STYLET_MUTATIONS_EACH` says; where `STYLET_MUTATED` names parsers (`"gates shard"`), those alone so many.
fn amount(name: &str, of: u64, what: What) -> (u64, u64) {
    let set = |name: &str| std::env::var(name).ok().and_then(|x| x.parse::<u64>().ok());
    let share = of * set("STYLET_MUTATIONS").unwrap_or(100) / 100;
    let asked =
        std::env::var("STYLET_MUTATED").map_or(true, |names| names.split_whitespace().any(|n| n == name));
    let each = set("STYLET_MUTATIONS_EACH").filter(|_| what == What::Text && asked);
    (each.unwrap_or(share), set("STYLET_MUTATION_SEED").unwrap_or(1))
}

/// What is fed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// A parser of text.
    Text,
    /// What computes with what was read: not as many.
    Slow,
}

/// Longest that one input may take.
const PATIENCE: Duration = Duration::from_secs(5);

/// Feeds mutations of the corpus to `parser`; what makes it panic or linger is kept in `target/mutated` and named.
pub fn hold(name: &str, of: u64, corpus: &[Vec<u8>], parser: impl Fn(&[u8]) -> bool) {
    let accepted = feed(name, (of, What::Text), corpus, parser);
    // Mutations that all fail in the first line would test nothing.
    assert!(
        accepted.0 * 200 > accepted.1 && accepted.0 < accepted.1,
        "{name}: {} of {} mutations are accepted",
        accepted.0,
        accepted.1
    );
}

/// The same without asking how many are accepted; returns how many, and of how many.
pub fn feed(
    name: &str,
    (of, what): (u64, What),
    corpus: &[Vec<u8>],
    parser: impl Fn(&[u8]) -> bool,
) -> (u64, u64) {
    let (count, seed) = amount(name, of, what);
    for (k, whole) in corpus.iter().enumerate() {
        assert!(parser(whole), "{name}: {k} of the corpus itself is accepted");
    }
    let (mut accepted, mut longest, all) = (0_u64, (Duration::ZERO, 0), Instant::now());
    for k in 0..count {
        let mut dice = Dice(seed.wrapping_mul(0x2545_F491_4F6C_DD1D).wrapping_add(k));
        let from = &corpus[dice.below(corpus.len())];
        let input = mutated(from, &mut dice);
        let begun = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| parser(&input)));
        let took = begun.elapsed();
        longest = longest.max((took, k));
        if outcome.is_err() || took > PATIENCE {
            let folder = root().join("target/mutated");
            let _ = std::fs::create_dir_all(&folder);
            let file = folder.join(format!("{name}-{seed}-{k}"));
            let _ = std::fs::write(&file, &input);
            panic!("{name}: mutation {k} of seed {seed} panics or takes {took:?}: {}", file.display());
        }
        accepted += u64::from(outcome.unwrap_or(false));
    }
    let rate = count as f64 / all.elapsed().as_secs_f64();
    println!(
        "{name}: {count} inputs, {accepted} accepted, {rate:.0}/s, the slowest {:.1} ms (mutation {})",
        1e3 * longest.0.as_secs_f64(),
        longest.1
    );
    (accepted, count)
}
