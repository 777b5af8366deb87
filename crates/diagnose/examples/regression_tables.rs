//! Regression tables of an exported challenge for sparse regression methods, and Stylet's answers: `cargo
//! run --release -p stylet-diagnose --example regression_tables -- CHALLENGE OUT`
//!
//! Per case `NNNN.json` (column names, times) with two tables, `NNNN.plain.f32` and `NNNN.white.f32`: the
//! residual of the fitted base law, its derivatives with respect to the base parameters, and the force that
//! every effect of the library adds at the start values of Stylet's search (for effects with a frequency or
//! a depth, at the two best). In standard deviations of the noise, plain or whitened; column after column,
//! little-endian. `NNNN.stylet.json` is the diagnosis. Existing files are kept, so that an interrupted run
//! can continue.
use serde_json::json;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;
use stylet_diagnose::base_law_fit::{PreparedRecordings, fit_base_law};
use stylet_diagnose::effect_start_values::effect_starts;
use stylet_diagnose::{NamedRecording, Options, assumptions_of, diagnose};
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::fit::{Fit, JacobianColumn};
use stylet_identify::likelihood::{FitData, residuals};
use stylet_identify::model::EffectTerm;
use stylet_identify::noise::Noise;
use stylet_identify::score_test::ScoreTest;
use stylet_record::{ReadOptions, read_csv};
use stylet_scenario::Scenario;
use stylet_tissue::{Proposal, general_effects};

type Error = Box<dyn std::error::Error>;

fn main() -> Result<(), Error> {
    let args: Vec<String> = std::env::args().collect();
    let [_, challenge, out] = &args[..] else { return Err("regression_tables CHALLENGE OUT".into()) };
    let out = Path::new(out);
    std::fs::create_dir_all(out)?;
    let mut cases: Vec<_> =
        std::fs::read_dir(Path::new(challenge).join("cases"))?.collect::<Result<_, _>>()?;
    cases.sort_by_key(std::fs::DirEntry::file_name);
    for case in &cases {
        let stem = out.join(case.file_name());
        let (about, answer) = (stem.with_extension("json"), stem.with_extension("stylet.json"));
        if about.exists() && answer.exists() {
            continue;
        }
        let (scenario, evidence) = read_case(&case.path())?;
        if !about.exists() {
            write_terms(&stem, &scenario, &evidence)?;
        }
        let start = Instant::now();
        let examined = diagnose(&scenario, &evidence, &Options::default(), |_| {})?;
        let mut answer_json = serde_json::to_value(&examined.diagnosis)?;
        answer_json["seconds"] = json!(start.elapsed().as_secs_f64());
        put(&answer, &serde_json::to_vec(&answer_json)?)?;
        println!("{} of {}", case.file_name().display(), cases.len());
    }
    Ok(())
}

/// Assumed scenario and recordings of a case.
fn read_case(folder: &Path) -> Result<(Scenario, Vec<NamedRecording>), Error> {
    let assumed = folder.join("assumed.ron");
    let scenario = Scenario::parse(&assumed.display().to_string(), &std::fs::read_to_string(&assumed)?)?;
    let mut evidence = Vec::new();
    for k in 1.. {
        let path = folder.join(format!("{k}.csv"));
        if !path.exists() {
            break;
        }
        let (recording, notes) = read_csv(&path, &ReadOptions::default())?;
        evidence.push(NamedRecording { name: format!("{k}.csv"), recording, notes });
    }
    Ok((scenario, evidence))
}

