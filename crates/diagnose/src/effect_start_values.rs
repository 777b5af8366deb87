//! Where a search begins: for every effect the starts that gain most to first order.

use crate::base_law_fit::PreparedRecordings;
use rayon::prelude::*;
use stylet_identify::fit::JacobianColumn;
use stylet_identify::force_drops::ForceDrop;
use stylet_identify::model::{EffectTerm, Model};
use stylet_identify::score_test::{ScoreTest, ScoreTestResult, scale_strengths};
use stylet_tissue::{ChainStage, EffectInfo, Proposal, general_effects};

/// A start with what it gains to first order.
#[derive(Clone, Debug)]
pub struct EffectStart {
    /// The effect with its values.
    pub choice: EffectTerm,
    /// Nats to first order.
    pub gain_nats: f64,
    /// Nats that the effect at its probe would show.
    pub detectable_nats: f64,
    /// The model to fit from, where it is not the one so far with the effect: ranked without a short fit.
    pub model: Option<Model>,
}

/// The best starts of every effect, best effect first, at most two of each; `lines` (Hz) are those of the residual's spectrum.
#[must_use]
pub fn effect_starts(
    look: &ScoreTest,
    prepared: &PreparedRecordings,
    lines: &[f64],
) -> Vec<Vec<EffectStart>> {
    let taken: Vec<&str> = look.fit.model.effects.iter().map(|e| e.info.id).collect();
    let entries: Vec<&'static EffectInfo> = general_effects().filter(|i| !taken.contains(&i.id)).collect();
    let mut all: Vec<Vec<EffectStart>> = entries
        .par_iter()
        .map(|info| {
            let mut own = of(info, look, prepared, lines);
            if info.stage == ChainStage::Puncture {
                own.extend(crate::rupture_start_values::start_from_ruptures(info, look));
            }
            own.sort_by(|a, b| b.gain_nats.total_cmp(&a.gain_nats));
            own.truncate(2);
            own
        })
        .filter(|s| !s.is_empty())
        .collect();
    all.sort_by(|a, b| b[0].gain_nats.total_cmp(&a[0].gain_nats));
    all
}

fn of(
    info: &'static EffectInfo,
    look: &ScoreTest,
    prepared: &PreparedRecordings,
    hz: &[f64],
) -> Vec<EffectStart> {
    match info.proposal {
        Proposal::LinearColumns(groups) => groups.iter().filter_map(|g| columns(info, look, g)).collect(),
        // Free thicknesses move every face already.
        Proposal::LayerFaces(_) if look.fit.model.free.thickness => Vec::new(),
        Proposal::LayerFaces(shift) => {
            (1..look.fit.model.layers()).filter_map(|l| columns(info, look, &[&[l as f64, shift]])).collect()
        }
        Proposal::TissueMotion => breath(info, look),
        Proposal::SpectralTone => lines(info, look, hz),
        Proposal::MembraneRupture => breaks(info, look, prepared),
        Proposal::SplitTerm(_) | Proposal::RawSamples | Proposal::PerLayer => Vec::new(),
    }
}

/// The start of a group of columns.
fn columns(info: &'static EffectInfo, look: &ScoreTest, group: &[&[f64]]) -> Option<EffectStart> {
    let columns: Vec<JacobianColumn> =
        group.iter().map(|v| look.effect_column(&EffectTerm::new(info, v))).collect::<Option<Vec<_>>>()?;
    let gain = look.gain(&columns);
    start(info, look, group, &columns, gain)
}

fn start(
    info: &'static EffectInfo,
    look: &ScoreTest,
    group: &[&[f64]],
    columns: &[JacobianColumn],
    gain: ScoreTestResult,
) -> Option<EffectStart> {
    let values = scale_strengths(info, group, &gain.coefficients);
    let choice = EffectTerm::new(info, &values);
    choice.effect().filter(|e| e.check().is_ok())?;
    let one_sided =
        info.parameters.iter().all(|p| !p.strength || p.low >= p.inactive || p.inactive == f64::INFINITY);
    let nats = if one_sided && gain.coefficients.iter().any(|c| *c <= 0.0) {
        // Columns whose coefficient has the wrong sign are of no use; the others may be.
        let kept: Vec<usize> = (0..group.len()).filter(|k| gain.coefficients[*k] > 0.0).collect();
        if kept.is_empty() {
            return None;
        }
        let part: Vec<JacobianColumn> = kept.iter().map(|k| columns[*k].clone()).collect();
        let of: Vec<&[f64]> = kept.iter().map(|k| group[*k]).collect();
        let less = look.gain(&part);
        return start(info, look, &of, &part, less);
    } else {
        gain.nats
    };
    Some(EffectStart { choice, gain_nats: nats, detectable_nats: gain.detectable_nats, model: None })
}

