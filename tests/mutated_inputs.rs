//! Promise: no input makes a parser panic or run away, and whatever a parser lets through is what it promises. A hundred thousand
//! mutations of a small corpus per run of the tests; `tests/mutate_for.sh SECONDS` goes on with other seeds and keeps what it finds.

mod support;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};
use stylet_record::{ColumnMap, ReadOptions, assess, read_csv_bytes};
use stylet_scenario::{EnhanceFile, Scenario, parse};
use stylet_sweep::gate::GatesFile;
use stylet_sweep::{Sweep, SweepFile};
use support::root;

/// SplitMix64: the same mutations everywhere.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.roll() % n.max(1) as u64) as usize
    }

    fn of<'a, T: ?Sized>(&mut self, all: &[&'a T]) -> &'a T {
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

/// How many mutations of each corpus, and from which seed.
fn amount(of: u64) -> (u64, u64) {
    let set = |name: &str| std::env::var(name).ok().and_then(|x| x.parse::<u64>().ok());
    (of * set("STYLET_MUTATIONS").unwrap_or(100) / 100, set("STYLET_MUTATION_SEED").unwrap_or(1))
}

/// Longest that one input may take.
const PATIENCE: Duration = Duration::from_secs(5);

/// Feeds mutations of the corpus to `parser`; what makes it panic or linger is kept in `target/mutated` and named.
fn hold(name: &str, of: u64, corpus: &[Vec<u8>], parser: impl Fn(&[u8]) -> bool) {
    let (count, seed) = amount(of);
    assert!(corpus.iter().all(|whole| parser(whole)), "{name}: the corpus itself is accepted");
    let mut accepted = 0_u64;
    for k in 0..count {
        let mut dice = Dice(seed.wrapping_mul(0x2545_F491_4F6C_DD1D).wrapping_add(k));
        let from = &corpus[dice.below(corpus.len())];
        let input = mutated(from, &mut dice);
        let begun = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| parser(&input)));
        let took = begun.elapsed();
        if outcome.is_err() || took > PATIENCE {
            let folder = root().join("target/mutated");
            let _ = std::fs::create_dir_all(&folder);
            let file = folder.join(format!("{name}-{seed}-{k}"));
            let _ = std::fs::write(&file, &input);
            panic!("{name}: mutation {k} of seed {seed} panics or takes {took:?}: {}", file.display());
        }
        accepted += u64::from(outcome.unwrap_or(false));
    }
    // Mutations that all fail in the first line would test nothing.
    assert!(
        accepted * 200 > count && accepted < count,
        "{name}: {accepted} of {count} mutations are accepted"
    );
}

fn shipped(folder: &str, most: u64) -> Vec<Vec<u8>> {
    let files = std::fs::read_dir(root().join(folder)).expect("shipped files").flatten().map(|e| e.path());
    let mut files: Vec<_> = files.filter(|p| p.extension().is_some_and(|e| e == "ron")).collect();
    files.sort();
    let all = files.iter().filter_map(|p| std::fs::read(p).ok());
    all.filter(|text| (text.len() as u64) < most).collect()
}

/// Parses, and draws the error as the command would.
fn told<T>(result: Result<T, stylet_scenario::InputError>) -> Option<T> {
    result
        .map_err(|error| {
            let drawn = format!("{:?}", miette::Report::new(error));
            assert!(!drawn.is_empty());
        })
        .ok()
}

