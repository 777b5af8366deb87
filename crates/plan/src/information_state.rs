//! Information before the next insertion, and the information that a motion would add.
//!
//! All candidates share a base model: the law with the effects already established. What a candidate adds to
//! the force, and the derivatives by its parameters, are columns over the available recordings and over a
//! possible motion, whitened by the noise and extended by the rupture residuals, whose variance is the scatter
//! between insertions. The likelihood is that of `stylet_identify`.

use crate::candidate::Candidate;
use crate::gram_matrix::{add, gram_matrix, schur_complement};
use std::sync::Arc;
use stylet_identify::block_averages::{BLOCK_S, BlockAverages};
use stylet_identify::fit::{JacobianColumn, Linearization};
use stylet_identify::forward_model::{ReplayResult, free_rupture_times, replay_with_ruptures};
use stylet_identify::likelihood::{FitData, motion_pieces, replay, residuals};
use stylet_identify::model::{Model, NO_RUPTURE, ParameterRole, RecordingParameters};
use stylet_identify::noise::Noise;
use stylet_record::Recording;
use stylet_scenario::Motion;
use stylet_stats::linear_algebra::SymmetricMatrix;
use stylet_stats::parallel::*;

/// Motions are compared over blocks of this length in s ...
const COARSE_S: f64 = 0.06;
/// ... or longer ones, so that a motion has at most this many blocks.
const MAX_BLOCKS: f64 = 800.0;
/// Sampling rate in Hz that suffices for a planned motion, which is known exactly.
const MAX_SAMPLE_HZ: f64 = 50.0;
/// Lower bound of one minus the sum of autoregressive coefficients, which is uncertain near zero.
const MIN_ONE_MINUS_AR_SUM: f64 = 0.1;
/// Relative scatter of rupture forces assumed for fewer than three recordings.
const DEFAULT_FORCE_SCATTER: f64 = 0.01;
/// The same for the depth of an interface in m.
const DEFAULT_DEPTH_SCATTER_M: f64 = 5e-5;
/// Number of recordings from which the scatter is estimated.
const MIN_RECORDINGS_FOR_SCATTER: usize = 3;
/// Wavelength in m of the depth-dependent force that represents an effect outside the library.
const UNMODELLED_WAVELENGTH_M: f64 = 0.008;

/// Available information and the candidates.
pub struct InformationState {
    /// The model that all candidates share.
    pub base: Model,
    /// Candidates, the most probable first.
    pub candidates: Vec<Candidate>,
    /// Standard deviation in N of an effect outside the library, if that is a candidate.
    pub unmodelled_n: Option<f64>,
    /// Noise of blocks of [`BLOCK_S`].
    pub noise: Noise,
    /// Sampling rate of the planned insertion in Hz.
    pub sample_hz: f64,
    /// The candidates' models, re-fitted to the available recordings.
    models: Vec<Model>,
    /// Information matrix of the available recordings, priors included.
    prior_information: SymmetricMatrix,
    /// Number of shared parameters.
    shared_count: usize,
    /// Whether the scatter between insertions is assumed because there are too few recordings.
    pub scatter_assumed: bool,
}

/// Information with a motion included.
#[derive(Clone, Debug)]
pub struct Information {
    /// Information matrix over all columns.
    all: SymmetricMatrix,
    /// With the shared parameters eliminated.
    schur: SymmetricMatrix,
    shared_count: usize,
}

