//! Whether an effect is as strong whatever else is let to explain what is left.
//!
//! Beside something that no effect of the library explains, a fit leaves a force of unknown shape. Let that force be any smooth function of one
//! thing that insertions go by, the same in all of them: of depth, of time, of speed, of the travel since a turn, of the whole travel, of
//! acceleration; as it is, and against the motion. An effect that is there keeps its strength beside any of them: what they say is not what it
//! says. One that stands for a part of the unknown force gives it up to whichever says that better, or takes more.

use stylet_identify::blocks::Blocks;
use stylet_identify::fit::Column;
use stylet_identify::look::Look;
use stylet_identify::model::Role;
use stylet_identify::objective::replay;
use stylet_stats::linear::{Factor, Symmetric, dot};
use stylet_stats::order::quantile_of_sorted;
use stylet_tissue::effect::sgn;

/// Places between which a smooth function is straight; every piece has as many blocks.
const KNOTS: usize = 17;
/// Where less than this share of what tells an effect is left beside such functions, they say all that it says: its strength is not told.
const TOLD: f64 = 0.02;

/// So many standard errors, told as if blocks knew nothing of each other, are three: what is left of an unknown force is alike over some
/// tenths of a second, ten blocks.
const SURE: f64 = 9.0;

/// By which share of itself the strength of an effect moves, at most, when what is left may also be a smooth function of one of the things
/// that insertions go by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// As it is told.
    pub told: f64,
    /// At least so much, by three standard errors.
    pub surely: f64,
}

impl Moved {
    /// Nothing is known of it.
    pub const UNKNOWN: Self = Self { told: f64::INFINITY, surely: f64::INFINITY };
}

/// Forces that what is left may be: for each of the things that insertions go by columns that span its smooth functions. They are the same for
/// every effect of a fit.
#[must_use]
pub fn shapes(look: &Look<'_>) -> Vec<Vec<Column>> {
    along(look).iter().map(|x| functions(look, x)).collect()
}

/// How far the strength of an effect moves beside forces of other shapes; shapes that leave nothing of the effect are not asked.
#[must_use]
pub fn moved(look: &Look<'_>, shapes: &[Vec<Column>], effect: usize) -> Moved {
    let Some(force) = force(look, effect) else { return Moved::UNKNOWN };
    let others = Others::new(look, effect);
    let own = look.of_force(&force);
    let Some(stands) = others.strength(&own, &[]) else { return Moved::UNKNOWN };
    let beside = |shape: &Vec<Column>| {
        let now = others.strength(&own, shape)?;
        // What such a force takes away adds to the variance.
        let error = now.error * (1.0 - now.left).max(0.0).sqrt();
        let told = (now.more - stands.more).abs();
        (now.left > TOLD).then(|| Moved { told, surely: (told - SURE * error).max(0.0) })
    };
    let most = |a: Moved, b: Moved| Moved { told: a.told.max(b.told), surely: a.surely.max(b.surely) };
    shapes.iter().filter_map(beside).fold(Moved { told: 0.0, surely: 0.0 }, most)
}

/// The force of an effect in every block (N), by recording.
pub(crate) fn force(look: &Look<'_>, effect: usize) -> Option<Vec<Vec<f64>>> {
    let (fit, data) = (look.fit, look.data);
    let less = fit.model.without(effect);
    let of = |model, r| Some(replay(model, data, r)?.f);
    let part = |r| Some(of(&fit.model, r)?.iter().zip(of(&less, r)?).map(|(a, b)| a - b).collect());
    (0..data.recordings()).map(part).collect()
}

/// All that is fitted but the numbers of one effect.
struct Others<'a> {
    look: &'a Look<'a>,
    kept: Vec<usize>,
    factor: Factor,
    slope: Vec<f64>,
}

impl<'a> Others<'a> {
    fn new(look: &'a Look<'a>, effect: usize) -> Self {
        let tangent = &look.tangent;
        let its = |i: usize| {
            let role = tangent.shared.get(i).map(|n| n.role);
            matches!(role, Some(Role::Effect { effect: e, .. }) if e == effect)
        };
        let kept: Vec<usize> = (0..tangent.slope.len()).filter(|i| !its(*i)).collect();
        let factor = tangent.matrix.part(&kept).factor();
        let slope: Vec<f64> = kept.iter().map(|i| tangent.slope[*i]).collect();
        let slope = factor.half(&slope);
        Self { look, kept, factor, slope }
    }

