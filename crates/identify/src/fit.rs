//! Bounded, damped least squares of all numbers of a model, the instants of its ruptures included.

use crate::events::{rows_like, scatter_of};
use crate::forward::Replayed;
use crate::model::{Model, NEVER, Number, Role};
use crate::noise::LOSS;
use crate::objective::{Data, Residuals, Trail, nats, replay, residuals};
use core::ops::Range;
use rayon::prelude::*;
use stylet_stats::linear::{Factor, Symmetric, dot};

/// A fitted model.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// What it leaves.
    pub residuals: Residuals,
}

impl Fit {
    /// Nats, with the noise of the data as it is.
    #[must_use]
    pub fn nats(&self) -> f64 {
        self.residuals.nats
    }

    /// Root mean square in N of what is left at the blocks that are compared.
    #[must_use]
    pub fn rms_n(&self, data: &Data) -> f64 {
        let (mut sum, mut n) = (0.0, 0.0);
        for (b, e) in data.blocks.iter().zip(&self.residuals.e) {
            for k in (0..b.len()).filter(|k| b.used[*k]) {
                sum += e[k] * e[k];
                n += 1.0;
            }
        }
        (sum / f64::max(n, 1.0)).sqrt()
    }
}

/// A change of all residuals with a number.
#[derive(Clone, Debug, Default)]
pub struct Column {
    /// Weighted, whitened change of the prediction, per recording.
    pub w: Vec<Vec<f64>>,
    /// Change of the rows of every event, per recording.
    pub rows: Vec<Vec<f64>>,
}

impl Column {
    /// Scalar product over one recording.
    #[must_use]
    pub fn dot(&self, other: &Self, r: usize) -> f64 {
        let part = |a: &Vec<Vec<f64>>, b: &Vec<Vec<f64>>| match (a.get(r), b.get(r)) {
            (Some(a), Some(b)) => dot(a, b),
            _ => 0.0,
        };
        part(&self.w, &other.w) + part(&self.rows, &other.rows)
    }

    /// Scalar product over all recordings.
    #[must_use]
    pub fn dot_all(&self, other: &Self) -> f64 {
        (0..self.w.len()).map(|r| self.dot(other, r)).sum()
    }
}

/// The blocks of every recording from the first to the last at which a column is something: many numbers change a short stretch alone.
fn lit(column: &Column) -> Vec<Range<usize>> {
    let of = |w: &Vec<f64>| {
        let first = w.iter().position(|w| *w != 0.0).unwrap_or(w.len());
        first..w.iter().rposition(|w| *w != 0.0).map_or(first, |k| k + 1)
    };
    column.w.iter().map(of).collect()
}

/// The linear picture of a model around where it stands.
pub struct Tangent {
    /// Numbers that all recordings share.
    pub shared: Vec<Number>,
    /// Numbers of each recording's own.
    pub own: Vec<Number>,
    /// Their columns, `shared` first.
    pub columns: Vec<Column>,
    /// The residuals as a column, weighted.
    pub rest: Column,
    /// Normal matrix with priors: `shared`, then the own ones recording by recording.
    pub matrix: Symmetric,
    /// Downhill direction: minus the gradient of the nats.
    pub slope: Vec<f64>,
    roots: Vec<Vec<f64>>,
    /// Where each column is something.
    lit: Vec<Vec<Range<usize>>>,
}

impl Tangent {
    /// Where an own number stands in the matrix.
    #[must_use]
    pub fn place(&self, own: usize, r: usize) -> usize {
        self.shared.len() + r * self.own.len() + own
    }

    /// The linear picture of `model` whose residuals are `at`.
    #[must_use]
    pub fn new(model: &Model, data: &Data, at: &Residuals) -> Self {
        let (shared, own) = (model.shared(), model.own_numbers());
        let roots: Vec<Vec<f64>> =
            at.w.iter().map(|w| w.iter().map(|w| LOSS.weight(*w).sqrt()).collect()).collect();
        let mut t = Self {
            rest: Column { w: weighted(&at.w, &roots), rows: event_rows(model, at, at) },
            shared,
            own,
            columns: Vec::new(),
            matrix: Symmetric::zeros(0),
            slope: Vec::new(),
            roots,
            lit: Vec::new(),
        };
        let numbers: Vec<Number> = t.shared.iter().chain(&t.own).copied().collect();
        let trails = trails(model, data);
        t.columns = numbers.par_iter().map(|n| t.derivative(model, data, at, n, &trails)).collect();
        t.assemble(model, data.recordings());
        t
    }

    /// The same with some numbers' changes over steps as wide as `step` says (both ways, per unit) in place of derivatives. A force
    /// that bends at a face moves by a jump to first order; moved by as much as the face is uncertain it goes up a ramp, which a slow
    /// noise hides far better.
    #[must_use]
    pub fn widened(
        mut self,
        model: &Model,
        data: &Data,
        at: &Residuals,
        step: &(dyn Fn(&Number) -> Option<f64> + Sync),
    ) -> Self {
        let trails = trails(model, data);
        let of = |n: &Number, step: f64| self.derivative(model, data, at, &Number { step, ..*n }, &trails);
        let wide = |n: &Number| {
            let step = step(n)?;
            let (mut up, down) = (of(n, step), of(n, -step));
            for (up, down) in up.w.iter_mut().zip(down.w).chain(up.rows.iter_mut().zip(down.rows)) {
                up.iter_mut().zip(down).for_each(|(a, b)| *a = 0.5 * (*a + b));
            }
            Some(up)
        };
        let numbers: Vec<Number> = self.shared.iter().chain(&self.own).copied().collect();
        let columns: Vec<Option<Column>> = numbers.par_iter().map(wide).collect();
        for (column, wide) in self.columns.iter_mut().zip(columns) {
            if let Some(wide) = wide {
                *column = wide;
            }
        }
        self.assemble(model, data.recordings());
        self
    }