impl InformationState {
    /// From the available recordings and the model's rupture times in them. Their forces are not used: the base
    /// model has been fitted to them.
    #[must_use]
    pub fn new(
        base: Model,
        candidates: Vec<Candidate>,
        unknown_n: Option<f64>,
        recordings: &[BlockAverages],
        noise: Noise,
        sample_hz: f64,
    ) -> Option<Self> {
        let mut base = base;
        let scatter_assumed = recordings.len() < MIN_RECORDINGS_FOR_SCATTER
            && base.scatter.rupture_force <= DEFAULT_FORCE_SCATTER;
        if recordings.len() < MIN_RECORDINGS_FOR_SCATTER {
            base.scatter.rupture_force = base.scatter.rupture_force.max(DEFAULT_FORCE_SCATTER);
            base.scatter.rupture_depth_m = base.scatter.rupture_depth_m.max(DEFAULT_DEPTH_SCATTER_M);
        }
        let parameters = base.shared_parameters();
        let mut state = Self {
            shared_count: parameters.len(),
            base,
            candidates,
            unmodelled_n: unknown_n,
            noise,
            sample_hz,
            models: Vec::new(),
            scatter_assumed,
            prior_information: SymmetricMatrix::zeros(0),
        };
        let mut before = SymmetricMatrix::zeros(state.shared_count + state.extra_columns());
        for (i, n) in
            parameters.iter().enumerate().filter(|(_, n)| n.prior_sd.is_finite() && n.prior_sd > 0.0)
        {
            before.add(i, i, 1.0 / (n.prior_sd * n.prior_sd));
        }
        if !recordings.is_empty() {
            let data = FitData::new(Arc::new(recordings.to_vec()), state.noise.clone(), 0.0);
            before = add(&before, &state.information_of(&state.base, data)?);
        }
        state.prior_information = before;
        state.models = (0..state.candidates.len()).map(|k| state.refitted_model(k)).collect();
        Some(state)
    }

    /// A candidate's model with the base parameters re-fitted to first order: they had absorbed the candidate's
    /// contribution when the base model was fitted.
    fn refitted_model(&self, which: usize) -> Model {
        let mut model = self.candidates[which].build_model(&self.base);
        let Some((at, _)) = self.columns_of(which) else { return model };
        let rows: Vec<usize> = (0..self.shared_count).collect();
        let with: Vec<f64> =
            rows.iter().map(|k| -self.prior_information.at(*k, self.shared_count + at)).collect();
        let moves = self.prior_information.submatrix(&rows).cholesky().solve(&with);
        for (n, by) in self.base.shared_parameters().iter().zip(moves).filter(|(_, by)| by.is_finite()) {
            let x = self.base.get(n.role, 0) + by;
            model.set(n.role, 0, x.clamp(n.low, n.high));
        }
        model
    }

    /// Model of a candidate, re-fitted; the base model for an effect outside the library.
    #[must_use]
    pub fn candidate_model(&self, which: usize) -> &Model {
        self.models.get(which).unwrap_or(&self.base)
    }

    /// Number of columns in addition to those of the shared parameters.
    fn extra_columns(&self) -> usize {
        let columns = |c: &Candidate| if c.effects.is_empty() { 0 } else { 1 + effect_parameter_count(c) };
        self.candidates.iter().map(columns).sum::<usize>() + usize::from(self.unmodelled_n.is_some())
    }

    /// Column index of a candidate and of its parameters; `None` for the base model.
    fn columns_of(&self, which: usize) -> Option<(usize, std::ops::Range<usize>)> {
        let mut at = 0;
        for (k, c) in self.candidates.iter().enumerate() {
            if c.effects.is_empty() {
                if k == which {
                    return None;
                }
                continue;
            }
            let n = effect_parameter_count(c);
            if k == which {
                return Some((at, at + 1..at + 1 + n));
            }
            at += 1 + n;
        }
        None
    }

