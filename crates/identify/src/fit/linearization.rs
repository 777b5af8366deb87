//! Jacobian of all residuals of a model, and the normal equations with priors.

use super::jacobian_column::{JacobianColumn, support};
use crate::forward_model::ReplayResult;
use crate::likelihood::{FitData, ReplayCache, Residuals, replay};
use crate::model::{Model, NO_RUPTURE, Parameter, ParameterRole};
use crate::noise::huber_weight;
use crate::rupture_likelihood::{RuptureEvent, rupture_rows_at};
use core::ops::Range;
use stylet_stats::linear_algebra::{CholeskyFactor, SymmetricMatrix, dot};
use stylet_stats::parallel::*;

/// Linearization of a model at its current parameters.
pub struct Linearization {
    /// Parameters shared by all recordings.
    pub shared: Vec<Parameter>,
    /// Per-recording parameters.
    pub per_recording: Vec<Parameter>,
    /// Jacobian columns, `shared` first.
    pub columns: Vec<JacobianColumn>,
    /// Weighted residuals as a column.
    pub residual: JacobianColumn,
    /// Normal matrix with priors: `shared`, then the per-recording parameters, recording by recording.
    pub normal_matrix: SymmetricMatrix,
    /// Negative gradient of the objective in nats.
    pub neg_gradient: Vec<f64>,
    pub(super) sqrt_weights: Vec<Vec<f64>>,
    /// Range of blocks with non-zero entries, per column and recording.
    pub(super) supports: Vec<Vec<Range<usize>>>,
}

impl Linearization {
    /// Index of a per-recording parameter in the normal matrix.
    #[must_use]
    pub fn index_of(&self, per_recording: usize, r: usize) -> usize {
        self.shared.len() + r * self.per_recording.len() + per_recording
    }

    /// Linearization of `model` with residuals `at`.
    #[must_use]
    pub fn new(model: &Model, data: &FitData, at: &Residuals) -> Self {
        let (shared, per_recording) = (model.shared_parameters(), model.recording_parameters());
        let roots: Vec<Vec<f64>> =
            at.innovations.iter().map(|w| w.iter().map(|w| huber_weight(*w).sqrt()).collect()).collect();
        let mut t = Self {
            residual: JacobianColumn {
                innovations: weighted(&at.innovations, &roots),
                rupture_rows: rupture_rows(model, at),
            },
            shared,
            per_recording,
            columns: Vec::new(),
            normal_matrix: SymmetricMatrix::zeros(0),
            neg_gradient: Vec::new(),
            sqrt_weights: roots,
            supports: Vec::new(),
        };
        let parameters: Vec<Parameter> = t.shared.iter().chain(&t.per_recording).copied().collect();
        let caches = replay_caches(model, data);
        t.columns = parameters.par_iter().map(|n| t.derivative(model, data, at, n, &caches)).collect();
        t.assemble(model, data.recording_count());
        t
    }

    /// Replaces derivatives by symmetric differences over the widths `step` (in units of the parameter). The first-order effect of moving
    /// an interface is a shifted force jump; over its actual uncertainty it is a ramp, which correlated noise can hide.
    #[must_use]
    pub fn with_wide_differences(
        mut self,
        model: &Model,
        data: &FitData,
        at: &Residuals,
        step: &(dyn Fn(&Parameter) -> Option<f64> + Sync),
    ) -> Self {
        let caches = replay_caches(model, data);
        let of =
            |n: &Parameter, step: f64| self.derivative(model, data, at, &Parameter { step, ..*n }, &caches);
        let wide = |n: &Parameter| {
            let step = step(n)?;
            let (mut up, down) = (of(n, step), of(n, -step));
            for (up, down) in up
                .innovations
                .iter_mut()
                .zip(down.innovations)
                .chain(up.rupture_rows.iter_mut().zip(down.rupture_rows))
            {
                up.iter_mut().zip(down).for_each(|(a, b)| *a = 0.5 * (*a + b));
            }
            Some(up)
        };
        let parameters: Vec<Parameter> = self.shared.iter().chain(&self.per_recording).copied().collect();
        let columns: Vec<Option<JacobianColumn>> = parameters.par_iter().map(wide).collect();
        for (column, wide) in self.columns.iter_mut().zip(columns) {
            if let Some(wide) = wide {
                *column = wide;
            }
        }
        self.assemble(model, data.recording_count());
        self
    }