#[test]
fn recordings_are_read_or_refused_and_what_is_read_keeps_its_promises() {
    let rows = |delimiter: char, end: &str| {
        let mut text = format!("time_s{delimiter}position_m{delimiter}force_n{end}");
        for i in 0..70 {
            let t = 0.01 * f64::from(i);
            text += &format!("{t:.3}{delimiter}{:.5}{delimiter}{:.3}{end}", 0.003 * t, 0.5 * t * t);
        }
        text.into_bytes()
    };
    let corpus = [
        rows(',', "\n"),
        rows(';', "\r\n"),
        rows('\t', "\n"),
        rows('|', "\n"),
        b"\xef\xbb\xbf\n\"time_s\",\"velocity_mps\", force_n,position_m,extra\n0,1,2,3,x\n1,1,2,4,\"y,z\"\n"
            .to_vec(),
    ];
    for repair in [false, true] {
        let options = ReadOptions { columns: None, repair };
        hold(if repair { "repaired" } else { "recording" }, 20_000, &corpus, |bytes| {
            match read_csv_bytes(bytes, Path::new("a.csv"), &options) {
                Ok((recording, notes)) => {
                    recording.check().expect("what is read is checked");
                    assert!(notes.iter().chain(&assess(&recording)).all(|note| !note.message.is_empty()));
                    let _ = stylet_record::thin(&recording);
                    true
                }
                Err(error) => {
                    assert!(error.to_string().contains("a.csv"), "{error}");
                    false
                }
            }
        });
    }
}

#[test]
fn scenarios_are_read_or_refused_with_their_place_and_what_is_read_can_be_simulated() {
    let corpus = shipped("scenarios", 4000);
    hold("scenario", 24_000, &corpus, |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return false };
        let Some(scenario) = told(Scenario::parse("a.ron", text)) else { return false };
        // What is accepted has a finite plan and can be written down again.
        assert!(scenario.motion.plan().is_none_or(|plan| plan.duration_s().is_finite()));
        let again = scenario.to_ron().expect("it can be written");
        assert!(Scenario::parse("again.ron", &again).is_ok(), "{again}");
        true
    });
}

#[test]
fn sweeps_gates_configurations_and_column_maps_are_read_or_refused_with_their_place() {
    let base = Scenario::load(&root().join("scenarios/three_layer_latex_constant.ron")).expect("a scenario");
    hold("sweep", 12_000, &shipped("scenarios/sweeps", 4000), |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return false };
        let Some(file) = told(parse::<SweepFile>("a.ron", text)) else { return false };
        let sweep = Sweep::new("a".to_owned(), file, base.clone()).map_err(|p| p.in_file("a.ron", text));
        told(sweep).is_some_and(|sweep| sweep.trials() > 0)
    });
    hold("gates", 6_000, &shipped("scenarios/gates", 9000), |bytes| {
        std::str::from_utf8(bytes).is_ok_and(|text| told(parse::<GatesFile>("a.ron", text)).is_some())
    });
    let enhance = [
        b"Enhance(cusum: (sigma_rupture_n: 0.3), model: KelvinVoigt, algorithm: Stylet)".to_vec(),
        b"Enhance(surface_m: 0.01, algorithm: Literal, model: MultiLayer)".to_vec(),
    ];
    hold("enhance", 8_000, &enhance, |bytes| {
        std::str::from_utf8(bytes).is_ok_and(|text| told(EnhanceFile::parse("a.ron", text)).is_some())
    });
    let maps = [b"Columns(time: (name: \"time\", scale: 1e-6), position: (name: \"pz\", scale: 1e-3), force: (name: \"fz\", offset: 0.1), velocity: (name: \"v\"))".to_vec()];
    hold("columns", 8_000, &maps, |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return false };
        let Some(map) = told(parse::<ColumnMap>("a.ron", text)) else { return false };
        let fits = map.check().is_ok();
        let options = ReadOptions { columns: Some(map), repair: false };
        let csv = b"time,pz,fz,v\n0,0,0,0\n10000,1,1,1\n20000,2,2,1\n";
        fits == read_csv_bytes(csv, Path::new("a.csv"), &options).is_ok() || fits
    });
    let samples = [
        b"0.01,0.001,0.2".to_vec(),
        b"0.02,0.002,0.3,0.1".to_vec(),
        br#"{"time_s":0.03,"position_m":0.003,"force_n":0.1}"#.to_vec(),
    ];
    hold("live", 6_000, &samples, |bytes| {
        let text = String::from_utf8_lossy(bytes);
        stylet_live::parse(1, &text).is_ok_and(|given| given.is_some())
    });
}
