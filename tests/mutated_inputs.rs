//! Promise: no input makes a parser panic or run away, and whatever a parser accepts is valid. Some hundred thousand mutations of a
//! small corpus per test run; `tests/mutate_for.sh SECONDS` continues with other seeds and keeps what it finds,
//! `STYLET_MUTATIONS_EACH=10000000` sets the number per text parser.

#[path = "mutated/mutate.rs"]
mod mutate;
use crate::support;

use mutate::{Random, Target, fuzz, fuzz_any};
use std::path::Path;
use std::str::from_utf8;
use stylet::{Diagnosis, DiagnosisInputs, Limits, NamedRecording};
use stylet_examine::challenge_export::AnswerKey;
use stylet_examine::{Answer, CaseOutcome, Plan};
use stylet_formula::{Formula, Unit};
use stylet_record::{ColumnMap, ReadOptions, Recording, Truth, assess, read_csv, read_csv_bytes};
use stylet_scenario::{EnhancerConfigFile, Motion, Scenario, motion_to_ron, parse};
use stylet_sweep::score_gate::{Baseline, GatesFile};
use stylet_sweep::shard::{self, ShardNumber};
use stylet_sweep::{Columns, Overrides, Sweep, SweepFile};
use stylet_tissue::{AnyEffect, ForceLaw, ForceLawState, general_effects};
use support::{Scratch, root};

fn shipped(folder: &str, most: u64) -> Vec<Vec<u8>> {
    let files = std::fs::read_dir(root().join(folder)).expect("shipped files").flatten().map(|e| e.path());
    let mut files: Vec<_> = files.filter(|p| p.extension().is_some_and(|e| e == "ron")).collect();
    files.sort();
    let all = files.iter().filter_map(|p| std::fs::read(p).ok());
    all.filter(|text| (text.len() as u64) < most).collect()
}

/// The result; an error is rendered as the command would.
fn accepted<T>(result: Result<T, stylet_scenario::InputError>) -> Option<T> {
    result
        .map_err(|error| {
            let drawn = format!("{:?}", miette::Report::new(error));
            assert!(!drawn.is_empty());
        })
        .ok()
}