    /// Jacobian column of a parameter by a forward difference.
    fn derivative(
        &self,
        model: &Model,
        data: &FitData,
        at: &Residuals,
        n: &Parameter,
        caches: &[Option<ReplayCache>],
    ) -> JacobianColumn {
        let mut moved = model.clone();
        let mut steps = Vec::new();
        for r in 0..if n.role.is_per_recording() { data.recording_count() } else { 1 } {
            let x = model.get(n.role, r);
            let h = if x + n.step > n.high { -n.step } else { n.step };
            steps.push(h);
            if x < NO_RUPTURE {
                moved.set(n.role, r, x + h);
            }
        }
        let h = |r: usize| steps.get(r).copied().unwrap_or(steps[0]);
        // Effects may act from the first sample on, so no part of the replay can be reused.
        let whole = match n.role {
            ParameterRole::Effect { .. } | ParameterRole::RecordingEffect(_) => true,
            ParameterRole::RecordingFriction | ParameterRole::DayFriction(_) => model.has_friction_effects(),
            _ => false,
        };
        let replayed = |r: usize| match caches.get(r).and_then(Option::as_ref).filter(|_| !whole) {
            Some(cache) => cache.replay(&moved, data, r),
            None => replay(&moved, data, r),
        };
        let mut column = self.column_of_change(model, data, at, replayed).unwrap_or_default();
        for (r, (w, rows)) in column.innovations.iter_mut().zip(&mut column.rupture_rows).enumerate() {
            let scale = 1.0 / h(r);
            w.iter_mut().chain(rows).for_each(|x| *x *= scale);
        }
        column
    }

    /// Difference between the predictions of `other` and `model` as a column: whitened and weighted force, and rupture residuals.
    #[must_use]
    pub fn difference(
        &self,
        model: &Model,
        data: &FitData,
        at: &Residuals,
        other: &Model,
    ) -> Option<JacobianColumn> {
        self.column_of_change(model, data, at, |r| replay(other, data, r))
    }

    /// The same, from a function that replays the other model for a recording.
    fn column_of_change(
        &self,
        model: &Model,
        data: &FitData,
        at: &Residuals,
        other: impl Fn(usize) -> Option<ReplayResult>,
    ) -> Option<JacobianColumn> {
        let mut column = JacobianColumn::default();
        for (r, b) in data.recordings.iter().enumerate() {
            let replayed = other(r)?;
            // The residual is measured minus predicted: predicted = y - e.
            let change: Vec<f64> = replayed
                .force_n
                .iter()
                .zip(&at.residual_n[r])
                .zip(&b.force_n)
                .map(|((f, e), y)| f - (y - e))
                .collect();
            let mut w = data.whiten(r, &change);
            w.iter_mut().zip(&self.sqrt_weights[r]).for_each(|(w, root)| *w *= root);
            column.innovations.push(w);
            let rows = replayed.ruptures.iter().zip(&at.ruptures[r]).flat_map(|(now, was)| {
                let (now, was) =
                    (rupture_rows_at(now, &model.scatter, was), rupture_rows_at(was, &model.scatter, was));
                (0..4).map(move |k| was[k] - now[k])
            });
            column.rupture_rows.push(rows.collect());
        }
        Some(column)
    }