    /// The column of a number by a forward difference.
    fn derivative(
        &self,
        model: &Model,
        data: &Data,
        at: &Residuals,
        n: &Number,
        trails: &[Option<Trail>],
    ) -> Column {
        let mut moved = model.clone();
        let mut steps = Vec::new();
        for r in 0..if n.role.is_own() { data.recordings() } else { 1 } {
            let x = model.get(n.role, r);
            let h = if x + n.step > n.high { -n.step } else { n.step };
            steps.push(h);
            if x < NEVER {
                moved.set(n.role, r, x + h);
            }
        }
        let h = |r: usize| steps.get(r).copied().unwrap_or(steps[0]);
        // An effect may act from the first sample on.
        let whole = match n.role {
            Role::Effect { .. } | Role::OwnEffect(_) => true,
            Role::OwnFriction | Role::DayFriction(_) => model.has_friction_effects(),
            _ => false,
        };
        let replayed = |r: usize| match trails.get(r).and_then(Option::as_ref).filter(|_| !whole) {
            Some(trail) => trail.replay(&moved, data, r),
            None => replay(&moved, data, r),
        };
        let mut column = self.change(model, data, at, replayed).unwrap_or_default();
        for (r, (w, rows)) in column.w.iter_mut().zip(&mut column.rows).enumerate() {
            let scale = 1.0 / h(r);
            w.iter_mut().chain(rows).for_each(|x| *x *= scale);
        }
        column
    }

    /// What changes between `model` and another one, as a column: predicted force weighted and whitened, rows of events.
    #[must_use]
    pub fn difference(&self, model: &Model, data: &Data, at: &Residuals, other: &Model) -> Option<Column> {
        self.change(model, data, at, |r| replay(other, data, r))
    }

    /// The same with the other model's replays.
    fn change(
        &self,
        model: &Model,
        data: &Data,
        at: &Residuals,
        other: impl Fn(usize) -> Option<Replayed>,
    ) -> Option<Column> {
        let mut column = Column::default();
        for (r, b) in data.blocks.iter().enumerate() {
            let replayed = other(r)?;
            // Predicted now less predicted before = residual before less residual now.
            let change: Vec<f64> =
                replayed.f.iter().zip(&at.e[r]).zip(&b.f).map(|((f, e), y)| f - (y - e)).collect();
            let mut w = data.whiten(r, &change);
            w.iter_mut().zip(&self.roots[r]).for_each(|(w, root)| *w *= root);
            column.w.push(w);
            let rows = replayed.events.iter().zip(&at.events[r]).flat_map(|(now, was)| {
                let (now, was) = (rows_like(now, &model.scatter, was), rows_like(was, &model.scatter, was));
                (0..4).map(move |k| was[k] - now[k])
            });
            column.rows.push(rows.collect());
        }
        Some(column)
    }

    fn assemble(&mut self, model: &Model, recordings: usize) {
        let (ns, no) = (self.shared.len(), self.own.len());
        let size = ns + recordings * no;
        let mut h = Symmetric::zeros(size);
        let mut g = vec![0.0; size];
        self.lit = self.columns.iter().map(lit).collect();
        let t = &*self;
        let all = |i: usize, c: &Column| (0..recordings).map(|r| t.dot(i, c, r)).sum();
        let row = |i: usize| t.columns[..=i].iter().chain([&t.rest]).map(|c| all(i, c)).collect();
        let rows: Vec<Vec<f64>> = (0..ns).into_par_iter().map(row).collect();
        for (i, row) in rows.iter().enumerate() {
            g[i] = row[i + 1];
            row[..=i].iter().enumerate().for_each(|(j, x)| h.add(i, j, *x));
        }
        // By recording and own number: with the shared ones, with the own ones before it and itself, and with the rest.
        let row = |k: usize| {
            let (r, i) = (k / no, ns + k % no);
            t.columns[..=i].iter().chain([&t.rest]).map(|c| t.dot(i, c, r)).collect()
        };
        let rows: Vec<Vec<f64>> = (0..recordings * no).into_par_iter().map(row).collect();
        for (k, row) in rows.iter().enumerate() {
            let (r, o) = (k / no, k % no);
            let i = ns + k;
            g[i] = row[ns + o + 1];
            row[..ns].iter().enumerate().for_each(|(j, x)| h.add(i, j, *x));
            row[ns..=ns + o].iter().enumerate().for_each(|(p, x)| h.add(i, ns + r * no + p, *x));
        }
        let mut prior = |i: usize, n: &Number, x: f64| {
            if n.sd.is_finite() {
                let information = 1.0 / (n.sd * n.sd);
                h.add(i, i, information);
                g[i] -= (x - n.mean) * information;
            }
        };
        for (i, n) in self.shared.iter().enumerate() {
            prior(i, n, model.get(n.role, 0));
        }
        for r in 0..recordings {
            for (o, n) in self.own.iter().enumerate() {
                prior(ns + r * no + o, n, model.get(n.role, r));
            }
        }
        (self.matrix, self.slope) = (h, g);
    }