    /// Information matrix of recordings simulated with the base model.
    fn information_of(&self, base: &Model, mut data: FitData) -> Option<SymmetricMatrix> {
        let mut blocks = (*data.recordings).clone();
        for (r, b) in blocks.iter_mut().enumerate() {
            b.force_n = replay(base, &data, r)?.force_n;
        }
        data = FitData::new(Arc::new(blocks), (*data.noise).clone(), 0.0);
        let at = residuals(base, &data)?;
        let linearization = Linearization::new(base, &data, &at);
        let change = |model: &Model| linearization.difference(base, &data, &at, model);
        let first = base.effects.len();
        let of: Vec<Option<Vec<JacobianColumn>>> = self
            .candidates
            .iter()
            .filter(|c| !c.effects.is_empty())
            .into_par_iter()
            .map(|c| {
                let model = c.build_model(base);
                let whole = change(&model)?;
                let mut columns = vec![whole.clone()];
                for n in model.shared_parameters() {
                    let ParameterRole::Effect { effect, .. } = n.role else { continue };
                    if effect < first {
                        continue;
                    }
                    let mut moved = model.clone();
                    let x = model.get(n.role, 0);
                    let h = if x + n.step > n.high { -n.step } else { n.step };
                    moved.set(n.role, 0, x + h);
                    let mut column = change(&moved)?;
                    for (now, was) in column
                        .innovations
                        .iter_mut()
                        .zip(&whole.innovations)
                        .chain(column.rupture_rows.iter_mut().zip(&whole.rupture_rows))
                    {
                        now.iter_mut().zip(was).for_each(|(now, was)| *now = (*now - was) / h);
                    }
                    columns.push(column);
                }
                Some(columns)
            })
            .collect();
        let mut more: Vec<JacobianColumn> =
            of.into_iter().collect::<Option<Vec<_>>>()?.into_iter().flatten().collect();
        if let Some(size_n) = self.unmodelled_n {
            let mut column = JacobianColumn::default();
            for (r, b) in data.recordings.iter().enumerate() {
                let mut f = vec![0.0; b.len()];
                for p in b.pieces.iter().filter(|p| p.position_m > base.tissue.surface_m) {
                    let turn = core::f64::consts::TAU * (p.position_m - base.tissue.surface_m)
                        / UNMODELLED_WAVELENGTH_M;
                    f[p.block as usize] = size_n * core::f64::consts::SQRT_2 * libm::sin(turn);
                }
                column.innovations.push(data.whiten(r, &f));
                column.rupture_rows.push(vec![0.0; 4 * at.ruptures[r].len()]);
            }
            more.push(column);
        }
        Some(gram_matrix(&linearization, &data, &more))
    }

    /// The information before any further insertion.
    #[must_use]
    pub fn current(&self) -> Information {
        self.to_information(self.prior_information.clone())
    }

    fn to_information(&self, all: SymmetricMatrix) -> Information {
        Information { schur: schur_complement(&all, self.shared_count), all, shared_count: self.shared_count }
    }

    /// The information after a motion in blocks; `None` when the model cannot be replayed along it.
    #[must_use]
    pub fn after_blocks(&self, blocks: &BlockAverages) -> Option<Information> {
        let (blocks, data) = self.with_expected_forces(blocks)?;
        let leader = single_recording_model(self.candidate_model(0), Vec::new());
        let rupture_times = free_rupture_times(&leader.compile(0)?, &blocks.pieces);
        let base = single_recording_model(&self.base, rupture_times);
        Some(self.to_information(add(&self.prior_information, &self.information_of(&base, data)?)))
    }

    /// A motion in blocks without forces; `None` for a recorded motion.
    #[must_use]
    pub fn motion_blocks(&self, motion: &Motion) -> Option<BlockAverages> {
        let recording = motion_to_recording(motion, self.sample_hz.min(MAX_SAMPLE_HZ))?;
        Some(BlockAverages::new(&recording, &[], COARSE_S.max(recording.duration_s() / MAX_BLOCKS)))
    }

    /// Blocks with the forces of the most probable candidate and the noise of their length.
    fn with_expected_forces(&self, blocks: &BlockAverages) -> Option<(BlockAverages, FitData)> {
        let mut blocks = blocks.clone();
        let (f, _) = predict_forces(self.candidate_model(0), &blocks)?;
        blocks.abs_force_n.clone_from(&f.iter().map(|f| f.abs()).collect());
        blocks.force_n = f;
        let times = blocks.sample_step_s * blocks.samples_per_block as f64 / BLOCK_S;
        let data = FitData::new(Arc::new(vec![blocks.clone()]), average_noise(&self.noise, times), 0.0);
        Some((blocks, data))
    }