    /// How strong a force is beside other columns.
    fn strength(&self, own: &Column, beside: &[Column]) -> Option<Strength> {
        let recordings = self.look.data.recordings();
        let columns: Vec<&Column> = beside.iter().chain([own]).collect();
        let half = |c: &&Column| {
            let all = self.look.tangent.against(c, recordings);
            self.factor.half(&self.kept.iter().map(|i| all[*i]).collect::<Vec<_>>())
        };
        let halves: Vec<Vec<f64>> = columns.iter().map(half).collect();
        let (last, mut left) = (beside.len(), Symmetric::zeros(columns.len()));
        let mut slope = vec![0.0; columns.len()];
        for (i, c) in columns.iter().enumerate() {
            slope[i] = c.dot_all(&self.look.tangent.rest) - dot(&halves[i], &self.slope);
            for j in 0..=i {
                let all = c.dot_all(columns[j]);
                let beside = all - dot(&halves[i], &halves[j]);
                left.add(i, j, if i == j { beside.max(1e-9 * all) } else { beside });
            }
        }
        let alone = left.at(last, last);
        let places: Vec<usize> = (0..last).collect();
        let functions = left.part(&places).factor();
        let with: Vec<f64> = places.iter().map(|i| left.at(*i, last)).collect();
        let with = functions.half(&with);
        let told = alone - dot(&with, &with);
        let explained = functions.half(&slope[..last]);
        let rest = slope[last] - dot(&with, &explained);
        let rests = &self.look.tangent.rest;
        let square = rests.dot_all(rests) - dot(&self.slope, &self.slope) - dot(&explained, &explained);
        let variance = square.max(0.0) / self.look.data.compared().max(1) as f64;
        (alone > 0.0 && told > 0.0).then(|| Strength {
            more: rest / told,
            error: (variance / told).sqrt(),
            left: told / alone,
        })
    }
}

/// How strong a force is, of one that is as strong as it was fitted.
struct Strength {
    /// What a fit adds to it.
    more: f64,
    /// Its standard error if blocks knew nothing of each other.
    error: f64,
    /// Share of what tells it that is left beside the other columns.
    left: f64,
}

/// What insertions go by, one value a block and recording each.
fn along(look: &Look<'_>) -> [Vec<Vec<f64>>; 6] {
    let mut all: [Vec<Vec<f64>>; 6] = std::array::from_fn(|_| Vec::new());
    for b in look.data.blocks.iter() {
        all.iter_mut().for_each(|x| x.push(Vec::with_capacity(b.len())));
        let (mut since, mut whole, mut way, mut before) = (0.0, 0.0, 0.0, None);
        for k in 0..b.len() {
            let t = mid_s(b, k);
            let (z, v) = b.motion.at(t);
            let (t_before, z_before, v_before) = before.unwrap_or((t, z, v));
            if sgn(v) != 0.0 && sgn(v) != way {
                (way, since) = (sgn(v), 0.0);
            }
            let travelled = (z - z_before).abs();
            since += travelled;
            whole += if z > look.fit.model.tissue.surface_m { travelled } else { 0.0 };
            let a = if t > t_before { (v - v_before) / (t - t_before) } else { 0.0 };
            before = Some((t, z, v));
            let from_start = t - mid_s(b, 0);
            for (x, value) in all.iter_mut().zip([z, from_start, v, since, whole, a]) {
                if let Some(x) = x.last_mut() {
                    x.push(value);
                }
            }
        }
    }
    all
}

fn mid_s(b: &Blocks, k: usize) -> f64 {
    0.5 * (b.from_s[k] + b.to_s[k])
}

/// Forces that span the functions of something that are straight between knots, as they are and against the motion.
fn functions(look: &Look<'_>, along: &[Vec<f64>]) -> Vec<Column> {
    let mut sorted: Vec<f64> = along.iter().flatten().copied().collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let mut knots: Vec<f64> =
        (0..KNOTS).map(|k| quantile_of_sorted(&sorted, k as f64 / (KNOTS - 1) as f64)).collect();
    knots.dedup();
    let way = |r: usize, k: usize| {
        let b = &look.data.blocks[r];
        sgn(b.motion.at(mid_s(b, k)).1)
    };
    let mut out = Vec::new();
    for knot in 0..knots.len() {
        let hat: Vec<Vec<f64>> =
            along.iter().map(|x| x.iter().map(|x| hat(&knots, knot, *x)).collect()).collect();
        let against = hat.iter().enumerate().map(|(r, h)| {
            h.iter().enumerate().map(|(k, h)| if *h == 0.0 { 0.0 } else { h * way(r, k) }).collect()
        });
        out.push(look.of_force(&against.collect::<Vec<_>>()));
        out.push(look.of_force(&hat));
    }
    out
}

/// One at a knot, zero at its neighbours and beyond, straight between.
fn hat(knots: &[f64], knot: usize, x: f64) -> f64 {
    let at = knots[knot];
    let next = if x < at { knot.checked_sub(1) } else { Some(knot + 1) };
    match next.and_then(|n| knots.get(n)) {
        Some(next) => (1.0 - (x - at) / (next - at)).max(0.0),
        None => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::hat;

    #[test]
    fn a_function_is_straight_between_its_knots() {
        let knots = [0.0, 1.0, 3.0];
        let of = |x: f64| [0, 1, 2].map(|k| hat(&knots, k, x));
        assert_eq!(of(1.0), [0.0, 1.0, 0.0]);
        assert_eq!(of(2.5), [0.0, 0.25, 0.75]);
        assert_eq!((of(-1.0), of(9.0)), ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]));
    }
}