    /// As [`Column::dot`] of one of the columns with another one, over the blocks where the first is something.
    fn dot(&self, i: usize, c: &Column, r: usize) -> f64 {
        let own = &self.columns[i];
        let blocks = match (self.lit[i].get(r), own.w.get(r), c.w.get(r)) {
            (Some(lit), Some(a), Some(b)) => {
                let end = lit.end.min(b.len());
                let lit = lit.start.min(end)..end;
                dot(&a[lit.clone()], &b[lit])
            }
            _ => 0.0,
        };
        blocks + own.rows.get(r).zip(c.rows.get(r)).map_or(0.0, |(a, b)| dot(a, b))
    }

    /// Scalar products of a column with all of the tangent's.
    #[must_use]
    pub fn against(&self, c: &Column, recordings: usize) -> Vec<f64> {
        let ns = self.shared.len();
        let all = |i: usize| (0..recordings).map(|r| self.dot(i, c, r)).sum();
        let own = (0..recordings).flat_map(|r| (ns..self.columns.len()).map(move |i| self.dot(i, c, r)));
        (0..ns).map(all).chain(own).collect()
    }

    /// Factor of the normal matrix.
    #[must_use]
    pub fn factor(&self) -> Factor {
        self.matrix.factor()
    }
}

/// The trails of all recordings.
fn trails(model: &Model, data: &Data) -> Vec<Option<Trail>> {
    (0..data.recordings()).into_par_iter().map(|r| Trail::new(model, data, r)).collect()
}

fn weighted(w: &[Vec<f64>], roots: &[Vec<f64>]) -> Vec<Vec<f64>> {
    w.iter().zip(roots).map(|(w, r)| w.iter().zip(r).map(|(w, r)| w * r).collect()).collect()
}

/// Rows of the events as residuals: what they are less what they should be, zero.
fn event_rows(model: &Model, now: &Residuals, at: &Residuals) -> Vec<Vec<f64>> {
    now.events
        .iter()
        .zip(&at.events)
        .map(|(now, at)| now.iter().zip(at).flat_map(|(n, a)| rows_like(n, &model.scatter, a)).collect())
        .collect()
}

/// A spread between insertions is at least this share of the typical one: it is not known to be nothing.
const LEAST_SPREAD: f64 = 0.1;

/// How long a fit goes on.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Steps at most.
    pub turns: usize,
    /// It ends when a step gains less than so many nats.
    pub enough: f64,
}

impl Effort {
    /// A short one, to rank.
    pub const SHORT: Self = Self { turns: 3, enough: 0.3 };
    /// To the end.
    pub const FULL: Self = Self { turns: 14, enough: 0.03 };
}

/// Damping of the first step, and steps that are tried from a tangent.
const FIRST_DAMPING: f64 = 1e-4;
const TRIES: usize = 7;

/// Longest move of an instant in one step, in blocks: beyond, a derivative says nothing.
const INSTANT_BLOCKS: f64 = 1.5;

/// A step is tried further when the lowest place along it seems to be beyond this share of it, up to ...
const NO_FURTHER: f64 = 1.3;
/// ... this one.
const FURTHEST: f64 = 4.0;

/// Fits a model from where it stands.
#[must_use]
pub fn fit(model: &Model, data: &Data, effort: Effort) -> Option<Fit> {
    fit_below(model, data, effort, f64::INFINITY)
}

/// As [`fit`], but given up where it would not come below `wanted` nats if every step left gained as much as the last.
#[must_use]
pub fn fit_below(model: &Model, data: &Data, effort: Effort, wanted: f64) -> Option<Fit> {
    descend(model, data, effort, wanted, rescatter)
}

/// As [`fit`]; where ruptures scatter, also from numbers under which they do not. Under a wide scatter what is a little off
/// costs nothing, and stays.
#[must_use]
pub fn fit_sharp(model: &Model, data: &Data, effort: Effort) -> Option<Fit> {
    let wide = fit(model, data, effort)?;
    let mut none = wide.model.clone();
    (none.scatter.force, none.scatter.place_m) = (0.0, 0.0);
    if none.scatter == wide.model.scatter {
        return Some(wide);
    }
    let held = Effort { turns: 2, ..effort };
    let sharp =
        descend(&none, data, held, f64::INFINITY, |_, _| ()).and_then(|f| fit(&f.model, data, effort));
    Some(sharp.filter(|f| f.nats() < wide.nats()).unwrap_or(wide))
}

/// A tangent that promises less than so many nats where no step gains is as good as level.
const LEVEL: f64 = 1.0;
/// A fit is freed of kinks at most so often.
const FREED: usize = 3;

/// As [`fit`], but not ended by a kink: where the tangent promises a gain and no step along it keeps that, those numbers go on alone whose
/// own steps gain. Laws that cling and slip have kinks: a derivative across one tells of neither side.
#[must_use]
pub fn fit_past_kinks(model: &Model, data: &Data, effort: Effort) -> Option<Fit> {
    let mut best = fit(model, data, effort)?;
    for _ in 0..FREED {
        let Some(freed) = freed(&best, data).and_then(|model| fit(&model, data, effort)) else { break };
        let gain = best.nats() - freed.nats();
        if gain > 0.0 {
            best = freed;
        }
        if gain < effort.enough {
            break;
        }
    }
    Some(best)
}

/// A likelier model near one from which no step along the whole tangent gains what it promises.
fn freed(at: &Fit, data: &Data) -> Option<Model> {
    let tangent = Tangent::new(&at.model, data, &at.residuals);
    let whole = step(&at.model, data, &tangent, FIRST_DAMPING, |_| true)?;
    (0.5 * dot(&tangent.slope, &whole) >= LEVEL).then(|| trusting(at, data, &tangent))?
}

