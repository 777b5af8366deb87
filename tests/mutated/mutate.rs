//! Mutation fuzzing of parsers with a seeded generator.

use super::support::root;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// SplitMix64, for reproducible mutations.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    pub fn pick<'a, T: ?Sized>(&mut self, all: &[&'a T]) -> &'a T {
        all[self.below(all.len())]
    }
}

/// Inserted tokens: numbers at the ends of their range, brackets, quotation marks, separators, other scripts.
const TOKENS: [&[u8]; 32] = [
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

/// One to six random changes: bytes flipped, overwritten, removed, repeated, exchanged, tokens inserted.
fn mutated(seed: &[u8], random: &mut Random) -> Vec<u8> {
    let mut out = seed.to_vec();
    for _ in 0..=random.below(6) {
        let at = random.below(out.len() + 1);
        let to = (at + random.below(24)).min(out.len());
        match random.below(9) {
            0 if at < out.len() => out[at] ^= 1 << random.below(8),
            1 => drop(out.drain(at..to)),
            2 => {
                let again = out[at..to].to_vec();
                out.splice(at..at, again);
            }
            3 => out.truncate(at),
            4 => {
                let there = random.below(out.len() + 1);
                let piece = out[at..to].to_vec();
                out.splice(there..there, piece);
            }
            // Replaces a number.
            5 => {
                let number = |b: &u8| b.is_ascii_digit() || *b == b'.' || *b == b'-';
                let from = out[at..].iter().position(number).map_or(at, |k| at + k);
                let end = out[from..].iter().position(|b| !number(b)).map_or(out.len(), |k| from + k);
                out.splice(from..end, random.pick(&TOKENS[..9]).iter().copied());
            }
            // Replaces bytes of a binary number.
            6 => {
                let byte = [0, 0x7F, 0xFF, random.next() as u8][random.below(4)];
                let end = (at + 1 + random.below(4)).min(out.len());
                out[at..end].fill(byte);
            }
            _ => drop(out.splice(at..at, random.pick(&TOKENS).iter().copied())),
        }
    }
    out
}

/// Number of mutations and seed. The number is `default`, scaled by `STYLET_MUTATIONS` (in percent, 10 if not set) or replaced for text parsers by
/// `STYLET_MUTATIONS_EACH`; `STYLET_MUTATED` (`"gates shard"`) restricts the latter to some parsers.
fn amount(name: &str, default: u64, target: Target) -> (u64, u64) {
    let set = |name: &str| std::env::var(name).ok().and_then(|x| x.parse::<u64>().ok());
    let share = default * set("STYLET_MUTATIONS").unwrap_or(10) / 100;
    let selected =
        std::env::var("STYLET_MUTATED").map_or(true, |names| names.split_whitespace().any(|n| n == name));
    let each = set("STYLET_MUTATIONS_EACH").filter(|_| target == Target::Text && selected);
    (each.unwrap_or(share), set("STYLET_MUTATION_SEED").unwrap_or(1))
}

/// Kind of target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// A parser of text.
    Text,
    /// Computation with the parsed input; fewer mutations.
    Slow,
}

/// Most time per input.
const MAX_DURATION: Duration = Duration::from_secs(5);

/// Runs `parser` on mutations of the corpus, some of which must be accepted. An input that panics or takes too long is stored
/// in `target/mutated` and reported.
pub fn fuzz(name: &str, default: u64, corpus: &[Vec<u8>], parser: impl Fn(&[u8]) -> bool) {
    let accepted = fuzz_any(name, (default, Target::Text), corpus, parser);
    // If all mutations failed, only the first line would be tested.
    assert!(
        accepted.0 * 200 > accepted.1 && accepted.0 < accepted.1,
        "{name}: {} of {} mutations are accepted",
        accepted.0,
        accepted.1
    );
}

/// [`fuzz`] without a condition on accepted mutations; returns their number and the total.
pub fn fuzz_any(
    name: &str,
    (default, target): (u64, Target),
    corpus: &[Vec<u8>],
    parser: impl Fn(&[u8]) -> bool,
) -> (u64, u64) {
    let (count, seed) = amount(name, default, target);
    for (k, input) in corpus.iter().enumerate() {
        assert!(parser(input), "{name}: {k} of the corpus itself is accepted");
    }
    let (mut accepted, mut longest, all) = (0_u64, (Duration::ZERO, 0), Instant::now());
    for k in 0..count {
        let mut random = Random(seed.wrapping_mul(0x2545_F491_4F6C_DD1D).wrapping_add(k));
        let from = &corpus[random.below(corpus.len())];
        let input = mutated(from, &mut random);
        let begun = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| parser(&input)));
        let took = begun.elapsed();
        longest = longest.max((took, k));
        if outcome.is_err() || took > MAX_DURATION {
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