#[test]
fn recordings_are_read_or_refused_and_what_is_read_is_valid() {
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
        fuzz(if repair { "repaired" } else { "recording" }, 20_000, &corpus, |bytes| {
            match read_csv_bytes(bytes, Path::new("a.csv"), &options) {
                Ok((recording, notes)) => {
                    recording.check().expect("a recording that was read is valid");
                    assert!(notes.iter().chain(&assess(&recording)).all(|note| !note.message.is_empty()));
                    let _ = stylet_record::downsample(&recording);
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
fn scenarios_are_read_or_refused_with_a_position_and_what_is_read_can_be_simulated() {
    let corpus = shipped("scenarios", 4000);
    fuzz("scenario", 24_000, &corpus, |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return false };
        let Some(scenario) = accepted(Scenario::parse("a.ron", text)) else { return false };
        // An accepted scenario has a finite plan and can be serialised.
        assert!(scenario.motion.plan().is_none_or(|plan| plan.duration_s().is_finite()));
        let again = scenario.to_ron().expect("it can be serialised");
        assert!(Scenario::parse("again.ron", &again).is_ok(), "{again}");
        true
    });
}

#[test]
fn sweeps_gates_configurations_and_column_maps_are_read_or_refused_with_a_position() {
    let base = Scenario::load(&root().join("scenarios/three_layer_latex_constant.ron")).expect("a scenario");
    fuzz("sweep", 12_000, &shipped("scenarios/sweeps", 4000), |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return false };
        let Some(file) = accepted(parse::<SweepFile>("a.ron", text)) else { return false };
        let sweep = Sweep::new("a".to_owned(), file, base.clone()).map_err(|p| p.in_file("a.ron", text));
        accepted(sweep).is_some_and(|sweep| sweep.trials() > 0)
    });
    fuzz("gates", 6_000, &shipped("scenarios/gates", 9000), |bytes| {
        std::str::from_utf8(bytes).is_ok_and(|text| accepted(parse::<GatesFile>("a.ron", text)).is_some())
    });
    let enhance = [
        b"Enhance(cusum: (sigma_rupture_n: 0.3), model: KelvinVoigt, algorithm: Stylet)".to_vec(),
        b"Enhance(surface_m: 0.01, algorithm: Literal, model: MultiLayer)".to_vec(),
    ];
    fuzz("enhance", 8_000, &enhance, |bytes| {
        std::str::from_utf8(bytes)
            .is_ok_and(|text| accepted(EnhancerConfigFile::parse("a.ron", text)).is_some())
    });
    let maps = [b"Columns(time: (name: \"time\", scale: 1e-6), position: (name: \"pz\", scale: 1e-3), force: (name: \"fz\", offset: 0.1), velocity: (name: \"v\"))".to_vec()];
    fuzz("columns", 8_000, &maps, |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return false };
        let Some(map) = accepted(parse::<ColumnMap>("a.ron", text)) else { return false };
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
    fuzz("live", 6_000, &samples, |bytes| {
        let text = String::from_utf8_lossy(bytes);
        stylet::live_stream::parse_line(1, &text).is_ok_and(|given| given.is_some())
    });
}

#[test]
fn formulas_are_compiled_or_refused_at_a_place_in_their_text() {
    let names = ["t", "z", "v", "a", "z_layer", "inserted", "elastic", "friction", "k", "v0", "q"];
    let units: Vec<Unit> = ["s", "m", "m/s", "m/s^2", "m", "m", "N", "N", "N/m", "m/s", "N"]
        .iter()
        .map(|unit| Unit::parse(unit).expect("a unit"))
        .collect();
    let corpus: Vec<Vec<u8>> = [
        "k * max(0, z_layer) * log(1 + abs(v)/v0)",
        "-q + elastic*(1 - exp(-t/2.5e0))",
        "if(v > 0, k*z, friction) * tanh((v/v0)^2) / sqrt(1 + (a/9.81)^2)",
        "sgn(v) * min(k*inserted, elastic) * sin(2*pi*t) - pow(2, 3) * sign(z) * atan(1)",
    ]
    .iter()
    .map(|text| text.as_bytes().to_vec())
    .collect();
    fuzz("formula", 40_000, &corpus, |bytes| {
        let Ok(text) = from_utf8(bytes) else { return false };
        let place = |e: stylet_formula::FormulaError| {
            assert!(e.start <= e.end && text.get(e.start..e.end).is_some(), "{text}: {e}");
            assert!(!e.message.is_empty());
        };
        match Formula::parse(text, &names) {
            Ok(formula) => {
                if let Err(error) = formula.expect_unit(&units, Unit::NEWTON) {
                    place(error);
                }
                let values = [2.0, 0.01, -0.003, 0.1, 0.004, 0.01, 0.4, f64::NAN, 1e300, 0.0, -1.0];
                for index in 0..names.len() {
                    let (value, _) = formula.program().evaluate_with_derivative(&values, index);
                    let again = formula.program().evaluate(&values);
                    assert!(
                        value.to_bits() == again.to_bits() || (value.is_nan() && again.is_nan()),
                        "{text}"
                    );
                }
                true
            }
            Err(error) => {
                place(error);
                false
            }
        }
    });
}

#[test]
fn custom_effects_are_compiled_or_refused_with_a_position() {
    let corpus = shipped("tests/custom_effects", 9000);
    // Every accepted definition stays in memory, hence a target of its own kind.
    let (accepted, total) = fuzz_any("custom", (3_000, Target::Slow), &corpus, |bytes| {
        let Ok(text) = from_utf8(bytes) else { return false };
        self::accepted(parse::<Vec<AnyEffect>>("a.ron", text)).is_some_and(|effects| {
            let again = stylet_scenario::ron_options().to_string(&effects).expect("it can be serialised");
            assert_eq!(parse::<Vec<AnyEffect>>("again.ron", &again).ok().as_ref(), Some(&effects), "{again}");
            true
        })
    });
    assert!(accepted > 0 && accepted < total, "{accepted} of {total}");
}

/// A scenario per effect of the library with typical parameters, as a diagnosis writes it as `extended.ron`.
fn extended() -> Vec<Vec<u8>> {
    let base = Scenario::load(&root().join("scenarios/three_layer_latex_constant.ron")).expect("a scenario");
    general_effects()
        .map(|entry| {
            let typical: Vec<f64> = entry.parameters.iter().map(|p| p.start).collect();
            let effects = AnyEffect::from_parameters(entry.id, &typical).into_iter().collect();
            Scenario { effects, ..base.clone() }.to_ron().expect("it can be serialised").into_bytes()
        })
        .collect()
}

fn read_again(text: &str) -> Option<Scenario> {
    accepted(Scenario::parse("extended.ron", text))
}

#[test]
fn extended_models_are_read_or_refused_and_their_force_law_handles_any_sample() {
    let corpus = extended();
    fuzz("extended", 6_000, &corpus, |bytes| from_utf8(bytes).ok().and_then(read_again).is_some());
    let (laws, _) = fuzz_any("law", (4_000, Target::Slow), &corpus, |bytes| {
        let Some(scenario) = from_utf8(bytes).ok().and_then(read_again) else { return false };
        let Ok(law) = ForceLaw::new(&scenario.tissue, &scenario.effects) else { return false };
        let mut random = Random(bytes.iter().fold(7, |sum, b| sum * 31 % 1_000_003 + u64::from(*b)));
        let (mut state, mut t, mut z) = (ForceLawState::default(), 0.0, -0.005);
        for _ in 0..200 {
            let odd = [f64::NAN, f64::INFINITY, -1e300, 1e300, 1e-320, -1.0, 0.0];
            let mut drawn =
                |usual: f64| if random.below(40) == 0 { odd[random.below(odd.len())] } else { usual };
            let (time_s, place_m, v) = (drawn(t), drawn(z), drawn(0.01));
            let force = law.step(&mut state, time_s, place_m, v, |_| {});
            let finite = time_s.is_finite() && place_m.is_finite() && v.is_finite();
            assert!(finite || force.total_n.is_nan(), "a sample that is not finite has a NaN force");
            (t, z) = (t + 0.005, z + 0.002 * (random.below(1000) as f64 / 1000.0 - 0.2));
        }
        true
    });
    assert!(laws > 0);
}

#[test]
fn data_sets_limits_and_motions_are_read_or_refused_with_a_position() {
    fuzz("data-set", 6_000, &shipped("scenarios/measured", 9000), |bytes| {
        from_utf8(bytes).is_ok_and(|text| {
            accepted(stylet_diagnose::repeated_insertions::dataset::Dataset::parse("a.ron", text))
                .is_some_and(|set| (1..=7).contains(&set.tissue.layers.len()))
        })
    });
    let limits =
        b"Limits(depth_m: 0.09, speed_mps: 0.008, acceleration_mps2: 0.1, duration_s: 90.0, force_n: 6.0)"
            .to_vec();
    fuzz("limits", 6_000, &[limits], |bytes| {
        from_utf8(bytes)
            .is_ok_and(|text| accepted(parse::<Limits>("a.ron", text)).is_some_and(|l| l.check().is_ok()))
    });
    let scenarios = shipped("scenarios/compare", 4000).into_iter().chain(shipped("scenarios", 4000));
    let scenarios: Vec<Scenario> = scenarios.filter_map(|s| read_again(from_utf8(&s).ok()?)).collect();
    let motions: Vec<Vec<u8>> =
        scenarios.iter().filter_map(|s| motion_to_ron(&s.motion).ok()).map(String::into_bytes).collect();
    let base = scenarios[0].clone();
    fuzz("motion", 6_000, &motions, |bytes| {
        let Ok(text) = from_utf8(bytes) else { return false };
        let Some(motion) = accepted(parse::<Motion>("a.ron", text)) else { return false };
        let moved = Scenario { motion, ..base.clone() };
        moved.check().is_ok() && moved.motion.plan().is_none_or(|plan| plan.duration_s().is_finite())
    });
}

#[test]
fn files_written_by_stylet_are_read_again_or_refused() {
    let scratch = Scratch::in_memory("mutated");
    let scenario = Scenario::parse("gel.ron", GEL).expect("a scenario");
    let run = stylet::simulate(&scenario).expect("it can be simulated");
    let evidence = [NamedRecording {
        name: "a".to_owned(),
        recording: run.simulation.recording.clone(),
        notes: Vec::new(),
    }];
    let diagnosis = stylet::diagnose(&scenario, &evidence, &stylet::DiagnoseOptions::default(), |_| {})
        .and_then(|d| d.json())
        .expect("a diagnosis");
    let whole = [diagnosis];
    fuzz("diagnosis", 6_000, &whole, |bytes| {
        let text = String::from_utf8_lossy(bytes);
        serde_json::from_str::<Diagnosis>(&text).is_ok() | Answer::from_json(&text).is_ok()
    });
    let inputs =
        br#"{"scenario":"/a/gel.ron","data":["/a/1.csv","/a/2.csv"],"columns":null,"repair":false}"#.to_vec();
    fuzz("inputs", 6_000, &[inputs], |bytes| serde_json::from_slice::<DiagnosisInputs>(bytes).is_ok());
    let baseline = std::fs::read(root().join("scenarios/gates/ci.baseline.json")).expect("it is shipped");
    fuzz("baseline", 6_000, &[baseline], |bytes| serde_json::from_slice::<Baseline>(bytes).is_ok());
    let cases = Plan { cases: 2, ..Plan::default() }.cases();
    let outcomes =
        stylet_examine::run_cases(&cases, None, &|_| Ok(Answer::none()), &|_, _| {}).expect("two cases");
    let lines: Vec<Vec<u8>> = outcomes.iter().filter_map(|o| serde_json::to_vec(o).ok()).collect();
    fuzz("journal", 6_000, &lines, |bytes| serde_json::from_slice::<CaseOutcome>(bytes).is_ok());
    let key = AnswerKey { generator_version: 1, cases: cases.iter().map(|id| (id.name(), *id)).collect() };
    let key = serde_json::to_vec_pretty(&key).expect("a key");
    fuzz("key", 6_000, &[key], |bytes| serde_json::from_slice::<AnswerKey>(bytes).is_ok());
    let mut few = run.simulation.recording.clone();
    few.time_s.truncate(4);
    few.position_m.truncate(4);
    few.force_n.truncate(4);
    few.velocity_mps.truncate(4);
    fuzz("recording.json", 6_000, &[serde_json::to_vec(&few).expect("a recording")], |bytes| {
        serde_json::from_slice::<Recording>(bytes).is_ok_and(|r| r.check().is_ok())
    });
    let truth = serde_json::to_vec(&Truth::default()).expect("a truth");
    fuzz_any("truth.json", (6_000, Target::Text), &[truth], |bytes| {
        serde_json::from_slice::<Truth>(bytes).is_ok_and(|t| t.check(0).is_ok())
    });
    // The following parsers read files.
    let folder = scratch.path().join("set");
    let mut set = stylet::OutputFiles::default();
    set.add("a.csv", "1");
    set.write(&folder).expect("a set");
    let manifest = folder.join("manifest.json");
    let whole = [std::fs::read(&manifest).expect("it is there")];
    fuzz_any("manifest", (2_000, Target::Text), &whole, |bytes| {
        std::fs::write(&manifest, bytes).is_ok()
            && stylet::output_folder::verify_manifest(&folder, &["a.csv"]).is_ok()
    });
    let csv = scratch.path().join("holes.csv");
    let rows = |delimiter: &str| {
        let rows =
            ["time_s", "position_m", "force_n", "0", "0", "NaN", "0.1", "1e-3", "inf", "0.2", "2e-3", "1"];
        let more = ["0.3", "3e-3", "nan", "0.4", "4e-3", "2", "0.5", "5e-3", "3"];
        let all: Vec<&str> = rows.iter().chain(&more).copied().collect();
        all.chunks(3).map(|row| row.join(delimiter) + "\n").collect::<String>().into_bytes()
    };
    fuzz_any("holes", (2_000, Target::Text), &[rows(","), rows(";"), rows("\t"), rows("|")], |bytes| {
        let options = ReadOptions { columns: None, repair: false };
        std::fs::write(&csv, bytes).is_ok()
            && read_csv(&csv, &options).is_ok_and(|(recording, _)| recording.check().is_ok())
    });
    let set = r#"Dataset(name: "two", recordings: ["two.csv"], split_by: ["specimen"],
        tissue: (layers: [(thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0)]))"#;
    let set =
        stylet_diagnose::repeated_insertions::dataset::Dataset::parse("a.ron", set).expect("a data set");
    let mut two = "specimen,time_s,position_m,force_n\n".to_owned();
    for i in 0..120 {
        let t = 0.01 * f64::from(i % 60);
        two += &format!("{},{t:.3},{:.5},{:.4}\n", i / 60, 0.003 * t, 0.5 * t * t);
    }
    let csv = scratch.path().join("two.csv");
    fuzz_any("specimens", (2_000, Target::Text), &[two.into_bytes()], |bytes| {
        std::fs::write(&csv, bytes).is_ok() && set.load_recordings(std::slice::from_ref(&csv), 1).is_ok()
    });
    let file = "Sweep(scenario: \"gel.ron\", trials: 3, vary: [(path: \"sensor.noise_n\", with: Uniform(0.01, 0.02))])";
    scratch.file("gel.ron", GEL);
    let sweep = Sweep::load(&scratch.file("sweep.ron", file), Overrides::default()).expect("a sweep");
    let (columns, number) = (Columns::new(&sweep), ShardNumber { shard: 1, of: 1 });
    let rows = stylet_sweep::run_trials(&sweep, &columns, 0..3, &|_| {}).expect("three trials");
    shard::write(&sweep, &columns, number, &rows, scratch.path()).expect("a shard");
    let place = number.path(scratch.path());
    let whole = [std::fs::read(&place).expect("it is there")];
    let bits = |rows: &[stylet_sweep::TrialRow]| -> Vec<u64> {
        rows.iter().flat_map(|r| r.values.iter().map(|x| x.to_bits()).chain([r.trial, r.seed])).collect()
    };
    fuzz_any("shard", (2_000, Target::Text), &whole, |bytes| {
        let written = std::fs::write(&place, bytes).is_ok();
        let found = shard::read(&sweep, &columns, number, scratch.path());
        assert!(found.as_ref().is_ok_and(|found| bits(found) == bits(&rows)) || found.is_err(), "other rows");
        written && found.is_ok()
    });
}