/// A likelier model by a step of those numbers that gain by a step of their own.
fn trusting(at: &Fit, data: &Data, tangent: &Tangent) -> Option<Model> {
    let gains = |delta: &[f64]| {
        let next = moved(&at.model, data, tangent, delta, 1.0);
        residuals(&next, data).filter(|left| left.nats < at.nats()).map(|_| next)
    };
    let (ns, no) = (tangent.shared.len(), tangent.own.len());
    let kind = |i: usize| if i < ns { i } else { ns + (i - ns) % no };
    let alone = |k: usize| step(&at.model, data, tangent, FIRST_DAMPING, |i| kind(i) == k);
    let trusted: Vec<bool> =
        (0..ns + no).into_par_iter().map(|k| alone(k).and_then(|d| gains(&d)).is_some()).collect();
    let mut damping = FIRST_DAMPING;
    for _ in 0..TRIES {
        let delta = step(&at.model, data, tangent, damping, |i| trusted[kind(i)])?;
        if let Some(next) = gains(&delta) {
            return Some(next);
        }
        damping *= 8.0;
    }
    None
}

/// Steps downhill; after each the scatter is told by `scatter`.
fn descend(
    model: &Model,
    data: &Data,
    effort: Effort,
    wanted: f64,
    scatter: impl Fn(&mut Model, &mut Residuals),
) -> Option<Fit> {
    let mut best = model.clone();
    clamp(&mut best);
    let mut at = residuals(&best, data)?;
    scatter(&mut best, &mut at);
    let mut damping = FIRST_DAMPING;
    for turn in 1..=effort.turns {
        let tangent = Tangent::new(&best, data, &at);
        let before = at.nats;
        let mut gained = false;
        for _ in 0..TRIES {
            let Some(delta) = step(&best, data, &tangent, damping, |_| true) else { break };
            let next = moved(&best, data, &tangent, &delta, 1.0);
            let Some(left) = residuals(&next, data) else {
                damping *= 10.0;
                continue;
            };
            if left.nats < at.nats {
                let further = further(&tangent, &delta, at.nats - left.nats)
                    .map(|share| moved(&best, data, &tangent, &delta, share))
                    .and_then(|next| residuals(&next, data).map(|left| (next, left)))
                    .filter(|(_, f)| f.nats < left.nats);
                (best, at) = further.unwrap_or((next, left));
                scatter(&mut best, &mut at);
                damping = (damping * 0.1).max(1e-9);
                gained = true;
                break;
            }
            damping = (damping * 8.0).max(1e-6);
        }
        let gain = before - at.nats;
        let reach = at.nats - gain * (effort.turns - turn) as f64;
        if !gained || gain < effort.enough || (turn > 1 && reach > wanted) {
            break;
        }
    }
    Some(Fit { model: best, residuals: at })
}

/// Scatter between insertions as the events tell it.
fn rescatter(model: &mut Model, at: &mut Residuals) {
    let events: Vec<_> = at.events.iter().flatten().copied().collect();
    model.scatter = scatter_of(&events, &model.scatter);
    let spread = |x: &dyn Fn(usize) -> f64, least: f64| {
        let n = model.own.len().max(1) as f64;
        ((0..model.own.len()).map(|r| x(r).powi(2)).sum::<f64>() / n).sqrt().max(least)
    };
    let (mut surface_m, mut friction) = (model.scatter.surface_m, model.scatter.friction);
    if model.free.own_surface {
        surface_m = spread(&|r| model.own[r].surface_m, 1e-6);
    }
    if model.free.own_friction {
        friction = spread(&|r| model.own[r].friction, 1e-4);
    }
    if model.steady {
        at.nats = nats(model, at);
        return;
    }
    if model.free.own_effects {
        for k in 0..model.differing().count() {
            let least = LEAST_SPREAD * model.differing_said(k);
            model.scatter.differing[k] = spread(&|r| model.own[r].differing[k], least);
        }
    }
    (model.scatter.surface_m, model.scatter.friction) = (surface_m, friction);
    at.nats = nats(model, at);
}

fn clamp(model: &mut Model) {
    for n in model.shared() {
        let x = model.get(n.role, 0);
        if x < n.low || x > n.high {
            model.set(n.role, 0, x.clamp(n.low, n.high));
        }
    }
}

/// How much further than `delta` it goes down along it: the lowest place of the parabola that falls as the tangent says and has gained
/// `gained` so far. Residuals far off weigh more in the tangent than they do when they become smaller or larger (their loss is a
/// straight line), so that its steps are too short by the same factor again and again. `None` where it is hardly further.
fn further(t: &Tangent, delta: &[f64], gained: f64) -> Option<f64> {
    let falls = dot(&t.slope, delta);
    let share = if gained < falls { falls / (2.0 * (falls - gained)) } else { FURTHEST };
    (share > NO_FURTHER).then_some(share.min(FURTHEST))
}