fn write_terms(stem: &Path, scenario: &Scenario, evidence: &[NamedRecording]) -> Result<(), Error> {
    let start = Instant::now();
    let blocks: Vec<BlockAverages> =
        evidence.iter().map(|e| BlockAverages::new(&e.recording, &[], BLOCK_S)).collect();
    let prepared = PreparedRecordings::new(Arc::new(assumptions_of(scenario)), blocks, 0.0);
    let (fit, data) = fit_base_law(&prepared).ok_or("no base fit")?;
    let base_s = start.elapsed().as_secs_f64();
    let chosen = terms(&fit, &data, &prepared);
    let plain = data.with_noise(Noise::white(data.noise.sd_n()));
    let again = residuals(&fit.model, &plain).ok_or("no replay")?;
    let (names, groups) = table(&fit, &data, &chosen, &stem.with_extension("white.f32"))?;
    let as_plain = Fit { residuals: again, ..fit };
    table(&as_plain, &plain, &chosen, &stem.with_extension("plain.f32"))?;
    let about = json!({
        "recordings": evidence.len(),
        "rows": groups.len(),
        "recording": groups,
        "columns": names,
        "base_s": base_s,
        "terms_s": start.elapsed().as_secs_f64() - base_s,
    });
    put(&stem.with_extension("json"), &serde_json::to_vec(&about)?)
}

/// Effects at the start values of the search.
fn terms(fit: &Fit, data: &FitData, prepared: &PreparedRecordings) -> Vec<EffectTerm> {
    let screening = ScoreTest::new(fit, data);
    let lines = stylet_diagnose::tone_detection::detect_tones(fit, data);
    let mut out = Vec::new();
    for info in general_effects() {
        match info.proposal {
            Proposal::LinearColumns(groups) => {
                out.extend(groups.iter().flat_map(|g| g.iter()).map(|v| EffectTerm::new(info, v)));
            }
            Proposal::LayerFaces(shift) => {
                out.extend((1..fit.model.layers()).map(|l| EffectTerm::new(info, &[l as f64, shift])));
            }
            _ => {}
        }
    }
    let sought = effect_starts(&screening, prepared, &lines).into_iter().flatten().map(|s| s.choice);
    out.extend(sought.filter(|c| {
        matches!(c.info.proposal, Proposal::TissueMotion | Proposal::SpectralTone | Proposal::MembraneRupture)
    }));
    out
}

/// Writes a table; returns the effect of every column without the residual (`None` for base parameters) and
/// the recording of every row (offset by the number of recordings for rupture rows).
fn table(
    fit: &Fit,
    data: &FitData,
    terms: &[EffectTerm],
    path: &Path,
) -> Result<(Vec<&'static str>, Vec<usize>), Error> {
    let screening = ScoreTest::new(fit, data);
    let (recordings, shared) = (data.recording_count(), screening.linearization.shared.len());
    let mut names = Vec::new();
    let mut columns: Vec<Vec<f64>> = vec![rows(&screening.linearization.residual, |_| true)];
    for (k, column) in screening.linearization.columns.iter().enumerate() {
        // A random effect changes one recording only.
        for own in 0..if k < shared { 1 } else { recordings } {
            columns.push(rows(column, |r| k < shared || r == own));
            names.push("");
        }
    }
    for term in terms {
        if let Some(column) = screening.effect_column(term) {
            columns.push(rows(&column, |_| true));
            names.push(term.info.id);
        }
    }
    let rest = &screening.linearization.residual;
    let of = |parts: &[Vec<f64>], from: usize| -> Vec<usize> {
        parts.iter().enumerate().flat_map(|(r, x)| vec![from + r; x.len()]).collect()
    };
    let groups = [of(&rest.innovations, 0), of(&rest.rupture_rows, recordings)].concat();
    let bytes: Vec<u8> = columns.into_iter().flatten().flat_map(|x| (x as f32).to_le_bytes()).collect();
    put(path, &bytes)?;
    Ok((names, groups))
}

/// Rows of a column: blocks by recording, then ruptures.
fn rows(column: &JacobianColumn, which: impl Fn(usize) -> bool) -> Vec<f64> {
    let mut out = Vec::new();
    for parts in [&column.innovations, &column.rupture_rows] {
        for (r, part) in parts.iter().enumerate() {
            out.extend(part.iter().map(|x| if which(r) && x.is_finite() { *x } else { 0.0 }));
        }
    }
    out
}

/// Atomic write: temporary file, then rename.
fn put(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let mut temporary = path.as_os_str().to_owned();
    temporary.push(".part");
    std::fs::write(&temporary, bytes)?;
    std::fs::rename(&temporary, path)?;
    Ok(())
}
