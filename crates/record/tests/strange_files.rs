//! Promise: a file as an instrument writes it is read, or refused with all obstacles and the remedy: one case of every kind with
//! fixed parameters, and more with parameters that are drawn from a seed.
#![allow(clippy::panic)] // with the name of the case

use std::fmt::Write as _;
use std::path::Path;
use stylet_record::inspect::{InspectOptions, inspect, inspect_bytes};
use stylet_record::{ColumnMap, ReadOptions, Recording, read_csv, read_csv_bytes};

/// An insertion: air, loading with ripple, rupture at 8 s, hold, retraction.
struct Insertion {
    t: Vec<f64>,
    x: Vec<f64>,
    f: Vec<f64>,
}

struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n.max(1)
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }
}

fn insertion(rate_hz: f64, random: &mut Random) -> Insertion {
    let count = (20.0 * rate_hz) as usize;
    let t: Vec<f64> = (0..count).map(|k| k as f64 / rate_hz).collect();
    let x: Vec<f64> =
        t.iter().map(|t| if *t < 15.0 { -0.01 + 0.003 * t } else { 0.035 - 0.005 * (t - 15.0) }).collect();
    let f = x
        .iter()
        .zip(&t)
        .map(|(x, t)| {
            let noise = 0.01 * (random.below(2001) as f64 / 1000.0 - 1.0);
            60.0 * x.max(0.0) - if *t > 8.0 { 0.4 } else { 0.0 } + noise
        })
        .collect();
    Insertion { t, x, f }
}

/// What must come out.
enum Expected<'a> {
    /// Read with this map, all samples.
    Read(&'a str),
    /// Read with this map and repair, all samples.
    Repaired(&'a str),
    /// Refused with these words; `inspect` writes a map with which the file is read.
    RefusedThenMapped(&'a [&'a str]),
    /// Refused with these words.
    Refused(&'a [&'a str]),
}

fn options(map: &str, repair: bool) -> ReadOptions {
    let columns = if map.is_empty() { None } else { Some(ron::from_str::<ColumnMap>(map).expect(map)) };
    ReadOptions { columns, repair }
}

fn same(name: &str, read: &Recording, wanted: &Insertion) {
    assert_eq!(read.len(), wanted.t.len(), "{name}");
    for k in 0..read.len() {
        assert!(
            (read.time_s[k] - read.time_s[0] - (wanted.t[k] - wanted.t[0])).abs() < 2e-6,
            "{name}: time {k}: {}",
            read.time_s[k]
        );
        assert!(
            (read.position_m[k] - wanted.x[k]).abs() < 2e-7,
            "{name}: position {k}: {}",
            read.position_m[k]
        );
        assert!((read.force_n[k] - wanted.f[k]).abs() < 1e-4, "{name}: force {k}: {}", read.force_n[k]);
    }
}