    /// Largest force in N along a motion under every candidate.
    #[must_use]
    pub fn peak_forces_n(&self, blocks: &BlockAverages) -> Option<Vec<f64>> {
        let largest = |f: &[f64]| f.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
        self.models.iter().map(|m| Some(largest(&predict_forces(m, blocks)?.0))).collect()
    }

    /// Forces in N along a motion under every candidate, with times (s) and positions (m) of the blocks.
    #[must_use]
    pub fn expected_forces(&self, motion: &Motion) -> Option<ExpectedForces> {
        let blocks = self.motion_blocks(motion)?;
        let time_s: Vec<f64> = blocks.start_s.iter().zip(&blocks.end_s).map(|(a, b)| 0.5 * (a + b)).collect();
        let position_m = time_s.iter().map(|t| blocks.motion.at(*t).0).collect();
        let force_n =
            self.models.iter().map(|m| Some(predict_forces(m, &blocks)?.0)).collect::<Option<_>>()?;
        Some(ExpectedForces { time_s, position_m, force_n })
    }

    /// All pairs of candidates.
    #[must_use]
    pub fn pairs(&self) -> Vec<(usize, usize)> {
        let n = self.candidates.len() + usize::from(self.unmodelled_n.is_some());
        (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).collect()
    }

    /// Name of a candidate.
    #[must_use]
    pub fn name(&self, which: usize) -> &str {
        self.candidates.get(which).map_or(crate::candidate::UNKNOWN, |c| &c.name)
    }

    /// Expected difference of two candidates in nats: the log-likelihood gap of the true one to the re-fitted
    /// other one. For nested candidates the special case is tested against the general one; otherwise the
    /// smaller of both directions.
    #[must_use]
    pub fn separation_nats(&self, info: &Information, a: usize, b: usize) -> f64 {
        let n = self.candidates.len();
        if b >= n {
            return self.one_way_separation_nats(info, b, a);
        }
        let (i, j) = (&self.candidates[a], &self.candidates[b]);
        if i.is_special_case_of(j) {
            self.one_way_separation_nats(info, b, a)
        } else if j.is_special_case_of(i) {
            self.one_way_separation_nats(info, a, b)
        } else {
            self.one_way_separation_nats(info, a, b).min(self.one_way_separation_nats(info, b, a))
        }
    }

    /// Remaining nats when `truth` holds and `other` is re-fitted: `min 1/2 |whitened(f_truth - f_other)|^2`
    /// over all parameters of the base model and of `other`, to first order.
    #[must_use]
    pub fn one_way_separation_nats(&self, info: &Information, truth: usize, other: usize) -> f64 {
        let at = |k: usize| -> Option<usize> {
            if k >= self.candidates.len() {
                Some(info.schur.size.saturating_sub(1))
            } else {
                self.columns_of(k).map(|p| p.0)
            }
        };
        let mut x: Vec<(usize, f64)> = Vec::new();
        x.extend(at(truth).map(|k| (k, 1.0)));
        x.extend(at(other).map(|k| (k, -1.0)));
        let g = &info.schur;
        let all: f64 = x.iter().flat_map(|(i, a)| x.iter().map(move |(j, b)| a * b * g.at(*i, *j))).sum();
        let parameters: Vec<usize> = self.columns_of(other).map_or_else(Vec::new, |p| p.1.collect());
        let cross: Vec<f64> =
            parameters.iter().map(|e| x.iter().map(|(i, a)| a * g.at(*i, *e)).sum()).collect();
        let half = g.submatrix(&parameters).cholesky().forward_substitute(&cross);
        (0.5 * (all - half.iter().map(|h| h * h).sum::<f64>())).max(0.0)
    }

    /// Correlation of two candidates' columns with the shared parameters eliminated; 0 where one of them is not
    /// identifiable at all.
    #[must_use]
    pub fn correlation(&self, info: &Information, a: usize, b: usize) -> f64 {
        let (Some((i, _)), Some((j, _))) = (self.columns_of(a), self.columns_of(b)) else { return 0.0 };
        let g = &info.schur;
        let size = (g.at(i, i) * g.at(j, j)).sqrt();
        let whole = (info.all.at(info.shared_count + i, info.shared_count + i)
            * info.all.at(info.shared_count + j, info.shared_count + j))
        .sqrt();
        if size > 1e-8 * whole && size > 0.0 { (g.at(i, j) / size).clamp(-1.0, 1.0) } else { 0.0 }
    }
}