/// One damped step that stays within bounds: a change of every number `among` those wanted, as they stand in the matrix; `None` when nothing
/// can move.
fn step(
    model: &Model,
    data: &Data,
    t: &Tangent,
    damping: f64,
    among: impl Fn(usize) -> bool,
) -> Option<Vec<f64>> {
    let ns = t.shared.len();
    let size = t.matrix.size;
    let mut damped = t.matrix.clone();
    for i in 0..size {
        damped.add(i, i, damping * t.matrix.at(i, i));
    }
    let number = |i: usize| -> (Number, usize) {
        if i < ns { (t.shared[i], 0) } else { (t.own[(i - ns) % t.own.len()], (i - ns) / t.own.len()) }
    };
    let mut free: Vec<usize> = (0..size).filter(|i| among(*i) && t.matrix.at(*i, *i) > 0.0).collect();
    let mut delta = vec![0.0; size];
    // Numbers that run against a bound stay there; the others are solved for again.
    for _ in 0..6 {
        let rhs: Vec<f64> = free
            .iter()
            .map(|&i| {
                let held: f64 = (0..size)
                    .filter(|j| delta[*j] != 0.0 && !free.contains(j))
                    .map(|j| t.matrix.at(i, j) * delta[j])
                    .sum();
                t.slope[i] - held
            })
            .collect();
        let x = damped.part(&free).factor().solve(&rhs);
        let mut kept = Vec::new();
        let mut hit = false;
        for (&i, x) in free.iter().zip(&x) {
            let (n, r) = number(i);
            let now = model.get(n.role, r);
            let (mut low, mut high) = (n.low - now, n.high - now);
            if let Role::Instant(_) = n.role {
                let b = &data.blocks[r];
                let reach = INSTANT_BLOCKS * b.step_s * b.samples as f64;
                (low, high) = (-reach, reach);
            }
            if *x < low || *x > high {
                delta[i] = x.clamp(low, high);
                hit = true;
            } else {
                delta[i] = *x;
                kept.push(i);
            }
        }
        if !hit {
            break;
        }
        kept.iter().for_each(|i| delta[*i] = 0.0);
        free = kept;
        if free.is_empty() {
            break;
        }
    }
    if delta.iter().all(|d| *d == 0.0) || delta.iter().any(|d| !d.is_finite()) {
        return None;
    }
    Some(delta)
}

/// A model some way along a step.
fn moved(model: &Model, data: &Data, t: &Tangent, delta: &[f64], share: f64) -> Model {
    let mut next = model.clone();
    for (n, d) in t.shared.iter().zip(delta) {
        next.set(n.role, 0, (model.get(n.role, 0) + share * d).clamp(n.low, n.high));
    }
    for r in 0..data.recordings() {
        for (o, n) in t.own.iter().enumerate() {
            let x = model.get(n.role, r);
            if x < NEVER {
                let there = x + share * delta[t.place(o, r)];
                let bound = !matches!(n.role, Role::Instant(_));
                next.set(n.role, r, if bound { there.clamp(n.low, n.high) } else { there });
            }
        }
        in_order(&mut next.instants[r], data.blocks[r].span_s());
    }
    next
}

