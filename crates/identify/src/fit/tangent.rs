//! The linear picture of a model: how the residuals change with every number.

use super::column::{Column, lit};
use crate::events::rows_like;
use crate::forward::Replayed;
use crate::model::{Model, NEVER, Number, Role};
use crate::noise::LOSS;
use crate::objective::{Data, Residuals, Trail, replay};
use core::ops::Range;
use rayon::prelude::*;
use stylet_stats::linear::{Factor, Symmetric, dot};

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
    pub(super) roots: Vec<Vec<f64>>,
    /// Where each column is something.
    pub(super) lit: Vec<Vec<Range<usize>>>,
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

    pub(super) fn assemble(&mut self, model: &Model, recordings: usize) {
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
