//! What repeats add to a diagnosis: errors by run, speed and part of an insertion, what varies, the data as they are.

use crate::diagnosis_json::DataQualityNote;
use crate::repeated_insertions::cross_validation::{HeldOutPrediction, PHASE_NAMES, PredictionScore};
use crate::repeated_insertions::diagnose_set::mean_speeds;
use crate::repeated_insertions::instrument_faults::{InstrumentReport, sampling_summary};
use crate::repeated_insertions::model_selection::ScoredModel;
use crate::repeated_insertions::nested_cross_validation::NestedCrossValidation;
use crate::repeated_insertions::start_values::SegmentedRecording;
use serde::Serialize;
use std::collections::BTreeMap;
use stylet_identify::model::NO_RUPTURE;
use stylet_record::{QualityKind, QualityNote};

/// What a speed's runs show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpeedReport {
    /// Mean speed of the advance (m/s).
    pub speed_mps: f64,
    /// Runs.
    pub recordings: usize,
    /// Mean of the other runs of this speed as the predictor (N); none for a single run.
    pub floor_n: Option<f64>,
    /// The same without the scatter of that mean itself.
    pub floor_unbiased_n: Option<f64>,
    /// Base law, this run left out (N).
    pub base_n: f64,
    /// Extended law, this run left out (N).
    pub model_n: f64,
    /// The same together with what the law leaves alike of the other runs of this speed (N).
    pub with_discrepancy_n: f64,
    /// Share of the samples of left-out runs within the 90 % band.
    pub coverage: f64,
    /// Extended law, all runs of this speed left out (N).
    pub held_out_speed_n: Option<f64>,
    /// Share of the samples within its 90 % band.
    pub held_out_speed_coverage: Option<f64>,
    /// Base law, all runs of this speed left out (N).
    pub base_held_out_speed_n: Option<f64>,
}

/// What a law or a part of it buys.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AblationRow {
    /// The law or the part.
    pub step: String,
    /// Error on left-out parts of the set with it (N).
    pub held_out_n: f64,
    /// Without it (N).
    pub without_n: Option<f64>,
    /// Whether it belongs to the law in the end.
    pub kept: bool,
}

/// Errors in one part of an insertion, pooled over the runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhaseReport {
    /// Loading, half a second around a drop, cutting, hold, way back.
    pub phase: &'static str,
    /// Mean of the other runs of the speed as the predictor (N).
    pub floor_n: Option<f64>,
    /// Extended law on runs left out (N).
    pub model_n: f64,
    /// The same together with what it leaves alike (N).
    pub with_discrepancy_n: f64,
}

/// What varies between runs and days: standard deviations.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Variability {
    /// Of the surface, between runs (m).
    pub surface_m: f64,
    /// Of the logarithm of friction.
    pub friction: f64,
    /// Of the force that a layer bears, relative.
    pub puncture: f64,
    /// Of the surface between days (m); a day is a speed and a stroke.
    pub day_surface_m: f64,
    /// Of the logarithm of friction between days.
    pub day_friction: f64,
    /// Per layer: runs in which the force shows its rupture.
    pub drops: Vec<usize>,
    /// Per layer: mean and standard deviation of where it lets go (m), where runs show it.
    pub release_positions_m: Vec<Option<(f64, f64)>>,
    /// What the law leaves in air and loading, cutting, hold, way back (N rms).
    pub residual_n: Vec<f64>,
}

/// What repeats add to `diagnosis.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RepeatabilityReport {
    /// Runs.
    pub recordings: Vec<RecordingReport>,
    /// By speed, slowest first.
    pub speeds: Vec<SpeedReport>,
    /// Means over the speeds.
    pub mean: MeanReport,
    /// By part of an insertion.
    pub phases: Vec<PhaseReport>,
    /// What varies.
    pub variability: Variability,
    /// Starts of the fit, and how many came to the same optimum.
    pub starts: (usize, usize),
    /// Laws and parts of the law.
    pub ablation: Vec<AblationRow>,
    /// What the instrument was seen to do.
    pub instrument: InstrumentReport,
    /// Layers measured alone, put together.
    pub composition: Option<CompositionReport>,
    /// What parts of the set are predicted to when the law is chosen without them, where that was asked.
    pub nested: Option<NestedCrossValidation>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordingReport {
    /// Its name.
    pub name: String,
    /// Speed (m/s).
    pub speed_mps: f64,
    /// Shift of the surface, with its day's (m).
    pub surface_shift_m: f64,
    /// Factor on friction, with its day's.
    pub friction: f64,
    /// Per layer the elastic force at the rupture (N) where there is one.
    pub puncture_n: Vec<Option<f64>>,
    /// Per layer where it lets go (m) where the force shows it.
    pub releases_m: Vec<Option<f64>>,
    /// Error of the base law fitted to the others (N).
    pub base_n: f64,
    /// Error of the extended law fitted to the others (N).
    pub model_n: f64,
    /// The same together with what it leaves alike of the others of this speed (N).
    pub with_discrepancy_n: f64,
    /// Share within the band.
    pub coverage: f64,
    /// Error of the mean of the others at this speed (N).
    pub floor_n: Option<f64>,
}