    pub(super) fn assemble(&mut self, model: &Model, recordings: usize) {
        let (ns, no) = (self.shared.len(), self.per_recording.len());
        let size = ns + recordings * no;
        let mut h = SymmetricMatrix::zeros(size);
        let mut g = vec![0.0; size];
        self.supports = self.columns.iter().map(support).collect();
        let t = &*self;
        let all = |i: usize, c: &JacobianColumn| (0..recordings).map(|r| t.recording_product(i, c, r)).sum();
        let row = |i: usize| t.columns[..=i].iter().chain([&t.residual]).map(|c| all(i, c)).collect();
        let rows: Vec<Vec<f64>> = (0..ns).into_par_iter().map(row).collect();
        for (i, row) in rows.iter().enumerate() {
            g[i] = row[i + 1];
            row[..=i].iter().enumerate().for_each(|(j, x)| h.add(i, j, *x));
        }
        // Products of each per-recording parameter with the shared ones, with the per-recording ones up to itself, and with the residual.
        let row = |k: usize| {
            let (r, i) = (k / no, ns + k % no);
            t.columns[..=i].iter().chain([&t.residual]).map(|c| t.recording_product(i, c, r)).collect()
        };
        let rows: Vec<Vec<f64>> = (0..recordings * no).into_par_iter().map(row).collect();
        for (k, row) in rows.iter().enumerate() {
            let (r, o) = (k / no, k % no);
            let i = ns + k;
            g[i] = row[ns + o + 1];
            row[..ns].iter().enumerate().for_each(|(j, x)| h.add(i, j, *x));
            row[ns..=ns + o].iter().enumerate().for_each(|(p, x)| h.add(i, ns + r * no + p, *x));
        }
        let mut prior = |i: usize, n: &Parameter, x: f64| {
            if n.prior_sd.is_finite() {
                let information = 1.0 / (n.prior_sd * n.prior_sd);
                h.add(i, i, information);
                g[i] -= (x - n.prior_mean) * information;
            }
        };
        for (i, n) in self.shared.iter().enumerate() {
            prior(i, n, model.get(n.role, 0));
        }
        for r in 0..recordings {
            for (o, n) in self.per_recording.iter().enumerate() {
                prior(ns + r * no + o, n, model.get(n.role, r));
            }
        }
        (self.normal_matrix, self.neg_gradient) = (h, g);
    }

    /// [`JacobianColumn::dot`] of column `i` with `c`, restricted to the support of column `i`.
    fn recording_product(&self, i: usize, c: &JacobianColumn, r: usize) -> f64 {
        let per_recording = &self.columns[i];
        let blocks = match (self.supports[i].get(r), per_recording.innovations.get(r), c.innovations.get(r)) {
            (Some(support), Some(a), Some(b)) => {
                let end = support.end.min(b.len());
                let support = support.start.min(end)..end;
                dot(&a[support.clone()], &b[support])
            }
            _ => 0.0,
        };
        blocks + per_recording.rupture_rows.get(r).zip(c.rupture_rows.get(r)).map_or(0.0, |(a, b)| dot(a, b))
    }

    /// Scalar products of `c` with all Jacobian columns, in the order of the normal matrix.
    pub(crate) fn products_with(&self, c: &JacobianColumn, recordings: usize) -> Vec<f64> {
        let ns = self.shared.len();
        let all = |i: usize| (0..recordings).map(|r| self.recording_product(i, c, r)).sum();
        let per_recording = (0..recordings)
            .flat_map(|r| (ns..self.columns.len()).map(move |i| self.recording_product(i, c, r)));
        (0..ns).map(all).chain(per_recording).collect()
    }

    /// Cholesky factor of the normal matrix.
    #[must_use]
    pub fn factor(&self) -> CholeskyFactor {
        self.normal_matrix.cholesky()
    }
}

/// Replay caches of all recordings.
fn replay_caches(model: &Model, data: &FitData) -> Vec<Option<ReplayCache>> {
    (0..data.recording_count()).into_par_iter().map(|r| ReplayCache::new(model, data, r)).collect()
}

fn weighted(w: &[Vec<f64>], roots: &[Vec<f64>]) -> Vec<Vec<f64>> {
    w.iter().zip(roots).map(|(w, r)| w.iter().zip(r).map(|(w, r)| w * r).collect()).collect()
}

/// Rupture residuals of every recording.
fn rupture_rows(model: &Model, at: &Residuals) -> Vec<Vec<f64>> {
    let rows = |e: &RuptureEvent| rupture_rows_at(e, &model.scatter, e);
    at.ruptures.iter().map(|events| events.iter().flat_map(rows).collect()).collect()
}