/// Predicted forces along a motion.
#[derive(Clone, Debug)]
pub struct ExpectedForces {
    /// Times in s.
    pub time_s: Vec<f64>,
    /// Positions in m.
    pub position_m: Vec<f64>,
    /// Forces in N, per candidate.
    pub force_n: Vec<Vec<f64>>,
}

impl Information {
    /// Standard deviations of the shared parameters on the fit scale; infinite where not identifiable.
    #[must_use]
    pub fn sds(&self) -> Vec<f64> {
        let rows: Vec<usize> = (0..self.shared_count).collect();
        self.all.submatrix(&rows).cholesky().inverse_diagonal().iter().map(|v| v.sqrt()).collect()
    }

    /// Half the log determinant of the shared parameters' information, in nats.
    #[must_use]
    pub fn half_log_det(&self) -> f64 {
        let rows: Vec<usize> = (0..self.shared_count).collect();
        0.5 * self.all.submatrix(&rows).cholesky().log_determinant()
    }
}

fn effect_parameter_count(c: &Candidate) -> usize {
    c.effects.iter().map(|c| c.info.parameters.iter().filter(|p| !p.integer).count()).sum()
}

/// The model for one future recording.
fn single_recording_model(model: &Model, rupture_times: Vec<f64>) -> Model {
    let mut model = model.clone();
    model.per_recording = vec![RecordingParameters::default()];
    model.zero_steps = vec![Vec::new()];
    let layers = model.layers();
    model.rupture_times_s =
        vec![if rupture_times.len() == layers { rupture_times } else { vec![NO_RUPTURE; layers] }];
    model
}

/// Forces (N) of a model along blocks with its own ruptures, and their times (s).
fn predict_forces(model: &Model, blocks: &BlockAverages) -> Option<(Vec<f64>, Vec<f64>)> {
    let compiled = single_recording_model(model, Vec::new()).compile(0)?;
    let pieces = motion_pieces(&compiled, blocks);
    let rupture_times = free_rupture_times(&compiled, &pieces);
    let mut out = ReplayResult::default();
    replay_with_ruptures(&compiled, blocks, &pieces, &rupture_times, &mut out);
    out.force_n.iter().all(|f| f.is_finite()).then_some((out.force_n, rupture_times))
}

/// A motion as a recording without forces; `None` for a recorded motion.
#[must_use]
pub fn motion_to_recording(motion: &Motion, sample_hz: f64) -> Option<Recording> {
    let plan = motion.plan()?;
    let n = (plan.duration_s() * sample_hz).floor() as usize + 1;
    let time_s: Vec<f64> = (0..n).map(|k| k as f64 / sample_hz).collect();
    let points: Vec<_> = time_s.iter().map(|t| plan.at(*t)).collect();
    let position = points.iter().map(|p| p.position_m).collect();
    let velocity = points.iter().map(|p| p.velocity_mps).collect();
    Recording::with_velocity(time_s, position, velocity, vec![0.0; n]).ok()
}

/// Noise of means over `times` blocks: the long-run variance of the autoregression as white noise.
fn average_noise(noise: &Noise, times: f64) -> Noise {
    let mut noise = noise.clone();
    for bin in &mut noise.bins {
        let left = 1.0 - bin.ar.iter().chain(&bin.long_memory).sum::<f64>();
        let sd_n = (bin.innovation_sd_n / left.clamp(MIN_ONE_MINUS_AR_SUM, 4.0)).max(0.3 * bin.sd_n)
            / times.max(1.0).sqrt();
        (bin.innovation_sd_n, bin.sd_n) = (sd_n, sd_n);
        bin.ar.fill(0.0);
        bin.long_memory.fill(0.0);
    }
    noise
}