/// Instants stay inside the recording and in their order.
fn in_order(instants: &mut [f64], (first, last): (f64, f64)) {
    let mut before = first;
    for t in instants.iter_mut().filter(|t| **t < NEVER) {
        *t = t.clamp(before, last);
        before = *t;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocks::{BLOCK_S, Blocks};
    use crate::model::{Belief, Own};
    use crate::noise::Noise;
    use std::sync::Arc;
    use stylet_record::Recording;
    use stylet_tissue::{Layer, Tissue};

    fn near(told: f64, wanted: f64) {
        assert!((told - wanted).abs() <= 1e-9 * wanted.abs().max(1e-9), "{told} for {wanted}");
    }

    /// Two layers from 4 mm on, the first of which gives way by its force after 5 mm of 12 mm.
    fn model(recordings: usize) -> Model {
        let layer = |thickness_m: f64, k: f64, puncture_n: Option<f64>| Layer {
            thickness_m,
            stiffness_n_per_m: k,
            friction_ns_per_m2: 3000.0,
            puncture_n,
            name: String::new(),
        };
        let belief = Belief {
            tissue: Tissue {
                surface_m: 0.004,
                layers: vec![layer(0.012, 200.0, Some(1.0)), layer(0.03, 80.0, None)],
            },
            given: Vec::new(),
            tolerance: vec![0.3; 2],
            thickness_tolerance: vec![0.0; 2],
            surface_tolerance_m: 0.002,
        };
        let mut model = Model::base(Arc::new(belief), recordings);
        model.free.own_surface = true;
        model.free.own_friction = true;
        model
    }

    /// What a model gives for a needle that goes in by 4 mm/s and a ripple, with a little of something else.
    fn data(truth: &Model, rough_n: f64) -> Data {
        let recorded = |r: usize| {
            let t: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.005).collect();
            let z = t.iter().map(|t| 0.004 * t + 4e-4 * ((2.0 + r as f64) * t).sin()).collect();
            let mut b =
                Blocks::new(&Recording::new(t, z, vec![0.0; 1000]).expect("a recording"), &[], BLOCK_S);
            let silent = Data::new(Arc::new(vec![b.clone(); truth.own.len()]), Noise::white(0.01), 0.0);
            let mut f = replay(truth, &silent, r).expect("a replay").f;
            f.iter_mut()
                .enumerate()
                .for_each(|(k, f)| *f += rough_n * (1.7 * (k * k % (89 + 12 * r)) as f64).sin());
            b.f = f;
            b
        };
        let blocks = (0..truth.own.len()).map(recorded).collect();
        Data::new(Arc::new(blocks), Noise::white(0.01), 0.0)
    }

    fn column(w: &[&[f64]], rows: &[&[f64]]) -> Column {
        let of = |x: &[&[f64]]| x.iter().map(|x| x.to_vec()).collect();
        Column { w: of(w), rows: of(rows) }
    }

    #[test]
    fn columns_are_multiplied_recording_by_recording() {
        let a = column(&[&[1.0, 2.0], &[3.0]], &[&[0.5], &[4.0, 1.0]]);
        let b = column(&[&[2.0, -1.0], &[5.0]], &[&[4.0], &[1.0, 2.0]]);
        assert_eq!((a.dot(&b, 0), a.dot(&b, 1), a.dot(&b, 2), a.dot_all(&b)), (2.0, 21.0, 0.0, 23.0));
    }

    #[test]
    fn what_is_left_is_measured_at_the_blocks_that_are_compared() {
        let (m, d) = (model(1), data(&model(1), 0.0));
        let mut blocks = (*d.blocks).clone();
        blocks[0].used = (0..blocks[0].len()).map(|k| k < 2).collect();
        let e = vec![(0..blocks[0].len()).map(|k| [3.0, 5.0, 100.0][k.min(2)]).collect()];
        let fit = Fit { model: m, residuals: Residuals { e, nats: 7.5, ..Residuals::default() } };
        near(fit.rms_n(&d.on(blocks)), 17.0_f64.sqrt());
        assert_eq!((fit.nats(), fit.rms_n(&d.on(Vec::new()))), (7.5, 0.0));
    }

    #[test]
    fn instants_are_put_in_order_inside_the_recording() {
        let of = |mut instants: Vec<f64>| {
            in_order(&mut instants, (1.0, 9.0));
            instants
        };
        assert_eq!(of(vec![0.5, 4.0, 3.0, 12.0]), [1.0, 4.0, 4.0, 9.0]);
        assert_eq!(of(vec![2.0, NEVER, NEVER]), [2.0, NEVER, NEVER]);
    }

    #[test]
    fn numbers_are_brought_within_what_is_believed() {
        let mut m = model(1);
        m.tissue.layers[0].stiffness_n_per_m = 500.0;
        m.tissue.layers[1].stiffness_n_per_m = 10.0;
        m.tissue.surface_m = 0.0045;
        clamp(&mut m);
        near(m.tissue.layers[0].stiffness_n_per_m, 260.0);
        near(m.tissue.layers[1].stiffness_n_per_m, 56.0);
        near(m.tissue.surface_m, 0.0045);
    }

    /// No layer gave way: all is smooth.
    fn smooth() -> (Model, Data) {
        let mut m = model(2);
        m.instants = vec![vec![NEVER; 2]; 2];
        m.scatter.force = 0.1;
        m.scatter.place_m = 2e-3;
        let d = data(&m, 0.02);
        // A law that is off, each recording by something of its own.
        m.tissue.layers[0].stiffness_n_per_m = 196.0;
        m.own = [2e-4, -1e-4]
            .map(|surface_m| Own { surface_m, friction: 10.0 * surface_m, ..Own::default() })
            .to_vec();
        (m, d)
    }

    #[test]
    fn downhill_is_where_the_nats_fall() {
        let (m, d) = smooth();
        let at = residuals(&m, &d).expect("a replay");
        // Some residuals are beyond what counts as a square, some are not.
        let rough = at.w.iter().flatten().filter(|w| w.abs() > 2.5).count();
        assert!(rough > 5 && rough < 400, "{rough}");
        let t = Tangent::new(&m, &d, &at);
        let nats = |role: Role, r: usize, by: f64| {
            let mut moved = m.clone();
            moved.set(role, r, m.get(role, r) + by);
            residuals(&moved, &d).expect("a replay").nats
        };
        let falls =
            |n: &Number, r: usize| (nats(n.role, r, -n.step) - nats(n.role, r, n.step)) / (2.0 * n.step);
        let is = |told: f64, n: &Number, r: usize| {
            let wanted = falls(n, r);
            assert!((told - wanted).abs() < 0.01 * wanted.abs() + 1e-3, "{told} for {wanted}, {:?}", n.role);
        };
        assert!(t.shared.len() >= 5);
        for (k, n) in t.shared.iter().enumerate() {
            is(t.slope[k], n, 0);
        }
        for r in 0..2 {
            for (o, n) in t.own.iter().enumerate().filter(|(_, n)| !matches!(n.role, Role::Instant(_))) {
                assert_eq!(t.place(o, r), t.shared.len() + r * t.own.len() + o);
                is(t.slope[t.place(o, r)], n, r);
            }
        }
    }

    #[test]
    fn the_normal_matrix_is_that_of_all_columns_and_priors() {
        let (m, d) = smooth();
        let at = residuals(&m, &d).expect("a replay");
        let t = Tangent::new(&m, &d, &at);
        let (ns, no) = (t.shared.len(), t.own.len());
        // The number at a place of the matrix, and the recording whose own it is.
        let number = |i: usize| if i < ns { (i, None) } else { (ns + (i - ns) % no, Some((i - ns) / no)) };
        for i in 0..ns + 2 * no {
            for j in 0..=i {
                let ((a, ra), (b, rb)) = (number(i), number(j));
                let products = |r: usize| t.columns[a].dot(&t.columns[b], r);
                let mut wanted: f64 = (0..2)
                    .filter(|r| ra.is_none_or(|a| a == *r) && rb.is_none_or(|b| b == *r))
                    .map(products)
                    .sum();
                let sd = if a < ns { t.shared[a].sd } else { t.own[a - ns].sd };
                if i == j && sd.is_finite() {
                    wanted += 1.0 / (sd * sd);
                }
                let told = t.matrix.at(i, j);
                assert!((told - wanted).abs() <= 1e-9 * wanted.abs(), "{told} for {wanted} at {i} {j}");
            }
        }
        let against = t.against(&t.columns[0], 2);
        near(against[1], t.columns[0].dot_all(&t.columns[1]));
        near(against[ns + no], t.columns[ns].dot(&t.columns[0], 1));
        assert_eq!(against.len(), ns + 2 * no);
    }

    #[test]
    fn a_derivative_costs_half_a_replay() {
        let (m, d) = smooth();
        let at = residuals(&m, &d).expect("a replay");
        let before = d.work();
        let t = Tangent::new(&m, &d, &at);
        let blocks = d.blocks[0].len() as u64;
        assert_eq!(d.work() - before, 2 * blocks + (t.shared.len() + t.own.len()) as u64 * 2 * (blocks / 2));
    }

    #[test]
    fn a_wide_step_is_half_of_what_it_changes_both_ways() {
        let (m, d) = smooth();
        let at = residuals(&m, &d).expect("a replay");
        let surface = |n: &Number| (n.role == Role::Surface).then_some(1e-3);
        let plain = Tangent::new(&m, &d, &at);
        let wide = Tangent::new(&m, &d, &at).widened(&m, &d, &at, &surface);
        let moved = |by: f64| {
            let mut other = m.clone();
            other.set(Role::Surface, 0, m.get(Role::Surface, 0) + by);
            plain.difference(&m, &d, &at, &other).expect("a column")
        };
        let (up, down) = (moved(1e-3), moved(-1e-3));
        for (k, n) in wide.shared.iter().enumerate() {
            if n.role != Role::Surface {
                assert_eq!(wide.columns[k].w, plain.columns[k].w);
                continue;
            }
            for r in 0..2 {
                for i in 0..up.w[r].len() {
                    let wanted = (up.w[r][i] - down.w[r][i]) / 2e-3;
                    assert!((wide.columns[k].w[r][i] - wanted).abs() < 1e-6 * wanted.abs().max(1.0));
                }
            }
            near(wide.matrix.at(k, k), wide.columns[k].dot_all(&wide.columns[k]) + 1.0 / (n.sd * n.sd));
            assert_ne!(wide.matrix.at(k, k), plain.matrix.at(k, k));
        }
    }

    #[test]
    fn a_fit_finds_the_law_that_gave_the_force() {
        let mut truth = model(2);
        truth.tissue.layers[0].stiffness_n_per_m = 215.0;
        truth.tissue.layers[1].friction_ns_per_m2 = 2700.0;
        truth.tissue.surface_m = 0.0043;
        truth.own = [4e-4, -4e-4].map(|surface_m| Own { surface_m, ..Own::default() }).to_vec();
        // Where the law itself has them.
        truth.instants = vec![vec![NEVER; 2]; 2];
        let own = |r: usize| Trail::new(&truth, &data(&truth, 0.0), r).expect("a trail").own_instants();
        truth.instants = vec![own(0), own(1)];
        let d = data(&truth, 0.002);
        let mut m = model(2);
        m.instants = [(0, -0.021), (1, 0.027)].map(|(r, by)| vec![truth.instants[r][0] + by, NEVER]).to_vec();
        let found = fit(&m, &d, Effort::FULL).expect("a fit");
        let is = |told: f64, wanted: f64, within: f64| {
            assert!((told - wanted).abs() < within, "{told} for {wanted}")
        };
        let tissue = &found.model.tissue;
        is(tissue.layers[0].stiffness_n_per_m, 215.0, 2.0);
        is(tissue.layers[1].friction_ns_per_m2, 2700.0, 200.0);
        for (r, own) in found.model.own.iter().enumerate() {
            is(tissue.surface_m + own.surface_m, 0.0043 + truth.own[r].surface_m, 3e-5);
            is(found.model.instants[r][0], truth.instants[r][0], 1e-3);
            assert_eq!(found.model.instants[r][1], NEVER);
        }
        assert!(found.rms_n(&d) < 0.003, "{}", found.rms_n(&d));
        // Given up where it gains too little for what is wanted; never worse than where it began.
        let least = fit_below(&m, &d, Effort::FULL, -1e9).expect("a fit").nats();
        assert!(least >= found.nats() && least < residuals(&m, &d).expect("a replay").nats);
        // Beyond what is believed a number stays at the bound.
        let mut far = truth.clone();
        far.tissue.layers[0].stiffness_n_per_m = 300.0;
        let bound = fit(&m, &data(&far, 0.002), Effort::FULL).expect("a fit");
        near(bound.model.tissue.layers[0].stiffness_n_per_m, 260.0);
    }

    /// A number whose neighbour cannot be replayed.
    #[test]
    fn a_column_that_is_not_there_is_nothing() {
        let (m, d) = smooth();
        let at = residuals(&m, &d).expect("a replay");
        let mut t = Tangent::new(&m, &d, &at);
        let first = t.columns[1].clone();
        t.columns[0] = Column::default();
        t.assemble(&m, 2);
        near(t.matrix.at(0, 0), 1.0 / (t.shared[0].sd * t.shared[0].sd));
        assert_eq!((t.matrix.at(1, 0), t.against(&first, 2)[0]), (0.0, 0.0));
        near(t.against(&first, 2)[1], first.dot_all(&first));
        assert!(t.against(&Column::default(), 2).iter().all(|x| *x == 0.0));
    }

    #[test]
    fn a_step_goes_on_to_where_the_parabola_of_its_gain_is_lowest() {
        let (m, d) = smooth();
        let at = residuals(&m, &d).expect("a replay");
        let t = Tangent { slope: vec![2.0, 4.0], ..Tangent::new(&m, &d, &at) };
        // It falls by ten; a step that stands at the lowest place has gained half of that.
        let share = |gained: f64| further(&t, &[1.0, 2.0], gained);
        assert_eq!(share(5.0), None);
        assert_eq!(share(6.1), None);
        near(share(7.5).expect("further"), 2.0);
        near(share(8.5).expect("further"), 10.0 / 3.0);
        assert_eq!([share(9.0), share(10.0), share(12.0)], [Some(4.0); 3]);
    }

    /// A law that lacks something leaves blocks far off by the thousand. Each counts by a straight line, and the tangent takes
    /// it for a square.
    #[test]
    fn a_fit_among_blocks_far_off_is_at_its_end_after_a_few_steps() {
        let (mut m, _) = smooth();
        m.own = vec![Own::default(); 2];
        let d = data(&m, 0.15);
        m.tissue.layers[0].stiffness_n_per_m = 170.0;
        m.tissue.layers[0].friction_ns_per_m2 = 3600.0;
        let to = |turns: usize| fit(&m, &d, Effort { turns, enough: 1e-6 }).expect("a fit").nats();
        let (end, few) = (to(100), to(4));
        assert!(few - end < 1.0 && to(1) - end > 100.0, "{few} {end} {}", to(1));
    }

    /// A tangent that was taken across a kink tells the wrong way of one number; the others go on.
    #[test]
    fn numbers_whose_own_steps_gain_go_on_without_one_whose_tangent_lies() {
        let (mut m, d) = smooth();
        m.tissue.layers[0].stiffness_n_per_m = 190.0;
        m.tissue.layers[0].friction_ns_per_m2 = 3300.0;
        let at = Fit { residuals: residuals(&m, &d).expect("a replay"), model: m.clone() };
        let mut t = Tangent::new(&m, &d, &at.residuals);
        let stiff = t.shared.iter().position(|n| n.role == Role::Stiffness(0)).expect("free");
        t.slope[stiff] *= -1e3;
        let along = step(&m, &d, &t, FIRST_DAMPING, |_| true).expect("a step");
        let left = residuals(&moved(&m, &d, &t, &along, 1.0), &d).expect("a replay");
        assert!(left.nats > at.nats());
        let next = trusting(&at, &d, &t).expect("the others gain");
        assert_eq!(next.tissue.layers[0].stiffness_n_per_m, 190.0);
        assert!(next.tissue.layers[0].friction_ns_per_m2 != 3300.0);
        assert!(residuals(&next, &d).expect("a replay").nats < at.nats() - 1.0);
        // Where it is level nothing is freed, and the fit is the plain one.
        let plain = fit(&m, &d, Effort::FULL).expect("a fit");
        assert!(freed(&plain, &d).is_none());
        let past = fit_past_kinks(&m, &d, Effort::FULL).expect("a fit");
        assert_eq!(past.nats(), plain.nats());
    }

    #[test]
    fn an_instant_moves_by_a_block_and_a_half_at_most() {
        let mut truth = model(1);
        truth.instants = vec![vec![2.513, NEVER]];
        let d = data(&truth, 0.0);
        let mut m = truth.clone();
        m.instants = vec![vec![2.39, NEVER]];
        m.tissue.layers[0].stiffness_n_per_m = 180.0;
        let at = residuals(&m, &d).expect("a replay");
        let t = Tangent::new(&m, &d, &at);
        let next = moved(&m, &d, &t, &step(&m, &d, &t, 1e-4, |_| true).expect("a step"), 1.0);
        let by = next.instants[0][0] - 2.39;
        assert!(by.abs() <= 0.03 + 1e-12, "{by}");
        // Nothing moves where nothing says so.
        assert!(
            step(
                &m,
                &d,
                &Tangent { slope: vec![0.0; t.slope.len()], ..Tangent::new(&m, &d, &at) },
                1e-4,
                |_| true
            )
            .is_none()
        );
    }

    #[test]
    fn spreads_are_those_of_the_recordings_own_numbers() {
        let (mut m, d) = smooth();
        m.own = [(3e-4, 0.03), (-4e-4, 0.04)]
            .map(|(surface_m, friction)| Own { surface_m, friction, ..Own::default() })
            .to_vec();
        let mut at = residuals(&m, &d).expect("a replay");
        let mut told = m.clone();
        rescatter(&mut told, &mut at);
        near(told.scatter.surface_m, (0.5_f64 * 25e-8).sqrt());
        near(told.scatter.friction, (0.5_f64 * 25e-4).sqrt());
        near(at.nats, nats(&told, &at));
        // Never nothing; as they are where somebody else tells them, or where nobody asks.
        let mut alike = m.clone();
        alike.own = vec![Own::default(); 2];
        rescatter(&mut alike, &mut at);
        assert_eq!((alike.scatter.surface_m, alike.scatter.friction), (1e-6, 1e-4));
        let mut steady = Model { steady: true, ..m.clone() };
        rescatter(&mut steady, &mut at);
        near(at.nats, nats(&steady, &at));
        assert_eq!(
            (steady.scatter.surface_m, steady.scatter.friction),
            (m.scatter.surface_m, m.scatter.friction)
        );
        m.free.own_surface = false;
        m.free.own_friction = false;
        let mut bound = m.clone();
        rescatter(&mut bound, &mut at);
        assert_eq!(
            (bound.scatter.surface_m, bound.scatter.friction),
            (m.scatter.surface_m, m.scatter.friction)
        );
    }
}
