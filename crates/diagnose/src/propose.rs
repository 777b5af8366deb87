//! Where a search begins: for every effect the starts that gain most to first order.

use crate::base::Prepared;
use rayon::prelude::*;
use stylet_identify::fit::Column;
use stylet_identify::look::{Gain, Look, scaled};
use stylet_identify::model::{Choice, Model};
use stylet_tissue::{EffectInfo, Place, Proposal, library};

/// A start with what it gains to first order.
#[derive(Clone, Debug)]
pub struct Start {
    /// The effect with its values.
    pub choice: Choice,
    /// Nats to first order.
    pub nats: f64,
    /// Nats that the effect at its probe would show.
    pub visible: f64,
    /// The model to fit from, where it is not the one so far with the effect: ranked without a short fit.
    pub model: Option<Model>,
}

/// The best starts of every effect, best effect first, at most two of each; `lines` (Hz) are those of the residual's spectrum.
#[must_use]
pub fn starts(look: &Look, prepared: &Prepared, lines: &[f64]) -> Vec<Vec<Start>> {
    let taken: Vec<&str> = look.fit.model.effects.iter().map(|e| e.info.id).collect();
    let entries: Vec<&'static EffectInfo> = library().filter(|i| !taken.contains(&i.id)).collect();
    let mut all: Vec<Vec<Start>> = entries
        .par_iter()
        .map(|info| {
            let mut own = of(info, look, prepared, lines);
            if info.place == Place::Puncture {
                own.extend(crate::at_ruptures::start(info, look));
            }
            own.sort_by(|a, b| b.nats.total_cmp(&a.nats));
            own.truncate(2);
            own
        })
        .filter(|s| !s.is_empty())
        .collect();
    all.sort_by(|a, b| b[0].nats.total_cmp(&a[0].nats));
    all
}

fn of(info: &'static EffectInfo, look: &Look, prepared: &Prepared, hz: &[f64]) -> Vec<Start> {
    match info.proposal {
        Proposal::Columns(groups) => groups.iter().filter_map(|g| columns(info, look, g)).collect(),
        Proposal::Faces(shift) => {
            (1..look.fit.model.layers()).filter_map(|l| columns(info, look, &[&[l as f64, shift]])).collect()
        }
        Proposal::Breath => breath(info, look),
        Proposal::Line => lines(info, look, hz),
        Proposal::Break => breaks(info, look, prepared),
        Proposal::Raw | Proposal::PerLayer => Vec::new(),
    }
}

/// The start of a group of columns.
fn columns(info: &'static EffectInfo, look: &Look, group: &[&[f64]]) -> Option<Start> {
    let columns: Vec<Column> =
        group.iter().map(|v| look.column(&Choice::new(info, v))).collect::<Option<Vec<_>>>()?;
    let gain = look.gain(&columns);
    start(info, look, group, &columns, gain)
}

fn start(
    info: &'static EffectInfo,
    look: &Look,
    group: &[&[f64]],
    columns: &[Column],
    gain: Gain,
) -> Option<Start> {
    let values = scaled(info, group, &gain.coefficients);
    let choice = Choice::new(info, &values);
    choice.effect().filter(|e| e.check().is_ok())?;
    let one_sided =
        info.parameters.iter().all(|p| !p.strength || p.low >= p.neutral || p.neutral == f64::INFINITY);
    let nats = if one_sided && gain.coefficients.iter().any(|c| *c <= 0.0) {
        // Columns whose coefficient has the wrong sign are of no use; the others may be.
        let kept: Vec<usize> = (0..group.len()).filter(|k| gain.coefficients[*k] > 0.0).collect();
        if kept.is_empty() || kept.len() == group.len() {
            return None;
        }
        let part: Vec<Column> = kept.iter().map(|k| columns[*k].clone()).collect();
        let of: Vec<&[f64]> = kept.iter().map(|k| group[*k]).collect();
        let less = look.gain(&part);
        return start(info, look, &of, &part, less);
    } else {
        gain.nats
    };
    Some(Start { choice, nats, visible: gain.visible, model: None })
}

/// Lowest and highest frequency in Hz of a breath.
const BREATH_HZ: (f64, f64) = (0.05, 1.2);

/// Motions of the tissue at every frequency of a grid.
fn breath(info: &'static EffectInfo, look: &Look) -> Vec<Start> {
    const AMPLITUDE_M: f64 = 1e-4;
    let longest = look.data.blocks.iter().map(|b| b.span_s().1 - b.span_s().0).fold(1.0, f64::max);
    let step = 0.6 / longest;
    let Some((fz, fv)) = slopes(look) else { return Vec::new() };
    let count = ((BREATH_HZ.1 - BREATH_HZ.0) / step) as usize;
    (0..count)
        .filter_map(|k| {
            let hz = BREATH_HZ.0 + step * k as f64;
            let omega = core::f64::consts::TAU * hz;
            let mut parts = [Vec::new(), Vec::new()];
            for (r, b) in look.data.blocks.iter().enumerate() {
                let mut pair = [vec![0.0; b.len()], vec![0.0; b.len()]];
                for i in 0..b.len() {
                    let (s, c) = libm::sincos(omega * 0.5 * (b.from_s[i] + b.to_s[i]));
                    let (z, v) = (fz[r][i], fv[r][i]);
                    pair[0][i] = -AMPLITUDE_M * (s * z + omega * c * v);
                    pair[1][i] = -AMPLITUDE_M * (c * z - omega * s * v);
                }
                let [a, b] = pair;
                parts[0].push(a);
                parts[1].push(b);
            }
            let columns = [look.of_force(&parts[0]), look.of_force(&parts[1])];
            let gain = look.gain(&columns);
            let (a, b) = (gain.coefficients[0], gain.coefficients[1]);
            let amplitude = AMPLITUDE_M * libm::hypot(a, b);
            (amplitude > 0.0).then(|| Start {
                choice: Choice::new(info, &[amplitude, hz, libm::atan2(b, a)]),
                nats: gain.nats,
                visible: gain.visible,
                model: None,
            })
        })
        .collect()
}

