//! Start values of candidate effects from score tests: first-order gain of each effect, and the parameters from which its fit starts.

use crate::base_law_fit::PreparedRecordings;
use crate::effect_start::EffectStart;
use crate::rupture_start_values::start_from_ruptures;
use stylet_identify::fit::JacobianColumn;
use stylet_identify::force_drops::ForceDrop;
use stylet_identify::model::EffectTerm;
use stylet_identify::score_test::{ScoreTest, ScoreTestResult, scale_strengths};
use stylet_stats::parallel::*;
use stylet_tissue::{ChainStage, EffectInfo, Proposal};

/// Best start values of every effect that the model does not include: at most two each, largest gain first.
#[must_use]
pub fn effect_starts(
    score_test: &ScoreTest,
    prepared: &PreparedRecordings,
    tones_hz: &[f64],
) -> Vec<Vec<EffectStart>> {
    let included: Vec<&str> = score_test.fit.model.effects.iter().map(|e| e.info.id).collect();
    let entries: Vec<&'static EffectInfo> =
        score_test.fit.model.assumed.candidates().filter(|i| !included.contains(&i.id)).collect();
    let mut all: Vec<Vec<EffectStart>> = entries
        .par_iter()
        .map(|info| {
            let mut starts = starts_of(info, score_test, prepared, tones_hz);
            if info.stage == ChainStage::Puncture {
                starts.extend(start_from_ruptures(info, score_test));
            }
            starts.sort_by(|a, b| b.gain_nats.total_cmp(&a.gain_nats));
            starts.truncate(2);
            starts
        })
        .into_iter()
        .filter(|s| !s.is_empty())
        .collect();
    all.sort_by(|a, b| b[0].gain_nats.total_cmp(&a[0].gain_nats));
    all
}

/// Start values of one effect, by its kind of proposal.
fn starts_of(
    info: &'static EffectInfo,
    score_test: &ScoreTest,
    prepared: &PreparedRecordings,
    tones_hz: &[f64],
) -> Vec<EffectStart> {
    let assumed = &score_test.fit.model.assumed;
    match info.proposal {
        // A position scale is not identifiable if all thicknesses are guessed.
        Proposal::LinearColumns(_) if info.stage == ChainStage::Position && assumed.is_geometry_guessed() => {
            Vec::new()
        }
        Proposal::LinearColumns(groups) => {
            groups.iter().filter_map(|g| start_of_columns(info, score_test, g)).collect()
        }
        // Free thicknesses already shift every layer boundary.
        Proposal::LayerFaces(_) if score_test.fit.model.free.thickness => Vec::new(),
        Proposal::LayerFaces(shift) => (1..score_test.fit.model.layers())
            .filter_map(|l| start_of_columns(info, score_test, &[&[l as f64, shift]]))
            .collect(),
        Proposal::TissueMotion => breathing_starts(info, score_test),
        Proposal::SpectralTone => tone_starts(info, score_test, tones_hz),
        Proposal::MembraneRupture => break_starts(info, score_test, prepared),
        Proposal::SplitTerm(_) | Proposal::RawSamples | Proposal::PerLayer => Vec::new(),
    }
}

/// Start value from the joint gain of a group of columns.
fn start_of_columns(
    info: &'static EffectInfo,
    score_test: &ScoreTest,
    group: &[&[f64]],
) -> Option<EffectStart> {
    let columns: Vec<JacobianColumn> = group
        .iter()
        .map(|v| score_test.effect_column(&EffectTerm::new(info, v)))
        .collect::<Option<Vec<_>>>()?;
    let gain = score_test.gain(&columns);
    start(info, score_test, group, &columns, gain)
}

/// The start value with the coefficients of `gain`, if they are valid parameters.
fn start(
    info: &'static EffectInfo,
    score_test: &ScoreTest,
    group: &[&[f64]],
    columns: &[JacobianColumn],
    gain: ScoreTestResult,
) -> Option<EffectStart> {
    let values = scale_strengths(info, group, &gain.coefficients);
    let choice = EffectTerm::new(info, &values);
    choice.effect().filter(|e| e.check().is_ok())?;
    let one_sided =
        info.parameters.iter().all(|p| !p.strength || p.low >= p.inactive || p.inactive == f64::INFINITY);
    if one_sided && gain.coefficients.iter().any(|c| *c <= 0.0) {
        // Without the columns whose coefficients have the wrong sign.
        let kept: Vec<usize> = (0..group.len()).filter(|k| gain.coefficients[*k] > 0.0).collect();
        if kept.is_empty() {
            return None;
        }
        let part: Vec<JacobianColumn> = kept.iter().map(|k| columns[*k].clone()).collect();
        let values: Vec<&[f64]> = kept.iter().map(|k| group[*k]).collect();
        let gain = score_test.gain(&part);
        return start(info, score_test, &values, &part, gain);
    }
    Some(EffectStart::new(choice, &gain))
}