/// Means over the speeds.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MeanReport {
    /// Floor (N).
    pub floor_n: Option<f64>,
    /// The same without the scatter of the mean of the others (N).
    pub floor_unbiased_n: Option<f64>,
    /// Base law (N).
    pub base_n: f64,
    /// Extended law (N).
    pub model_n: f64,
    /// Together with what it leaves alike of the other runs of a speed (N).
    pub with_discrepancy_n: f64,
    /// Coverage of the 90 % band.
    pub coverage: f64,
    /// Extended law with a whole speed left out (N).
    pub held_out_speed_n: Option<f64>,
    /// Coverage there.
    pub held_out_speed_coverage: Option<f64>,
    /// Base law with a whole speed left out (N).
    pub base_held_out_speed_n: Option<f64>,
}

/// Layers measured alone, put together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompositionReport {
    /// Per part its name, the floor and the extended law's error on its own left-out runs (N).
    pub single_layers: Vec<(String, Option<f64>, f64)>,
    /// Error of the composed law on the whole (N), by speed.
    pub composed_n: Vec<f64>,
    /// Mean over the speeds.
    pub mean_n: f64,
}

/// What stands when the predictions are made.
pub struct ReportInputs<'a> {
    /// The runs.
    pub recordings: &'a [&'a SegmentedRecording],
    /// The law.
    pub model: &'a ScoredModel,
    /// Its predictions of runs left out.
    pub held_out: &'a [HeldOutPrediction],
    /// The base law's.
    pub base_held_out: &'a [HeldOutPrediction],
    /// Of runs whose whole speed was left out.
    pub held_out_speeds: Option<&'a [PredictionScore]>,
    /// The base law's.
    pub base_held_out_speeds: Option<&'a [PredictionScore]>,
    /// The mean of the others as the predictor, and of how many.
    pub floors: &'a [Option<(PredictionScore, usize)>],
}

/// Tells it all.
#[must_use]
pub fn repeatability_report(
    s: &ReportInputs,
    bought: Vec<AblationRow>,
    instrument: InstrumentReport,
) -> RepeatabilityReport {
    let runs = each(s);
    let speeds: Vec<SpeedReport> =
        mean_speeds(s.recordings).iter().map(|(v, m)| at_speed(*v, m, s)).collect();
    RepeatabilityReport {
        mean: mean_report(&speeds),
        phases: by_part(s),
        variability: varies(s),
        starts: s.model.set_fit.starts,
        ablation: bought,
        instrument,
        composition: None,
        nested: None,
        speeds,
        recordings: runs,
    }
}

fn each(s: &ReportInputs) -> Vec<RecordingReport> {
    let fit = &s.model.set_fit.fit;
    let model = &fit.model;
    s.recordings
        .iter()
        .enumerate()
        .map(|(r, run)| {
            let own = model.per_recording.get(r).copied().unwrap_or_default();
            let day = model.day_of.get(r).and_then(|d| model.days.get(*d)).copied().unwrap_or_default();
            let at = |l: usize| {
                let ruptured = model.rupture_times_s[r].get(l).is_some_and(|t| *t < NO_RUPTURE);
                let event = fit.residuals.ruptures.get(r).and_then(|e| e.get(l));
                event.filter(|_| ruptured).map(|e| e.elastic_n)
            };
            RecordingReport {
                name: run.name.clone(),
                speed_mps: run.speed_mps,
                surface_shift_m: own.surface_m + day.surface_m,
                friction: libm::exp(own.ln_friction + day.ln_friction),
                puncture_n: (0..model.layers()).map(at).collect(),
                releases_m: run.releases_m.clone(),
                base_n: s.base_held_out[r].model_score.rmse_n,
                model_n: s.held_out[r].model_score.rmse_n,
                with_discrepancy_n: s.held_out[r].score.rmse_n,
                coverage: s.held_out[r].score.coverage,
                floor_n: s.floors[r].as_ref().map(|f| f.0.rmse_n),
            }
        })
        .collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    stylet_stats::mean(&values.collect::<Vec<_>>())
}