/// A value of every block, per recording.
type PerBlock = Vec<Vec<f64>>;

/// How the predicted force changes with depth (N/m) and with speed (N s/m), block by block.
fn slopes(look: &Look) -> Option<(PerBlock, PerBlock)> {
    use stylet_identify::forward::{Replayed, imposed};
    use stylet_identify::objective::pieces;
    const DZ_M: f64 = 1e-6;
    const DV_MPS: f64 = 1e-6;
    let model = &look.fit.model;
    let (mut fz, mut fv) = (Vec::new(), Vec::new());
    for (r, b) in look.data.blocks.iter().enumerate() {
        let compiled = model.compile(r)?;
        let course = pieces(&compiled, b);
        let mut out = [Replayed::default(), Replayed::default(), Replayed::default()];
        for (out, (dz, dv)) in out.iter_mut().zip([(0.0, 0.0), (DZ_M, 0.0), (0.0, DV_MPS)]) {
            let mut moved = (*course).clone();
            for p in &mut moved {
                p.z_m += dz;
                p.v_mps += dv;
            }
            imposed(&compiled, b, &moved, &model.instants[r], out);
        }
        let slope =
            |x: &[f64], h: f64| -> Vec<f64> { x.iter().zip(&out[0].f).map(|(x, f)| (x - f) / h).collect() };
        fz.push(slope(&out[1].f, DZ_M));
        // Where the speed is small a difference would cross the jump of dry friction.
        let mut v = slope(&out[2].f, DV_MPS);
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
fn lines(info: &'static EffectInfo, look: &Look, found: &[f64]) -> Vec<Start> {
    found
        .iter()
        .filter_map(|&hz| {
            let quarter = core::f64::consts::FRAC_PI_2;
            let columns: Vec<Column> = [[1e-3, hz, 0.0], [1e-3, hz, quarter]]
                .iter()
                .map(|v| look.column(&Choice::new(info, v)))
                .collect::<Option<Vec<_>>>()?;
            let gain = look.gain(&columns);
            let (a, b) = (gain.coefficients[0], gain.coefficients[1]);
            let amplitude = 1e-3 * libm::hypot(a, b);
            (amplitude > 0.0).then(|| Start {
                choice: Choice::new(info, &[amplitude, hz, libm::atan2(b, a)]),
                nats: gain.nats,
                visible: gain.visible,
                model: None,
            })
        })
        .collect()
}

/// Stretches in m of what may break.
const STRETCHES_M: [f64; 4] = [8e-4, 3e-3, 8e-3, 2e-2];

/// Elements that stretch and break: at drops that no layer took, and on a grid of depths.
fn breaks(info: &'static EffectInfo, look: &Look, prepared: &Prepared) -> Vec<Start> {
    let model = &look.fit.model;
    let surface = model.tissue.surface_m;
    let deepest =
        look.data.blocks.iter().flat_map(|b| b.pieces.iter()).fold(0.0_f64, |m, p| m.max(p.z_m)) - surface;
    let mut depths: Vec<f64> = Vec::new();
    for (drops, instants) in prepared.drops.iter().zip(&model.instants) {
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
    depths.retain(|d| *d > 5e-4 && *d < deepest);
    let mut out: Vec<Start> = depths
        .par_iter()
        .flat_map_iter(|depth| {
            STRETCHES_M.iter().filter(move |s| **s < *depth).filter_map(move |stretch| {
                let force: Vec<Vec<f64>> = look
                    .data
                    .blocks
                    .iter()
                    .map(|b| {
                        let (mut whole, mut f) = (true, vec![0.0; b.len()]);
                        for p in b.pieces.iter() {
                            let x = p.z_m - surface - (depth - stretch);
                            whole &= x < *stretch;
                            if whole && x > 0.0 {
                                f[p.block as usize] = x;
                            }
                        }
                        f
                    })
                    .collect();
                let gain = look.gain(&[look.of_force(&force)]);
                let k = gain.coefficients[0];
                (k > 1.0).then(|| Start {
                    choice: Choice::new(info, &[depth - stretch, k, k * stretch]),
                    nats: gain.nats,
                    visible: gain.visible,
                    model: None,
                })
            })
        })
        .collect();
    out.sort_by(|a, b| b.nats.total_cmp(&a.nats));
    out.truncate(2);
    out
}