const GEL: &str = r#"Scenario(
    name: "one gel",
    tissue: (layers: [(thickness_m: 0.02, stiffness_n_per_m: 60.0, friction_ns_per_m2: 9000.0)]),
    motion: Constant(start_m: -0.004, velocity_mps: 0.008, duration_s: 0.8),
    sample_hz: 100.0,
    robot: Replay,
)"#;

#[test]
fn short_recordings_are_diagnosed_or_refused() {
    let scenario = Scenario::parse("gel.ron", GEL).expect("a scenario");
    let run = stylet::simulate(&scenario).expect("it can be simulated");
    let mut csv = Vec::new();
    stylet_record::write_csv(&run.simulation.recording, None, &[], &mut csv).expect("it can be serialised");
    let options = ReadOptions { columns: None, repair: true };
    let (found, of) = fuzz_any("diagnose", (1_000, Target::Slow), &[csv], |bytes| {
        let Ok((recording, notes)) = read_csv_bytes(bytes, Path::new("a.csv"), &options) else {
            return false;
        };
        let evidence = [NamedRecording { name: "a.csv".to_owned(), recording, notes }];
        match stylet::diagnose(&scenario, &evidence, &stylet::DiagnoseOptions::default(), |_| {}) {
            Ok(found) => found.json().is_ok() && found.extended_ron("gel.ron").is_ok(),
            Err(why) => !why.to_string().is_empty() && !matches!(why, stylet::Error::Internal(_)),
        }
    });
    assert!(found * 50 > of, "{found} of {of} are read");
}