/// Share of the error of a mean of `n` others that is not that mean's own scatter.
fn bare(n: usize) -> f64 {
    (n as f64 / (n + 1) as f64).sqrt()
}

fn at_speed(v: f64, members: &[usize], s: &ReportInputs) -> SpeedReport {
    let of = |what: &dyn Fn(usize) -> f64| mean(members.iter().map(|i| what(*i)));
    let floor = |what: &dyn Fn(&(PredictionScore, usize)) -> f64| {
        let all: Option<Vec<f64>> = members.iter().map(|i| s.floors[*i].as_ref().map(what)).collect();
        all.map(|all| stylet_stats::mean(&all))
    };
    let left = |out: Option<&[PredictionScore]>, what: &dyn Fn(&PredictionScore) -> f64| {
        out.filter(|o| o.len() == s.recordings.len()).map(|o| mean(members.iter().map(|i| what(&o[*i]))))
    };
    SpeedReport {
        speed_mps: v,
        recordings: members.len(),
        floor_n: floor(&|f| f.0.rmse_n),
        floor_unbiased_n: floor(&|f| f.0.rmse_n * bare(f.1)),
        base_n: of(&|i| s.base_held_out[i].model_score.rmse_n),
        model_n: of(&|i| s.held_out[i].model_score.rmse_n),
        with_discrepancy_n: of(&|i| s.held_out[i].score.rmse_n),
        coverage: of(&|i| s.held_out[i].score.coverage),
        held_out_speed_n: left(s.held_out_speeds, &|o| o.rmse_n),
        held_out_speed_coverage: left(s.held_out_speeds, &|o| o.coverage),
        base_held_out_speed_n: left(s.base_held_out_speeds, &|o| o.rmse_n),
    }
}

fn mean_report(speeds: &[SpeedReport]) -> MeanReport {
    let optional = |what: &dyn Fn(&SpeedReport) -> Option<f64>| {
        let all: Option<Vec<f64>> = speeds.iter().map(what).collect();
        all.map(|all| stylet_stats::mean(&all))
    };
    MeanReport {
        floor_n: optional(&|s| s.floor_n),
        floor_unbiased_n: optional(&|s| s.floor_unbiased_n),
        base_n: mean(speeds.iter().map(|s| s.base_n)),
        model_n: mean(speeds.iter().map(|s| s.model_n)),
        with_discrepancy_n: mean(speeds.iter().map(|s| s.with_discrepancy_n)),
        coverage: mean(speeds.iter().map(|s| s.coverage)),
        held_out_speed_n: optional(&|s| s.held_out_speed_n),
        held_out_speed_coverage: optional(&|s| s.held_out_speed_coverage),
        base_held_out_speed_n: optional(&|s| s.base_held_out_speed_n),
    }
}

fn by_part(s: &ReportInputs) -> Vec<PhaseReport> {
    let pooled = |scores: &mut dyn Iterator<Item = &PredictionScore>, k: usize| {
        let (sum, n) =
            scores.fold((0.0, 0.0), |(sum, n), x| (sum + x.phase_squares[k].0, n + x.phase_squares[k].1));
        (n > 0.0).then(|| (sum / n).sqrt())
    };
    PHASE_NAMES
        .iter()
        .enumerate()
        .filter_map(|(k, part)| {
            let extended_n = pooled(&mut s.held_out.iter().map(|o| &o.score), k)?;
            let floor_n = pooled(&mut s.floors.iter().flatten().map(|f| &f.0), k);
            let law_n = pooled(&mut s.held_out.iter().map(|o| &o.model_score), k)?;
            Some(PhaseReport { phase: part, floor_n, model_n: law_n, with_discrepancy_n: extended_n })
        })
        .collect()
}