/// Lowest and highest frequency in Hz of a breath.
const BREATH_HZ: (f64, f64) = (0.05, 1.2);

/// Motions of the tissue at every frequency of a grid.
fn breath(info: &'static EffectInfo, look: &ScoreTest) -> Vec<EffectStart> {
    const AMPLITUDE_M: f64 = 1e-4;
    let longest = look.data.recordings.iter().map(|b| b.span_s().1 - b.span_s().0).fold(1.0, f64::max);
    let step = 0.6 / longest;
    let Some((fz, fv)) = slopes(look) else { return Vec::new() };
    let count = ((BREATH_HZ.1 - BREATH_HZ.0) / step) as usize;
    (0..count)
        .filter_map(|k| {
            let hz = BREATH_HZ.0 + step * k as f64;
            let omega = core::f64::consts::TAU * hz;
            let mut parts = [Vec::new(), Vec::new()];
            for (r, b) in look.data.recordings.iter().enumerate() {
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
            let columns = [look.force_column(&parts[0]), look.force_column(&parts[1])];
            let gain = look.gain(&columns);
            let (a, b) = (gain.coefficients[0], gain.coefficients[1]);
            let amplitude = AMPLITUDE_M * libm::hypot(a, b);
            (amplitude > 0.0).then(|| EffectStart {
                choice: EffectTerm::new(info, &[amplitude, hz, libm::atan2(b, a)]),
                gain_nats: gain.nats,
                detectable_nats: gain.detectable_nats,
                model: None,
            })
        })
        .collect()
}

/// A value of every block, per recording.
type PerBlock = Vec<Vec<f64>>;

/// How the predicted force changes with depth (N/m) and with speed (N s/m), block by block.
fn slopes(look: &ScoreTest) -> Option<(PerBlock, PerBlock)> {
    use stylet_identify::forward_model::{ReplayResult, replay_with_ruptures};
    use stylet_identify::likelihood::motion_pieces;
    const DZ_M: f64 = 1e-6;
    const DV_MPS: f64 = 1e-6;
    let model = &look.fit.model;
    let (mut fz, mut fv) = (Vec::new(), Vec::new());
    for (r, b) in look.data.recordings.iter().enumerate() {
        let compiled = model.compile(r)?;
        let course = motion_pieces(&compiled, b);
        let mut out = [ReplayResult::default(), ReplayResult::default(), ReplayResult::default()];
        for (out, (dz, dv)) in out.iter_mut().zip([(0.0, 0.0), (DZ_M, 0.0), (0.0, DV_MPS)]) {
            let mut moved = (*course).clone();
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
        // Where the speed is small a difference would cross the jump of dry friction.
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

/// Lines of the residual's spectrum.
fn lines(info: &'static EffectInfo, look: &ScoreTest, found: &[f64]) -> Vec<EffectStart> {
    found
        .iter()
        .filter_map(|&hz| {
            let quarter = core::f64::consts::FRAC_PI_2;
            let columns: Vec<JacobianColumn> = [[1e-3, hz, 0.0], [1e-3, hz, quarter]]
                .iter()
                .map(|v| look.effect_column(&EffectTerm::new(info, v)))
                .collect::<Option<Vec<_>>>()?;
            let gain = look.gain(&columns);
            let (a, b) = (gain.coefficients[0], gain.coefficients[1]);
            let amplitude = 1e-3 * libm::hypot(a, b);
            (amplitude > 0.0).then(|| EffectStart {
                choice: EffectTerm::new(info, &[amplitude, hz, libm::atan2(b, a)]),
                gain_nats: gain.nats,
                detectable_nats: gain.detectable_nats,
                model: None,
            })
        })
        .collect()
}

/// Stretches in m of what may break.
const STRETCHES_M: [f64; 4] = [8e-4, 3e-3, 8e-3, 2e-2];

/// Elements that stretch and break: at drops that no layer took, and on a grid of depths.
fn breaks(info: &'static EffectInfo, look: &ScoreTest, prepared: &PreparedRecordings) -> Vec<EffectStart> {
    let model = &look.fit.model;
    let surface = model.tissue.surface_m;
    let deepest =
        look.data.recordings.iter().flat_map(|b| b.pieces.iter()).fold(0.0_f64, |m, p| m.max(p.position_m))
            - surface;
    let mut depths: Vec<f64> = Vec::new();
    for (drops, instants) in prepared.drops.iter().zip(&model.rupture_times_s) {
        for d in drops {
            if instants.iter().all(|t| (t - d.time_s).abs() > 0.15) {
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
        .flat_map_iter(|depth| {
            STRETCHES_M.iter().filter(move |s| **s < *depth).filter_map(move |stretch| {
                let force: Vec<Vec<f64>> = look
                    .data
                    .recordings
                    .iter()
                    .map(|b| {
                        let (mut whole, mut f) = (true, vec![0.0; b.len()]);
                        for p in b.pieces.iter() {
                            let x = p.position_m - surface - (depth - stretch);
                            whole &= x < *stretch;
                            if whole && x > 0.0 {
                                f[p.block as usize] = x;
                            }
                        }
                        f
                    })
                    .collect();
                let gain = look.gain(&[look.force_column(&force)]);
                let k = gain.coefficients[0];
                (k > 1.0).then(|| EffectStart {
                    choice: EffectTerm::new(info, &[depth - stretch, k, k * stretch]),
                    gain_nats: gain.nats,
                    detectable_nats: gain.detectable_nats,
                    model: None,
                })
            })
        })
        .collect();
    out.sort_by(|a, b| b.gain_nats.total_cmp(&a.gain_nats));
    out.truncate(2);
    out
}

/// Drops within so many m of each other are one place.
const PLACE_M: f64 = 3e-3;
/// Most places.
const PLACES: usize = 6;

/// Elements that break where every recording drops, whatever has been made of those drops, by what the drops are.
pub(crate) fn starts_at_common_drops(
    info: &'static EffectInfo,
    prepared: &PreparedRecordings,
) -> Vec<EffectTerm> {
    let surface = prepared.assumed.tissue.surface_m;
    let Some((first, others)) = prepared.drops.split_first() else { return Vec::new() };
    let mut places: Vec<(f64, f64)> = first
        .iter()
        .filter_map(|d| {
            let near = |e: &&ForceDrop| (e.position_m - d.position_m).abs() < PLACE_M;
            let same: Vec<&ForceDrop> = others.iter().filter_map(|r| r.iter().find(near)).collect();
            let n = (same.len() + 1) as f64;
            let mean = |of: fn(&ForceDrop) -> f64| (of(d) + same.iter().map(|d| of(d)).sum::<f64>()) / n;
            (same.len() == others.len()).then(|| (mean(|d| d.position_m) - surface, mean(|d| d.size_n)))
        })
        .collect();
    places.sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
    places.truncate(PLACES);
    let from = |(depth, size): (f64, f64)| {
        let shorter = STRETCHES_M.into_iter().filter(move |s| *s < depth);
        shorter.map(move |s| EffectTerm::new(info, &[depth - s, size / s, size]))
    };
    places.into_iter().flat_map(from).collect()
}

#[cfg(test)]
mod tests {
    use super::{EffectStart, effect_starts, slopes};
    use crate::base_law_fit::PreparedRecordings;
    use crate::repeated_insertions::multistart_fit::SetFit;
    use crate::test_fixtures::{
        assumed_layers, fit_from_truth, recordings_with_added_force, simulated_recordings,
    };
    use std::sync::Arc;
    use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
    use stylet_identify::fit::{Fit, JacobianColumn};
    use stylet_identify::force_drops::ForceDrop;
    use stylet_identify::likelihood::{FitData, residuals};
    use stylet_identify::model::{EffectTerm, Model};
    use stylet_identify::noise::Noise;
    use stylet_identify::score_test::{ScoreTest, ScoreTestResult};
    use stylet_record::Recording;
    use stylet_tissue::{
        AnyEffect, CoulombFriction, EffectInfo, ForceDrift, HiddenMembrane, RateDependentPuncture,
        Respiration,
    };

    /// Speeds (m/s) of the insertions, and by how much (m) their surfaces are moved.
    const AT: [[f64; 2]; 3] = [[2e-3, 3e-4], [3e-3, -3e-4], [4e-3, 0.0]];

    /// Insertions with these effects, fitted without them.
    fn without(effects: &[AnyEffect]) -> SetFit {
        let runs = simulated_recordings(effects, &AT);
        fit_from_truth(&[], &runs.iter().collect::<Vec<_>>())
    }

    /// The starts for these insertions, and the first of one effect.
    fn proposed(f: &SetFit, lines: &[f64], id: &str) -> (Vec<Vec<EffectStart>>, Option<EffectStart>) {
        let prepared = PreparedRecordings::new(f.fit.model.assumed.clone(), f.data.recordings.to_vec(), 0.0);
        let all = effect_starts(&ScoreTest::new(&f.fit, &f.data), &prepared, lines);
        let own = all.iter().find(|s| s[0].choice.info.id == id).map(|s| s[0].clone());
        (all, own)
    }

    /// Insertions off a sensor that shows so much more, fitted without it.
    fn unaware(more_n: impl Fn(f64) -> f64) -> SetFit {
        let runs = recordings_with_added_force(&[], &AT, more_n);
        fit_from_truth(&[], &runs.iter().collect::<Vec<_>>())
    }

    #[test]
    fn effects_start_where_they_would_gain_most_at_most_twice_each() {
        let f = unaware(|t| 0.02 * t);
        let (all, own) = proposed(&f, &[], "force_drift");
        let own = own.expect("a drift");
        assert!((own.choice.values[0] - 0.02).abs() < 2e-3, "{:?}", own.choice.values);
        assert!(own.gain_nats > 1.0 && all.iter().all(|s| s.len() <= 2));
        assert!(all.windows(2).all(|w| w[0][0].gain_nats >= w[1][0].gain_nats));
        assert!(all.iter().all(|s| s.windows(2).all(|w| w[0].gain_nats >= w[1].gain_nats)));
        assert!(proposed(&f, &[], "periodic_interference").1.is_none(), "no line, no tone");
        // What is in the law already is proposed no more.
        let runs = recordings_with_added_force(&[], &AT, |t| 0.02 * t);
        let drift: AnyEffect = ForceDrift { rate_n_per_s: 0.02 }.into();
        let f = fit_from_truth(&[drift], &runs.iter().collect::<Vec<_>>());
        assert!(proposed(&f, &[], "force_drift").1.is_none());
        let bias = proposed(&unaware(|_| -0.1), &[], "force_bias").1.expect("a bias");
        assert!((bias.choice.values[0] + 0.1).abs() < 0.02, "{:?}", bias.choice.values);
    }

    #[test]
    fn a_tone_starts_with_its_amplitude_and_phase_at_the_line_that_was_found() {
        for (amplitude_n, phase_rad) in [(0.05, 0.7), (0.03, -2.1)] {
            let f = unaware(|t| amplitude_n * (std::f64::consts::TAU * 1.7 * t + phase_rad).sin());
            let start = proposed(&f, &[1.7], "periodic_interference").1.expect("a tone");
            let v = &start.choice.values;
            assert!((v[0] / amplitude_n - 1.0).abs() < 0.1, "{v:?}");
            assert!(v[1] == 1.7 && (v[2] - phase_rad).abs() < 0.1, "{v:?}");
        }
    }

    #[test]
    fn a_breath_starts_near_its_frequency_with_its_amplitude_and_phase() {
        let breath = Respiration { amplitude_m: 1.5e-4, frequency_hz: 0.4, phase_rad: 0.9 };
        let f = without(&[breath.into()]);
        let start = proposed(&f, &[], "respiration").1.expect("a breath");
        let v = &start.choice.values;
        assert!((v[1] - 0.4).abs() < 0.03, "{v:?}");
        assert!((v[0] / 1.5e-4 - 1.0).abs() < 0.3, "{v:?}");
        // At the middle of the recordings the phase is that of the breath, whatever the grid made of the frequency.
        let at = |hz: f64, phase: f64| std::f64::consts::TAU * hz * 7.0 + phase;
        assert!((at(v[1], v[2]) - at(0.4, 0.9)).cos() > 0.8, "{v:?}");
    }

    /// Before the layer gives way the force is stiffness times depth and friction times speed times depth.
    #[test]
    fn the_force_changes_with_depth_by_the_stiffness_and_with_speed_by_the_friction_inside() {
        let f = without(&[]);
        let (fz, fv) = slopes(&ScoreTest::new(&f.fit, &f.data)).expect("slopes");
        let model = &f.fit.model;
        let layer = &model.tissue.layers[0];
        let mut count = 0;
        for (r, b) in f.data.recordings.iter().enumerate() {
            let friction = layer.friction_ns_per_m2 * model.per_recording[r].ln_friction.exp();
            let surface_m = model.tissue.surface_m + model.per_recording[r].surface_m;
            for k in 0..b.len() {
                let (z, v) = b.motion.at(0.5 * (b.start_s[k] + b.end_s[k]));
                let inside = z - surface_m;
                if v > 1e-3 && (1e-3..5e-3).contains(&inside) {
                    let (wanted_z, wanted_v) = (layer.stiffness_n_per_m + friction * v, friction * inside);
                    assert!((fz[r][k] / wanted_z - 1.0).abs() < 0.05, "{} for {wanted_z}", fz[r][k]);
                    assert!((fv[r][k] / wanted_v - 1.0).abs() < 0.05, "{} for {wanted_v}", fv[r][k]);
                    count += 1;
                } else if inside < -1e-3 {
                    assert_eq!((fz[r][k], fv[r][k]), (0.0, 0.0));
                }
            }
        }
        assert!(count > 50, "{count}");
    }

    /// A membrane that begins 2 mm deep and breaks after 3 mm leaves a rise and a drop that no layer takes.
    #[test]
    fn a_membrane_starts_where_the_force_rose_and_broke_off() {
        let membrane = HiddenMembrane { depth_m: 2e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
        let f = without(&[membrane.into()]);
        let start = proposed(&f, &[], "hidden_membrane").1.expect("a membrane");
        let v = &start.choice.values;
        // It breaks 5 mm deep; the grid of depths is a millimetre wide.
        assert!((v[0] + v[2] / v[1] - 5e-3).abs() < 1.1e-3, "{v:?}");
        assert!(v[1] > 30.0 && v[1] < 400.0, "{v:?}");
        assert!(start.gain_nats > 20.0 && start.detectable_nats > 0.0);
    }

    /// An effect that only adds is not proposed to take away: every start has a strength.
    #[test]
    fn every_start_has_a_strength() {
        let membrane = HiddenMembrane { depth_m: 2e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
        let inside = |t: f64| if t > 3.0 { 0.1 } else { 0.0 };
        for f in
            [unaware(|t| 0.02 * t), unaware(inside), unaware(|t| -inside(t)), without(&[membrane.into()])]
        {
            let (all, _) = proposed(&f, &[], "");
            assert!(all.len() > 3);
            for s in all.iter().flatten() {
                let strong = |(p, x): (&stylet_tissue::ParameterInfo, &f64)| {
                    p.strength && (x - p.inactive).abs() > 1e-12 && *x < 1e9
                };
                assert!(
                    s.choice.info.parameters.iter().zip(&s.choice.values).any(strong),
                    "{} {:?}",
                    s.choice.info.id,
                    s.choice.values
                );
            }
        }
    }

    fn info(id: &str) -> &'static EffectInfo {
        stylet_tissue::effect_info(id).expect("in the library")
    }

    /// What an effect adds to the force, and not to the instants of ruptures.
    fn force(look: &ScoreTest, choice: &EffectTerm) -> JacobianColumn {
        let mut column = look.effect_column(choice).expect("a column");
        column.rupture_rows.iter_mut().for_each(|r| r.fill(0.0));
        column
    }

    /// The force moves with the tissue: a breath gains what its sine and its cosine gain together, and stands where they do.
    #[test]
    fn a_breath_at_any_frequency_gains_what_its_two_columns_do() {
        let breath = Respiration { amplitude_m: 1.5e-4, frequency_hz: 0.4, phase_rad: 0.9 };
        let f = without(&[breath.into()]);
        let look = ScoreTest::new(&f.fit, &f.data);
        let told = super::breath(info("respiration"), &look);
        let longest = f.data.recordings.iter().map(|b| b.span_s().1 - b.span_s().0).fold(0.0, f64::max);
        assert_eq!(told.len(), (1.15 * longest / 0.6) as usize);
        for (k, s) in told.iter().enumerate() {
            let [amplitude, hz, phase] = s.choice.values[..] else { unreachable!("three numbers") };
            assert!((hz - 0.05 - k as f64 * 0.6 / longest).abs() < 1e-12, "{hz}");
            let columns = [0.0, 0.5 * std::f64::consts::PI]
                .map(|phase| force(&look, &EffectTerm::new(s.choice.info, &[1e-6, hz, phase])));
            let gain = look.gain(&columns);
            assert!((s.gain_nats / gain.nats - 1.0).abs() < 0.01, "{hz}: {} for {}", s.gain_nats, gain.nats);
            let (a, b) = (1e-6 * gain.coefficients[0], 1e-6 * gain.coefficients[1]);
            let off = (amplitude * phase.cos() - a).hypot(amplitude * phase.sin() - b);
            assert!(off < 0.01 * a.hypot(b), "{hz}: {amplitude} {phase} for {a} {b}");
        }
    }

    /// A needle in air, and a residual of nothing at all.
    #[test]
    fn what_has_no_amplitude_does_not_start() {
        let t: Vec<f64> = (0..600).map(|k| 0.02 * f64::from(k)).collect();
        let z = t.iter().map(|t| -0.05 + 1e-3 * t).collect();
        let r = Recording::new(t, z, vec![0.0; 600]).expect("a recording");
        let data =
            FitData::new(Arc::new(vec![BlockAverages::new(&r, &[], BLOCK_S)]), Noise::white(0.02), 0.0);
        let model = Model::base(assumed_layers(&[[0.02, 100.0, 1000.0]]), 1);
        let fit = Fit { residuals: residuals(&model, &data).expect("a replay"), model };
        let look = ScoreTest::new(&fit, &data);
        assert!(super::breath(info("respiration"), &look).is_empty());
        assert!(super::lines(info("periodic_interference"), &look, &[1.7]).is_empty());
    }

    #[test]
    fn dry_friction_does_not_change_with_speed_at_rest() {
        let rubs: AnyEffect = CoulombFriction { c_n_per_m: 50.0 }.into();
        let runs = simulated_recordings(std::slice::from_ref(&rubs), &AT);
        let f = fit_from_truth(&[rubs], &runs.iter().collect::<Vec<_>>());
        let (_, fv) = slopes(&ScoreTest::new(&f.fit, &f.data)).expect("slopes");
        let mut rests = 0;
        for (fv, b) in fv.iter().zip(f.data.recordings.iter()) {
            for (k, slope) in fv.iter().enumerate() {
                let (z, v) = b.motion.at(0.5 * (b.start_s[k] + b.end_s[k]));
                rests += usize::from(v == 0.0 && z > 0.01);
                assert!(slope.abs() < 1e5, "{slope} at {z}");
            }
        }
        assert!(rests > 10, "{rests}");
    }

    #[test]
    fn columns_of_the_wrong_sign_are_left_out_where_an_effect_only_adds() {
        let f = without(&[CoulombFriction { c_n_per_m: 50.0 }.into()]);
        let look = ScoreTest::new(&f.fit, &f.data);
        let started = |id: &str, group: &[&[f64]], coefficients: &[f64]| {
            let columns: Vec<_> =
                group.iter().filter_map(|v| look.effect_column(&EffectTerm::new(info(id), v))).collect();
            let gain = ScoreTestResult {
                nats: 7.0,
                coefficients: coefficients.to_vec(),
                detectable_nats: 1.0,
                unexplained_share: 1.0,
            };
            super::start(info(id), &look, group, &columns, gain)
        };
        for (id, values, adds) in [
            ("coulomb_friction", [1.0], true),
            ("needle_compliance", [1500.0], true),
            ("force_bias", [0.1], false),
            ("asymmetric_friction", [0.01], false),
        ] {
            assert_eq!(started(id, &[&values], &[0.5]).map(|s| s.gain_nats), Some(7.0), "{id}");
            assert_eq!(started(id, &[&values], &[0.0]).is_none(), adds, "{id}");
            assert_eq!(started(id, &[&values], &[-0.5]).is_none(), adds, "{id}");
        }
        let group: [&[f64]; 2] = [&[1.0, 1.0, 2e-3], &[0.0, 1.0, 2e-3]];
        let both = |a, b| started("stribeck_friction", &group, &[a, b]);
        assert_eq!(both(2.0, 0.5).map(|s| s.choice.values), Some(vec![2.0, 2.5, 2e-3]));
        let first = super::columns(info("stribeck_friction"), &look, &group[..1]).expect("more friction");
        assert!(first.gain_nats > 1.0 && first.choice.values[0] == first.choice.values[1]);
        let second =
            super::columns(info("stribeck_friction"), &look, &group[1..]).expect("more at low speed");
        for (a, b, alone) in [(2.0, 0.0, &first), (-2.0, 3.0, &second), (0.0, 3.0, &second)] {
            let told = both(a, b).expect("the other one");
            assert_eq!((told.gain_nats, &told.choice.values), (alone.gain_nats, &alone.choice.values));
        }
        assert!(both(-2.0, -0.5).is_none());
    }

    #[test]
    fn what_only_ruptures_show_starts_from_a_model_of_its_own() {
        let later = RateDependentPuncture { alpha: 0.4 };
        let (all, own) = proposed(&without(&[later.into()]), &[], "rate_dependent_puncture");
        assert!(own.expect("a start").model.is_some());
        let at_ruptures = |s: &EffectStart| s.choice.info.stage == stylet_tissue::ChainStage::Puncture;
        assert!(all.iter().flatten().all(|s| s.model.is_none() || at_ruptures(s)));
    }

    /// What may break, by insertions with a membrane, where the force dropped at these depths (m) at these instants (s).
    fn breaking(f: &SetFit, drops: &[(f64, f64)]) -> Vec<EffectStart> {
        let surface_m = f.fit.model.tissue.surface_m;
        let drop = |&(depth_m, time_s): &(f64, f64)| ForceDrop {
            time_s,
            position_m: surface_m + depth_m,
            size_n: 0.3,
            score: 9.0,
        };
        let mut prepared =
            PreparedRecordings::new(f.fit.model.assumed.clone(), f.data.recordings.to_vec(), 0.0);
        prepared.drops = vec![drops.iter().map(drop).collect(), Vec::new(), Vec::new()];
        super::breaks(info("hidden_membrane"), &ScoreTest::new(&f.fit, &f.data), &prepared)
    }

    /// Depths (m) at which the starts break.
    fn depths(starts: &[EffectStart]) -> Vec<f64> {
        starts.iter().map(|s| &s.choice.values).map(|v| v[0] + v[2] / v[1]).collect()
    }

    #[test]
    fn what_may_break_gains_what_its_force_does_and_nothing_after() {
        let membrane = HiddenMembrane { depth_m: 2e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
        let runs = simulated_recordings(&[membrane.into()], &AT.map(|[speed, _]| [speed, 0.0]));
        let f = fit_from_truth(&[], &runs.iter().collect::<Vec<_>>());
        let look = ScoreTest::new(&f.fit, &f.data);
        let told = breaking(&f, &[]);
        assert_eq!(told.len(), 2);
        assert!(told[0].gain_nats >= told[1].gain_nats);
        for s in &told {
            let v = &s.choice.values;
            // Weak enough to break there, and not to shift a face.
            let broken = EffectTerm::new(s.choice.info, &[v[0], 1e-3, 1e-3 * v[2] / v[1]]);
            let gain = look.gain(&[force(&look, &broken)]);
            // But for the block in which it breaks.
            assert!((s.gain_nats / gain.nats - 1.0).abs() < 0.15, "{} for {}", s.gain_nats, gain.nats);
            assert!((1e-3 * gain.coefficients[0] / v[1] - 1.0).abs() < 0.15, "{v:?}");
        }
    }

    #[test]
    fn what_may_break_breaks_at_drops_that_no_layer_took_or_at_whole_millimetres() {
        let membrane = HiddenMembrane { depth_m: 2.25e-3, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
        let f = without(&[membrane.into()]);
        let rupture_s = f.fit.model.rupture_times_s[0][0];
        let at = 5.25e-3;
        let breaks_at = |drops: &[(f64, f64)]| depths(&breaking(&f, drops))[0];
        let whole = breaks_at(&[]);
        assert!((whole - 5e-3).abs() < 1e-9, "{whole}");
        // Nearer in time than 0.15 s a layer has taken a drop.
        for (apart_s, taken) in [(-0.14, true), (0.14, true), (-0.16, false), (0.16, false)] {
            let told = breaks_at(&[(at, rupture_s + apart_s)]);
            assert!((told - if taken { whole } else { at }).abs() < 1e-9, "{apart_s}: {told}");
        }
        // Of two drops nearer than 0.3 mm the first stands for both.
        for (before_m, told_m) in [(2.5e-4, at - 2.5e-4), (3.5e-4, at)] {
            let told = breaks_at(&[(at, 1.0), (at - before_m, 1.0)]);
            assert!((told - told_m).abs() < 1e-9, "{told}");
        }
    }

    #[test]
    fn what_may_break_also_breaks_at_drops_that_all_recordings_show_whoever_took_them() {
        let f = without(&[]);
        let surface_m = f.fit.model.assumed.tissue.surface_m;
        let drop = |(depth_m, size_n): (f64, f64)| ForceDrop {
            time_s: 1.0,
            position_m: surface_m + depth_m,
            size_n,
            score: 9.0,
        };
        let mut prepared =
            PreparedRecordings::new(f.fit.model.assumed.clone(), f.data.recordings.to_vec(), 0.0);
        let told = |prepared: &PreparedRecordings| {
            let at = |c: &EffectTerm| (c.values[0] + c.values[2] / c.values[1], c.values[2]);
            super::starts_at_common_drops(info("hidden_membrane"), prepared)
                .iter()
                .map(at)
                .collect::<Vec<_>>()
        };
        // One place within three millimetres, another one that a recording does not show.
        prepared.drops =
            [[(5e-3, 0.2), (12e-3, 0.9)], [(6e-3, 0.3), (20e-3, 0.9)], [(7e-3, 0.4), (12e-3, 0.9)]]
                .map(|of| of.map(drop).to_vec())
                .to_vec();
        let told_at = told(&prepared);
        // Stretches of 0.8 and 3 mm are shorter than it is deep.
        assert_eq!(told_at.len(), 2);
        for (depth_m, size_n) in told_at {
            assert!((depth_m - 6e-3).abs() < 1e-9 && (size_n - 0.3).abs() < 1e-9, "{depth_m} {size_n}");
        }
        prepared.drops[1].clear();
        assert_eq!(told(&prepared), []);
    }

    #[test]
    fn what_may_break_begins_within_the_tissue_and_breaks_where_the_needle_has_been() {
        let whole = HiddenMembrane { depth_m: 5e-3, stiffness_n_per_m: 120.0, puncture_n: 9.0 };
        let at_surface = HiddenMembrane { depth_m: 0.0, stiffness_n_per_m: 120.0, puncture_n: 0.36 };
        for membrane in [whole, at_surface] {
            let told = breaking(&without(&[membrane.into()]), &[]);
            assert!(!told.is_empty());
            let ends = depths(&told);
            assert!(
                told.iter().zip(&ends).all(|(s, end)| s.choice.values[0] > 1e-9 && *end < 0.0121),
                "{ends:?}"
            );
        }
    }
}