/// Range of breathing frequencies (Hz): 3 to 72 breaths per minute.
const BREATHING_HZ: (f64, f64) = (0.05, 1.2);

/// Start values of a tissue motion on a grid of frequencies.
fn breathing_starts(info: &'static EffectInfo, score_test: &ScoreTest) -> Vec<EffectStart> {
    /// Amplitude (m) of the unit columns.
    const AMPLITUDE_M: f64 = 1e-4;
    let longest = score_test.data.recordings.iter().map(|b| b.span_s().1 - b.span_s().0).fold(1.0, f64::max);
    let step = 0.6 / longest;
    let Some((fz, fv)) = force_derivatives(score_test) else { return Vec::new() };
    let count = ((BREATHING_HZ.1 - BREATHING_HZ.0) / step) as usize;
    (0..count)
        .filter_map(|k| {
            let hz = BREATHING_HZ.0 + step * k as f64;
            let omega = core::f64::consts::TAU * hz;
            let mut parts = [Vec::new(), Vec::new()];
            for (r, b) in score_test.data.recordings.iter().enumerate() {
                let mut pair = [vec![0.0; b.len()], vec![0.0; b.len()]];
                for i in 0..b.len() {
                    let (s, c) = libm::sincos(omega * 0.5 * (b.start_s[i] + b.end_s[i]));
                    let (z, v) = (fz[r][i], fv[r][i]);
                    pair[0][i] = -AMPLITUDE_M * (s * z + omega * c * v);
                    pair[1][i] = -AMPLITUDE_M * (c * z - omega * s * v);
                }
                let [a, b] = pair;
                parts[0].push(a);
                parts[1].push(b);
            }
            let columns = [score_test.force_column(&parts[0]), score_test.force_column(&parts[1])];
            sinusoid_start(info, hz, AMPLITUDE_M, &score_test.gain(&columns))
        })
        .collect()
}

/// Start value of a sinusoid from the coefficients of its sine and cosine columns of amplitude `unit`.
fn sinusoid_start(
    info: &'static EffectInfo,
    hz: f64,
    unit: f64,
    gain: &ScoreTestResult,
) -> Option<EffectStart> {
    let (a, b) = (gain.coefficients[0], gain.coefficients[1]);
    let amplitude = unit * libm::hypot(a, b);
    let term = || EffectTerm::new(info, &[amplitude, hz, libm::atan2(b, a)]);
    (amplitude > 0.0).then(|| EffectStart::new(term(), gain))
}

/// One value per block and recording.
type BlockValues = Vec<Vec<f64>>;

/// Derivatives of the predicted force with respect to depth (N/m) and speed (N s/m), per block.
fn force_derivatives(score_test: &ScoreTest) -> Option<(BlockValues, BlockValues)> {
    use stylet_identify::forward_model::{ReplayResult, replay_with_ruptures};
    use stylet_identify::likelihood::motion_pieces;
    /// Finite difference (m) for the derivative with respect to depth.
    const DZ_M: f64 = 1e-6;
    /// Finite difference (m/s) for the derivative with respect to speed.
    const DV_MPS: f64 = 1e-6;
    let model = &score_test.fit.model;
    let (mut fz, mut fv) = (Vec::new(), Vec::new());
    for (r, b) in score_test.data.recordings.iter().enumerate() {
        let compiled = model.compile(r)?;
        let pieces = motion_pieces(&compiled, b);
        let mut out = [ReplayResult::default(), ReplayResult::default(), ReplayResult::default()];
        for (out, (dz, dv)) in out.iter_mut().zip([(0.0, 0.0), (DZ_M, 0.0), (0.0, DV_MPS)]) {
            let mut moved = (*pieces).clone();
            for p in &mut moved {
                p.position_m += dz;
                p.velocity_mps += dv;
            }
            replay_with_ruptures(&compiled, b, &moved, &model.rupture_times_s[r], out);
        }
        let slope = |x: &[f64], h: f64| -> Vec<f64> {
            x.iter().zip(&out[0].force_n).map(|(x, f)| (x - f) / h).collect()
        };
        fz.push(slope(&out[1].force_n, DZ_M));
        // Near zero speed, a finite difference contains the jump of Coulomb friction.
        let mut v = slope(&out[2].force_n, DV_MPS);
        v.iter_mut().for_each(|v| {
            if v.abs() > 1e5 {
                *v = 0.0
            }
        });
        fv.push(v);
    }
    Some((fz, fv))
}