fn varies(s: &ReportInputs) -> Variability {
    let model = &s.model.set_fit.fit.model;
    let (scatter, free) = (&model.scatter, model.free);
    let when = |free: bool, x: f64| if free { x } else { 0.0 };
    let population = crate::repeated_insertions::population_prediction::Population::from_fit(
        &s.model.set_fit,
        s.recordings,
    );
    Variability {
        surface_m: when(free.recording_surface, scatter.surface_m),
        friction: when(free.recording_friction, scatter.ln_friction),
        puncture: scatter.rupture_force,
        day_surface_m: when(free.day_surface, scatter.day_surface_m),
        day_friction: when(free.day_friction, scatter.day_ln_friction),
        drops: (0..model.layers())
            .map(|l| s.recordings.iter().filter(|r| r.ruptures_s[l].is_finite()).count())
            .collect(),
        release_positions_m: (0..model.layers())
            .map(|l| {
                let all: Vec<f64> = s.recordings.iter().filter_map(|r| r.releases_m[l]).collect();
                let sd = if all.len() > 1 { stylet_stats::sd(&all) } else { 0.0 };
                (!all.is_empty()).then(|| (stylet_stats::mean(&all), sd))
            })
            .collect(),
        residual_n: population.residual_n.to_vec(),
    }
}