fn judge(name: &str, bytes: &[u8], wanted: &Insertion, expected: Expected<'_>) {
    let folder = std::env::temp_dir().join(format!("stylet-strange-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join("log.csv");
    std::fs::write(&path, bytes).expect("written");
    let refused = |words: &[&str]| {
        let error = read_csv(&path, &ReadOptions::default()).map(|_| ()).expect_err(name).to_string();
        for word in words.iter().chain(&["stylet inspect", "--write-map map.ron"]) {
            assert!(error.contains(word), "{name}: {word:?} is missing in {error}");
        }
    };
    match expected {
        Expected::Read(map) | Expected::Repaired(map) => {
            let repair = matches!(expected, Expected::Repaired(_));
            let (read, _) =
                read_csv(&path, &options(map, repair)).unwrap_or_else(|error| panic!("{name}: {error}"));
            same(name, &read, wanted);
        }
        Expected::RefusedThenMapped(words) => {
            refused(words);
            let found = inspect(&path, &InspectOptions::default()).expect(name);
            let options =
                ReadOptions { columns: Some(ron::from_str(&found.to_ron()).expect(name)), repair: false };
            let (read, _) = read_csv(&path, &options)
                .unwrap_or_else(|error| panic!("{name}: {error}\n{}", found.to_ron()));
            same(name, &read, wanted);
        }
        Expected::Refused(words) => refused(words),
    }
    std::fs::remove_dir_all(&folder).expect("removed");
}

fn table(header: &str, separator: &str, columns: &[&[f64]], number: impl Fn(usize, f64) -> String) -> String {
    let mut out = header.to_owned();
    for row in 0..columns[0].len() {
        let fields: Vec<String> =
            columns.iter().enumerate().map(|(at, column)| number(at, column[row])).collect();
        let _ = writeln!(out, "{}", fields.join(separator));
    }
    out
}

fn plain(_: usize, x: f64) -> String {
    format!("{x:?}")
}

fn scaled(values: &[f64], by: f64) -> Vec<f64> {
    values.iter().map(|v| v * by).collect()
}

/// All kinds with one set of parameters.
fn run_all(seed: u64) {
    let random = &mut Random(seed);
    let rate = random.of(&[50.0, 100.0, 200.0]);
    let i = insertion(rate, random);
    let (t, x, f) = (&i.t[..], &i.x[..], &i.f[..]);
    let name = |kind: &str| format!("{kind}-{seed}");

    // Preamble, units, decimal comma, code page.
    let comma =
        |digits: usize| move |_: usize, x: f64| format!("\"{}\"", format!("{x:.digits$}").replace('.', ","));
    let (words, units, factors) = random.of(&[
        (["Czas", "Przemieszczenie", "Siła"], ["(s)", "(mm)", "(N)"], [1.0, 1e3, 1.0]),
        (["Zeit", "Weg", "Kraft"], ["ms", "µm", "mN"], [1e3, 1e6, 1e3]),
        (["Time", "Extension", "Load"], ["[s]", "[cm]", "[kgf]"], [1.0, 1e2, 1.0 / 9.80665]),
    ]);
    let preamble: String = (0..random.below(5)).map(|k| format!("\"Probe {k}\";\"7\"\r\n")).collect();
    let header = format!("{preamble}\r\n\"{}\"\r\n\"{}\"\r\n", words.join("\";\""), units.join("\";\""));
    let columns = [scaled(t, factors[0]), scaled(x, factors[1]), scaled(f, factors[2])];
    let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let text = table(&header, ";", &columns, comma(7)).replace('\n', "\r\n").replace("\r\r", "\r");
    let (cp1250, _, lossy) = encoding_rs::WINDOWS_1250.encode(&text);
    assert!(!lossy);
    judge(&name("preamble"), &cp1250, &i, Expected::Read(""));
    let by_name = format!(r#"Columns(time: (name: "{}"), force: (name: "{}"))"#, words[0], words[2]);
    judge(&name("preamble-map"), &cp1250, &i, Expected::Read(&by_name));

    // UTF-16 with units in the names.
    let names = random.of(&["Time [s]\tPosition [mm]\tForce [kN]\n", "Time (s)\tpos_mm\tFz / kN\n"]);
    let columns = [t, &scaled(x, 1e3), &scaled(f, 1e-3)];
    let text = table(names, "\t", &columns, |_, x| format!("{x:.9}"));
    let little = random.below(2) == 0;
    let mut utf16: Vec<u8> = if random.below(2) == 0 {
        if little { vec![0xFF, 0xFE] } else { vec![0xFE, 0xFF] }
    } else {
        Vec::new()
    };
    utf16.extend(text.encode_utf16().flat_map(|u| if little { u.to_le_bytes() } else { u.to_be_bytes() }));
    judge(&name("utf16"), &utf16, &i, Expected::Read(""));

    // Thousands.
    let millinewtons = scaled(f, 1e3 * random.of(&[1.0, 10.0]));
    let factor = 1e-3 * f[f.len() / 2] / (1e-3 * millinewtons[f.len() / 2]);
    let grouped =
        |at: usize, x: f64| if at == 2 { format!("\"{}\"", with_thousands(x)) } else { format!("{x:?}") };
    let map = format!(r#"Columns(force: (name: "force", scale: {factor:?}))"#);
    judge(
        &name("thousands"),
        table("time_s,position_m,force\n", ",", &[t, x, &millinewtons], grouped).as_bytes(),
        &i,
        Expected::Read(&map),
    );

    // Comments, blanks, and no names.
    let mark = random.of(&["#", "%", "# #"]);
    let header = format!("{mark} time_s position_m force_n\n");
    judge(
        &name("blanks"),
        table(&header, random.of(&[" ", "   ", "\t "]), &[t, x, f], plain).as_bytes(),
        &i,
        Expected::Read(""),
    );
    let end = random.of(&["", ",", ", "]);
    let nameless = table("", ",", &[t, x, f], plain).replace('\n', &format!("{end}\n"));
    judge(
        &name("nameless"),
        nameless.as_bytes(),
        &i,
        Expected::RefusedThenMapped(&["the header is missing", "column: 1"]),
    );
    judge(
        &name("numbers"),
        nameless.as_bytes(),
        &i,
        Expected::Read("Columns(time: (column: 1), position: (column: 2), force: (column: 3))"),
    );

    // No time, or a sample number.
    let rate_map = format!("Columns(rate_hz: {rate})");
    let without = table("position_m,force_n,unused\n", ",", &[x, f, &scaled(f, 0.0)], plain);
    judge(&name("no-time"), without.as_bytes(), &i, Expected::Refused(&["time_s", "rate_hz"]));
    judge(&name("rate"), without.as_bytes(), &i, Expected::Read(&rate_map));
    let first = random.below(1000) as f64;
    let numbers: Vec<f64> = (0..t.len()).map(|k| k as f64 + first).collect();
    let header = random.of(&["time_s,position_m,force_n\n", "Time [s],position_m,force_n\n"]);
    let counted = table(header, ",", &[&numbers, x, f], plain);
    judge(&name("counter"), counted.as_bytes(), &i, Expected::Refused(&["counts the samples", "rate_hz"]));
    let column = if header.starts_with('T') { "Time [s]" } else { "time_s" };
    judge(
        &name("counter-rate"),
        counted.as_bytes(),
        &i,
        Expected::Read(&format!("Columns(time: (name: {column:?}), rate_hz: {rate})")),
    );

    // Clocks since 1970, dates.
    let (per_s, unit) = random.of(&[(1e9, "nanoseconds"), (1e6, "microseconds"), (1e3, "milliseconds")]);
    let epoch = |at: usize, x: f64| {
        if at == 0 { format!("{}", ((1.7e9 + x) * per_s).round() as i64) } else { format!("{x:?}") }
    };
    judge(
        &name("epoch"),
        table("time_s,position_m,force_n\n", ",", &[t, x, f], epoch).as_bytes(),
        &i,
        Expected::RefusedThenMapped(&[unit, "1970"]),
    );
    let day = random.of(&["2026-01-01T", "2026-01-01 ", "01.01.2026 "]);
    let zone = random.of(&["", "Z", "+01:00"]);
    let date = |at: usize, x: f64| {
        if at == 0 {
            format!("{day}10:{:02}:{:06.3}{zone}", (x / 60.0) as u32, x % 60.0)
        } else {
            format!("{x:?}")
        }
    };
    judge(
        &name("date"),
        table("stamp,position_m,force_n\n", ",", &[t, x, f], date).as_bytes(),
        &i,
        Expected::Read(""),
    );

    // Units by magnitude are proposed, never applied.
    for (what, columns, words, unit) in [
        ("grams", [t.to_vec(), x.to_vec(), scaled(f, 1e3 / 9.80665)], "gram-force", 0.00980665),
        ("inches", [t.to_vec(), scaled(x, 1.0 / 0.0254), f.to_vec()], "inch", 0.0254),
        ("ms", [scaled(t, 1e3), x.to_vec(), f.to_vec()], "ms", 1e-3),
    ] {
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let text = table("time_s,position_m,force_n\n", ",", &columns, plain);
        let path = Path::new("log.csv");
        let found = inspect_bytes(text.as_bytes(), path, &InspectOptions::default()).expect(what);
        let remark = found
            .findings
            .iter()
            .find(|finding| finding.kind == "unit")
            .unwrap_or_else(|| panic!("{what}: {found:?}"));
        assert!(
            remark.message.contains(words) && found.to_ron().contains(&format!("{unit:?}")),
            "{what}: {}",
            remark.message
        );
        let (read, _) =
            read_csv_bytes(text.as_bytes(), path, &ReadOptions { columns: Some(found.map), repair: false })
                .expect(what);
        same(what, &read, &i);
        let (raw, _) = read_csv_bytes(text.as_bytes(), path, &ReadOptions::default()).expect(what);
        assert_eq!(raw.force_n[40], columns[2][40], "{what}: nothing is converted without a map");
    }

    // Holes, alternating rows, bursts, a second run, a last row that is cut short.
    let hole = 200 + random.below(300);
    let missing = random.of(&["", "nan", "NA", "null"]);
    let mut text = "time_s,position_m,force_n\n".to_owned();
    for k in 0..t.len() {
        let force = if (hole..hole + 3).contains(&k) { missing.to_owned() } else { format!("{:?}", f[k]) };
        let _ = writeln!(text, "{:?},{:?},{force}", t[k], x[k]);
    }
    text.push_str("19.9");
    let keep = |values: &[f64]| {
        values.iter().enumerate().filter(|(k, _)| !(hole..hole + 3).contains(k)).map(|(_, v)| *v).collect()
    };
    judge(
        &name("holes"),
        text.as_bytes(),
        &Insertion { t: keep(t), x: keep(x), f: keep(f) },
        Expected::Read(""),
    );
    let (mut text, late) = ("time_s,position_m,force_n\n".to_owned(), 0.3 / rate);
    for k in 0..t.len() {
        let _ = writeln!(text, "{:?},{:?},\n{:?},,{:?}", t[k], x[k], t[k] + late, f[k]);
    }
    let at = |k: usize| x[k] + 0.3 * (x[k + 1] - x[k]);
    let n = t.len() - 1;
    let wanted = Insertion { t: t[..n].to_vec(), x: (0..n).map(at).collect(), f: f[..n].to_vec() };
    judge(&name("alternating"), text.as_bytes(), &wanted, Expected::Read(""));
    let per_burst = random.of(&[2, 4, 5, 10]);
    let stamps: Vec<f64> = (0..t.len()).map(|k| t[k / per_burst * per_burst]).collect();
    let text = table("time_s,position_m,force_n\n", ",", &[&stamps, x, f], plain);
    judge(&name("bursts"), text.as_bytes(), &i, Expected::Refused(&["bursts", "--repair"]));
    judge(&name("bursts-repaired"), text.as_bytes(), &i, Expected::Repaired(""));
    let part = t.len() - random.below(t.len() / 2);
    let twice = |values: &[f64]| [values, &values[..part]].concat();
    let text = table("time_s,position_m,force_n\n", ",", &[&twice(t), &twice(x), &twice(f)], plain);
    let line = format!("line {}", t.len() + 2);
    judge(&name("two-runs"), text.as_bytes(), &i, Expected::Refused(&["second recording", &line]));
    let error = read_csv_bytes(text.as_bytes(), Path::new("log.csv"), &options("", true))
        .map(|_| ())
        .expect_err("two runs");
    assert!(error.to_string().contains(&line), "{error}");
}

fn with_thousands(x: f64) -> String {
    let text = format!("{:.4}", x.abs());
    let (whole, fraction) = text.split_once('.').expect("a point");
    let mut grouped = String::new();
    for (at, digit) in whole.chars().enumerate() {
        if at > 0 && (whole.len() - at).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    format!("{}{grouped}.{fraction}", if x < 0.0 { "-" } else { "" })
}

#[test]
fn every_kind_of_file_is_read_or_refused_as_it_should_be() {
    run_all(1);
}

#[test]
fn the_same_kinds_with_drawn_parameters_are_too() {
    (2..12).for_each(run_all);
}

#[test]
fn position_and_force_of_two_files_are_joined_by_time() {
    for seed in 20..24 {
        let random = &mut Random(seed);
        let i = insertion(100.0, random);
        let folder = std::env::temp_dir().join(format!("stylet-joined-{}-{seed}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let every = 1 + random.below(3);
        let some = |values: &[f64]| values.iter().step_by(every).copied().collect::<Vec<f64>>();
        let pose = table("time_s,position_m,zero\n", ",", &[&i.t, &i.x, &scaled(&i.x, 0.0)], plain);
        let force = table(
            "time_s,force_n,zero\n",
            ",",
            &[&some(&i.t), &some(&i.f), &scaled(&some(&i.f), 0.0)],
            plain,
        );
        std::fs::write(folder.join("pose.csv"), pose).expect("written");
        std::fs::write(folder.join("force.csv"), force).expect("written");
        let error = read_csv(folder.join("force.csv"), &ReadOptions::default())
            .map(|_| ())
            .expect_err("no position")
            .to_string();
        assert!(error.contains("position") && error.contains("file:"), "{error}");
        let map = options(r#"Columns(position: (file: "pose.csv", name: "position_m"))"#, false);
        let (read, _) = read_csv(folder.join("force.csv"), &map).expect("joined");
        same("joined", &read, &Insertion { t: some(&i.t), x: some(&i.x), f: some(&i.f) });
        // The other way round.
        let map = options(r#"Columns(force: (file: "force.csv", name: "force_n"))"#, false);
        let (read, _) = read_csv(folder.join("pose.csv"), &map).expect("joined");
        same("joined", &read, &Insertion { t: some(&i.t), x: some(&i.x), f: some(&i.f) });
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}

#[test]
fn three_components_are_projected_on_a_given_or_fitted_axis() {
    for (seed, axis) in [(30, [0.0, 0.6, 0.8]), (31, [0.48, -0.64, 0.6]), (32, [-1.0, 0.0, 0.0])] {
        let random = &mut Random(seed);
        let i = insertion(100.0, random);
        let along = |values: &[f64], k: usize| scaled(values, axis[k]);
        let columns =
            [along(&i.x, 0), along(&i.x, 1), along(&i.x, 2), along(&i.f, 0), along(&i.f, 1), along(&i.f, 2)];
        let mut all: Vec<&[f64]> = vec![&i.t];
        all.extend(columns.iter().map(Vec::as_slice));
        let text = table("time_s,x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n", ",", &all, |at, v| {
            if (1..4).contains(&at) { format!("{:?}", v * 1e3) } else { plain(at, v) }
        });
        let parts = r#"position: (names: ["x_mm", "y_mm", "z_mm"], scale: 1e-3), force: (names: ["fx_n", "fy_n", "fz_n"])"#;
        let given = format!(
            "Columns({parts}, axis: ({:?}, {:?}, {:?}))",
            2.0 * axis[0],
            2.0 * axis[1],
            2.0 * axis[2]
        );
        let (read, _) =
            read_csv_bytes(text.as_bytes(), Path::new("log.csv"), &options(&given, false)).expect("given");
        same("given", &read, &i);
        let (read, notes) = read_csv_bytes(
            text.as_bytes(),
            Path::new("log.csv"),
            &options(&format!("Columns({parts})"), false),
        )
        .expect("fitted");
        same("fitted", &read, &i);
        assert!(notes.iter().any(|note| note.message.contains("fitted")), "{notes:?}");
    }
}