/// Start values of a sinusoidal force at the tones of the residual.
fn tone_starts(info: &'static EffectInfo, score_test: &ScoreTest, tones_hz: &[f64]) -> Vec<EffectStart> {
    tones_hz
        .iter()
        .filter_map(|&hz| {
            let quarter = core::f64::consts::FRAC_PI_2;
            let columns: Vec<JacobianColumn> = [[1e-3, hz, 0.0], [1e-3, hz, quarter]]
                .iter()
                .map(|v| score_test.effect_column(&EffectTerm::new(info, v)))
                .collect::<Option<Vec<_>>>()?;
            sinusoid_start(info, hz, 1e-3, &score_test.gain(&columns))
        })
        .collect()
}

/// Trial stretches (m) at which an elastic element breaks.
const STRETCHES_M: [f64; 4] = [8e-4, 3e-3, 8e-3, 2e-2];

/// Start values of a breaking elastic element at force drops that are not assigned to a layer, and on a grid of depths.
fn break_starts(
    info: &'static EffectInfo,
    score_test: &ScoreTest,
    prepared: &PreparedRecordings,
) -> Vec<EffectStart> {
    let model = &score_test.fit.model;
    let surface = model.tissue.surface_m;
    let deepest = score_test
        .data
        .recordings
        .iter()
        .flat_map(|b| b.pieces.iter())
        .fold(0.0_f64, |m, p| m.max(p.position_m))
        - surface;
    let mut depths: Vec<f64> = Vec::new();
    for (drops, rupture_times_s) in prepared.drops.iter().zip(&model.rupture_times_s) {
        for d in drops {
            if rupture_times_s.iter().all(|t| (t - d.time_s).abs() > 0.15) {
                depths.push(d.position_m - surface);
            }
        }
    }
    depths.sort_unstable_by(f64::total_cmp);
    depths.dedup_by(|a, b| (*a - *b).abs() < 3e-4);
    depths.truncate(30);
    let grid = (deepest / 50.0).max(1e-3);
    depths.extend((1..50).map(|k| grid * f64::from(k)));
    depths.retain(|d| *d < deepest);
    let mut out: Vec<EffectStart> = depths
        .par_iter()
        .map(|depth| {
            let at = |stretch: &f64| {
                let force: Vec<Vec<f64>> = score_test
                    .data
                    .recordings
                    .iter()
                    .map(|b| {
                        let (mut intact, mut f) = (true, vec![0.0; b.len()]);
                        for p in b.pieces.iter() {
                            let x = p.position_m - surface - (depth - stretch);
                            intact &= x < *stretch;
                            if intact && x > 0.0 {
                                f[p.block as usize] = x;
                            }
                        }
                        f
                    })
                    .collect();
                let gain = score_test.gain(&[score_test.force_column(&force)]);
                let k = gain.coefficients[0];
                let term = || EffectTerm::new(info, &[depth - stretch, k, k * stretch]);
                (k > 1.0).then(|| EffectStart::new(term(), &gain))
            };
            STRETCHES_M.iter().filter(|s| **s < *depth).filter_map(at).collect::<Vec<_>>()
        })
        .into_iter()
        .flatten()
        .collect();
    out.sort_by(|a, b| b.gain_nats.total_cmp(&a.gain_nats));
    out.truncate(2);
    out
}

/// Distance (m) within which drops of different recordings belong to one place.
const SAME_PLACE_M: f64 = 3e-3;
/// Largest number of places; those with the largest drops are kept.
const MAX_PLACES: usize = 6;

/// Start values of a breaking elastic element at places where every recording shows a drop, whether or not it is assigned to a layer.
pub(crate) fn starts_at_common_drops(
    info: &'static EffectInfo,
    prepared: &PreparedRecordings,
) -> Vec<EffectTerm> {
    let surface = prepared.assumed.tissue.surface_m;
    let Some((first, others)) = prepared.drops.split_first() else { return Vec::new() };
    let mut places: Vec<(f64, f64)> = first
        .iter()
        .filter_map(|d| {
            let near = |e: &&ForceDrop| (e.position_m - d.position_m).abs() < SAME_PLACE_M;
            let same: Vec<&ForceDrop> = others.iter().filter_map(|r| r.iter().find(near)).collect();
            let n = (same.len() + 1) as f64;
            let mean = |of: fn(&ForceDrop) -> f64| (of(d) + same.iter().map(|d| of(d)).sum::<f64>()) / n;
            (same.len() == others.len()).then(|| (mean(|d| d.position_m) - surface, mean(|d| d.size_n)))
        })
        .collect();
    places.sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
    places.truncate(MAX_PLACES);
    let from = |(depth, size): (f64, f64)| {
        let shorter = STRETCHES_M.into_iter().filter(move |s| *s < depth);
        shorter.map(move |s| EffectTerm::new(info, &[depth - s, size / s, size]))
    };
    places.into_iter().flat_map(from).collect()
}

#[cfg(test)]
mod tests;