/// Remarks on the data: one per speed on what all its recordings have in common, then those of every recording.
#[must_use]
pub fn data_quality(runs: &[&SegmentedRecording]) -> Vec<DataQualityNote> {
    let mut out = Vec::new();
    let plain = |message: String, numbers: BTreeMap<String, f64>| QualityNote {
        kind: QualityKind::Jitter,
        message,
        numbers,
        lines: Vec::new(),
        blocking: false,
    };
    for (v, members) in mean_speeds(runs) {
        let some: Vec<&SegmentedRecording> = members.iter().map(|i| runs[*i]).collect();
        let rate = mean(some.iter().map(|r| (r.recording.len() - 1) as f64 / r.recording.duration_s()));
        let gap =
            |r: &&SegmentedRecording| r.recording.time_s.windows(2).map(|p| p[1] - p[0]).fold(0.0, f64::max);
        let end = mean(some.iter().map(|r| {
            let z = &r.recording.position_m;
            z[r.phases.deepest..].iter().copied().fold(f64::NEG_INFINITY, f64::max) - z[0]
        }));
        let largest = some.iter().map(gap).fold(0.0, f64::max);
        let message = format!(
            "{} recording(s) at {:.2} mm/s: really {rate:.1} samples per second on the average, largest gap {:.0} ms, stroke ends at {:.1} mm",
            members.len(),
            1e3 * v,
            1e3 * largest,
            1e3 * end
        );
        let numbers = [("speed_mps", v), ("sample_hz", rate), ("largest_gap_s", largest), ("stroke_m", end)];
        let numbers = numbers.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
        out.push(DataQualityNote {
            recording: format!("all at {:.2} mm/s", 1e3 * v),
            note: plain(message, numbers),
        });
    }
    for run in runs {
        let quality = |note: QualityNote| DataQualityNote { recording: run.name.clone(), note };
        out.extend(run.notes.iter().cloned().map(quality));
        out.push(quality(plain(sampling_summary(&run.recording), BTreeMap::new())));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{
        ReportInputs, SpeedReport, at_speed, bare, by_part, data_quality, each, mean_report, varies,
    };
    use crate::repeated_insertions::SegmentedRecording;
    use crate::repeated_insertions::cross_validation::{HeldOutPrediction, PredictionScore};
    use crate::repeated_insertions::model_selection::{ModelFamily, ScoredModel};
    use crate::test_fixtures::{assumed_layers, simulated_recordings, unmeasured_candidate};
    use stylet_identify::model::{DayParameters, NO_RUPTURE, RecordingParameters};
    use stylet_identify::rupture_likelihood::RuptureEvent;
    use stylet_record::{QualityKind, QualityNote};

    fn score(rmse_n: f64, covered: f64) -> PredictionScore {
        PredictionScore { rmse_n, coverage: covered, ..PredictionScore::default() }
    }

    fn out(rmse_n: f64, covered: f64) -> HeldOutPrediction {
        let law = score(rmse_n, covered);
        HeldOutPrediction { score: law.clone(), model_score: law, ..HeldOutPrediction::default() }
    }

    /// Three runs, two of them at one speed.
    struct Made {
        runs: Vec<SegmentedRecording>,
        law: ScoredModel,
        out: Vec<HeldOutPrediction>,
        base_out: Vec<HeldOutPrediction>,
        speed_out: Vec<PredictionScore>,
        base_speed_out: Vec<PredictionScore>,
        floors: Vec<Option<(PredictionScore, usize)>>,
    }

    fn made() -> Made {
        let runs = simulated_recordings(&[], &[[0.008, 0.0], [0.004, 0.0], [0.0082, 0.0]]);
        let mut law = unmeasured_candidate(ModelFamily::Library, &[], &[0.1; 3], 0.0);
        let model = &mut law.set_fit.fit.model;
        let layers = assumed_layers(&[[0.02, 100.0, 1000.0]; 2]);
        (model.tissue, model.assumed) = (layers.tissue.clone(), layers);
        model.per_recording = [(3e-4, 0.05), (-2e-4, -0.1), (0.0, 0.2)]
            .map(|(surface_m, friction)| RecordingParameters {
                surface_m,
                ln_friction: friction,
                ..RecordingParameters::default()
            })
            .to_vec();
        model.days = vec![
            DayParameters { surface_m: 1e-3, ln_friction: 0.3 },
            DayParameters { surface_m: -5e-3, ln_friction: 0.02 },
        ];
        model.day_of = vec![1, 0, 1];
        model.rupture_times_s = vec![vec![2.0, NO_RUPTURE], vec![1.0, 3.0], vec![NO_RUPTURE, NO_RUPTURE]];
        Made {
            runs,
            law,
            out: vec![out(0.1, 0.9), out(0.2, 0.8), out(0.4, 0.6)],
            base_out: vec![out(0.5, 0.0), out(0.7, 0.0), out(1.1, 0.0)],
            speed_out: vec![score(1.0, 0.5), score(2.0, 0.3), score(4.0, 0.1)],
            base_speed_out: vec![score(10.0, 0.0), score(20.0, 0.0), score(40.0, 0.0)],
            floors: vec![Some((score(0.3, 0.0), 1)), None, Some((score(0.5, 0.0), 3))],
        }
    }

    fn with<T>(m: &Made, look: impl Fn(&ReportInputs) -> T) -> T {
        let runs: Vec<&SegmentedRecording> = m.runs.iter().collect();
        look(&ReportInputs {
            recordings: &runs,
            model: &m.law,
            held_out: &m.out,
            base_held_out: &m.base_out,
            held_out_speeds: Some(&m.speed_out),
            base_held_out_speeds: Some(&m.base_speed_out),
            floors: &m.floors,
        })
    }

    #[test]
    fn a_run_is_told_with_its_own_numbers_its_days_and_where_it_gave_way() {
        let mut m = made();
        let event = |elastic_n: f64| RuptureEvent { elastic_n, ..RuptureEvent::INITIAL };
        m.law.set_fit.fit.residuals.ruptures =
            vec![vec![event(1.5), event(9.0)], vec![event(1.1), event(2.2)]];
        let told = with(&m, each);
        assert_eq!(told.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["run 0", "run 1", "run 2"]);
        for (r, shift_m, friction) in [(0, -4.7e-3, 0.07_f64), (1, 8e-4, 0.2), (2, -5e-3, 0.22)] {
            assert!((told[r].surface_shift_m - shift_m).abs() < 1e-15, "{r}: {}", told[r].surface_shift_m);
            assert!((told[r].friction - friction.exp()).abs() < 1e-12, "{r}: {}", told[r].friction);
            assert_eq!(
                (told[r].speed_mps, &told[r].releases_m),
                (m.runs[r].speed_mps, &m.runs[r].releases_m)
            );
        }
        // Only what ruptured has a force, and only where a fit tells it.
        assert_eq!(
            told.iter().map(|r| r.puncture_n.clone()).collect::<Vec<_>>(),
            [vec![Some(1.5), None], vec![Some(1.1), Some(2.2)], vec![None, None]]
        );
        let errors: Vec<_> =
            told.iter().map(|r| (r.base_n, r.with_discrepancy_n, r.coverage, r.floor_n)).collect();
        assert_eq!(errors, [(0.5, 0.1, 0.9, Some(0.3)), (0.7, 0.2, 0.8, None), (1.1, 0.4, 0.6, Some(0.5))]);
    }

    #[test]
    fn a_speed_has_the_means_of_its_runs_and_the_whole_those_of_the_speeds() {
        let m = made();
        let fast = with(&m, |s| at_speed(0.0081, &[0, 2], s));
        let near =
            |a: Option<f64>, b: f64| assert!((a.expect("a number") - b).abs() < 1e-12, "{a:?} for {b}");
        assert_eq!((fast.speed_mps, fast.recordings), (0.0081, 2));
        near(fast.floor_n, 0.4);
        // About a mean of n others one more scatters by sqrt((n + 1)/n) of what runs scatter by.
        near(fast.floor_unbiased_n, 0.5 * (0.3 / 2.0_f64.sqrt() + 0.5 / (4.0_f64 / 3.0).sqrt()));
        near(Some(bare(4)), 0.8_f64.sqrt());
        near(Some(fast.base_n), 0.8);
        near(Some(fast.with_discrepancy_n), 0.25);
        near(Some(fast.coverage), 0.75);
        near(fast.held_out_speed_n, 2.5);
        near(fast.held_out_speed_coverage, 0.3);
        near(fast.base_held_out_speed_n, 25.0);
        // A run alone has no floor, and where speeds were not left out nothing is told of it.
        let slow = with(&m, |s| {
            at_speed(
                0.004,
                &[1],
                &ReportInputs { held_out_speeds: Some(&[]), base_held_out_speeds: None, ..*s },
            )
        });
        assert_eq!((slow.floor_n, slow.floor_unbiased_n), (None, None));
        assert_eq!(
            (slow.held_out_speed_n, slow.held_out_speed_coverage, slow.base_held_out_speed_n),
            (None, None, None)
        );
        let all =
            mean_report(&[fast.clone(), SpeedReport { floor_n: Some(0.8), coverage: 0.25, ..fast.clone() }]);
        near(all.floor_n, 0.6);
        near(Some(all.coverage), 0.5);
        assert_eq!(
            (all.floor_unbiased_n, all.base_n, all.with_discrepancy_n, all.held_out_speed_n),
            (fast.floor_unbiased_n, fast.base_n, fast.with_discrepancy_n, fast.held_out_speed_n)
        );
        assert_eq!(
            (all.held_out_speed_coverage, all.base_held_out_speed_n),
            (fast.held_out_speed_coverage, fast.base_held_out_speed_n)
        );
        let all = mean_report(&[fast, slow]);
        assert_eq!((all.floor_n, all.floor_unbiased_n, all.held_out_speed_n), (None, None, None));
        near(Some(all.base_n), 0.75);
        near(Some(all.with_discrepancy_n), 0.225);
    }

    /// Of the runs' sums of squares; what no run has is not told.
    #[test]
    fn parts_of_an_insertion_are_pooled_over_the_runs() {
        let mut m = made();
        m.out[0].model_score.phase_squares = [(16.0, 1.0); 5];
        m.out[0].score.phase_squares = [(8.0, 2.0), (0.0, 0.0), (1.0, 4.0), (0.0, 0.0), (3.0, 1.0)];
        m.out[2].score.phase_squares = [(1.0, 7.0), (0.0, 0.0), (0.0, 0.0), (0.0, 5.0), (0.0, 0.0)];
        m.floors[0] = Some((
            PredictionScore {
                phase_squares: [(2.0, 4.0), (9.0, 9.0), (0.0, 0.0), (4.0, 1.0), (0.0, 0.0)],
                ..PredictionScore::default()
            },
            2,
        ));
        m.floors[2] = Some((
            PredictionScore {
                phase_squares: [(7.0, 5.0), (9.0, 9.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)],
                ..PredictionScore::default()
            },
            2,
        ));
        assert!(with(&m, by_part).iter().all(|p| p.model_n == 4.0));
        let told: Vec<(&str, Option<f64>, f64)> =
            with(&m, by_part).iter().map(|p| (p.phase, p.floor_n, p.with_discrepancy_n)).collect();
        assert_eq!(
            told,
            [
                ("loading", Some(1.0), 1.0),
                ("cutting", None, 0.5),
                ("hold", Some(2.0), 0.0),
                ("back", None, 3.0_f64.sqrt())
            ]
        );
    }

    #[test]
    fn what_varies_is_told_only_where_it_was_free_to() {
        let mut m = made();
        for (run, (ruptures, releases)) in m.runs.iter_mut().zip([
            (vec![1.0, 2.0], vec![Some(0.010), None]),
            (vec![1.0, NO_RUPTURE], vec![Some(0.012), None]),
            (vec![NO_RUPTURE, NO_RUPTURE], vec![None, Some(0.02)]),
        ]) {
            (run.ruptures_s, run.releases_m) = (ruptures, releases);
        }
        let scatter = &mut m.law.set_fit.fit.model.scatter;
        (scatter.surface_m, scatter.ln_friction, scatter.rupture_force) = (1e-4, 0.02, 0.07);
        (scatter.day_surface_m, scatter.day_ln_friction) = (3e-4, 0.04);
        let told = with(&m, varies);
        assert_eq!(
            (told.surface_m, told.friction, told.puncture, told.day_surface_m, told.day_friction),
            (0.0, 0.0, 0.07, 0.0, 0.0)
        );
        assert_eq!(told.drops, [2, 1]);
        let (middle, sd) = told.release_positions_m[0].expect("two releases");
        assert!((middle - 0.011).abs() < 1e-15 && (sd - 0.002 / 2.0_f64.sqrt()).abs() < 1e-15, "{sd}");
        // One alone does not scatter.
        assert_eq!(told.release_positions_m[1], Some((0.02, 0.0)));
        m.runs[2].releases_m[1] = None;
        assert_eq!(with(&m, varies).release_positions_m[1], None);
        let free = &mut m.law.set_fit.fit.model.free;
        (free.recording_surface, free.recording_friction, free.day_surface, free.day_friction) =
            (true, true, true, true);
        let told = with(&m, varies);
        assert_eq!(
            (told.surface_m, told.friction, told.day_surface_m, told.day_friction),
            (1e-4, 0.02, 3e-4, 0.04)
        );
    }

    #[test]
    fn the_data_are_told_speed_by_speed_and_then_run_by_run() {
        let mut m = made();
        m.runs[1].notes = vec![QualityNote {
            kind: QualityKind::Jitter,
            message: "a remark".to_owned(),
            numbers: Default::default(),
            lines: Vec::new(),
            blocking: false,
        }];
        // Half a second is missing on the way in.
        let r = &m.runs[2].recording;
        let kept = |x: &[f64]| -> Vec<f64> {
            x.iter().enumerate().filter(|(k, _)| !(26..50).contains(k)).map(|(_, x)| *x).collect()
        };
        let gapped = stylet_record::Recording::new(kept(&r.time_s), kept(&r.position_m), kept(&r.force_n));
        let speed_mps = m.runs[2].speed_mps;
        m.runs[2] = SegmentedRecording {
            speed_mps,
            ..SegmentedRecording::new("run 2".to_owned(), gapped.expect("clean columns"), 1)
        };
        let runs: Vec<&SegmentedRecording> = m.runs.iter().collect();
        let told = data_quality(&runs);
        let named: Vec<&str> = told.iter().map(|q| q.recording.as_str()).collect();
        assert_eq!(named[2..], ["run 0", "run 1", "run 1", "run 2"]);
        assert!(named[0] == "all at 4.00 mm/s" && named[1].starts_with("all at 8."), "{named:?}");
        assert_eq!(told[3].note.message, "a remark");
        let slow = &told[0].note.numbers;
        for (name, wanted) in
            [("speed_mps", 0.004), ("sample_hz", 50.0), ("largest_gap_s", 0.02), ("stroke_m", 0.016)]
        {
            assert!((slow[name] - wanted).abs() < 1e-9 + 1e-6 * wanted, "{name}: {}", slow[name]);
        }
        let fast = &told[1].note.numbers;
        assert!((fast["largest_gap_s"] - 0.5).abs() < 1e-9, "{fast:?}");
        let hz = |r: &SegmentedRecording| (r.recording.len() - 1) as f64 / r.recording.duration_s();
        assert!((fast["sample_hz"] - 0.5 * (hz(&m.runs[0]) + hz(&m.runs[2]))).abs() < 1e-9, "{fast:?}");
        let message = &told[1].note.message;
        assert!(
            message.starts_with("2 recording(s) at 8.") && message.contains("largest gap 500 ms"),
            "{message}"
        );
        assert!(message.ends_with("stroke ends at 16.0 mm"), "{message}");
        // As far as it went from where it began.
        let mut moved = m.runs[1].clone();
        moved.recording.position_m.iter_mut().for_each(|z| *z += 0.002);
        let told_moved = data_quality(&[&moved]);
        assert!((told_moved[0].note.numbers["stroke_m"] - 0.016).abs() < 1e-6, "{told_moved:?}");
        assert!(told[0].note.message.contains("really 50.0 samples per second"), "{}", told[0].note.message);
    }
}
