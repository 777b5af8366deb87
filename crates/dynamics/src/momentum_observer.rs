//! Generalised-momentum observer: external joint torques from commanded torques and joint motion, without
//! accelerations.

use crate::arm_posture::JointVector;
use crate::error::{Error, check, check_finite_joints};
use crate::generalized_momentum::MomentumTerms;

/// Observer gain (1/s): the inverse of the time constant with which the residual follows an external torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum JointGain<const N: usize> {
    /// The same for all joints.
    Uniform(f64),
    /// From the base outwards.
    PerJoint([f64; N]),
}

/// Parameters of the observer.
///
/// `r = G (p - p(0) - int(tau + C^T(q, qd) qd - g(q) + r) ds)` with `p = M(q) qd` (De Luca and Mattone, ICRA
/// 2005; Haddadin et al., T-RO 2017), which is `dr/dt = G (tau_ext - r)`: each residual is its joint's
/// external torque after a first-order low-pass of time constant `1/G`. An external wrench `F` on the tip
/// gives `r -> J^T F`; joint friction and model errors enter `tau_ext`, too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObserverConfig<const N: usize> {
    /// Gain; 5 /s in the laboratory software of the paper.
    pub gain_per_s: JointGain<N>,
}

impl<const N: usize> Default for ObserverConfig<N> {
    fn default() -> Self {
        Self { gain_per_s: JointGain::Uniform(5.0) }
    }
}

impl<const N: usize> ObserverConfig<N> {
    /// Checks the gains: positive and finite.
    pub fn build(&self) -> Result<Observer<N>, Error> {
        let gains = match self.gain_per_s {
            JointGain::Uniform(gain) => [gain; N],
            JointGain::PerJoint(gains) => gains,
        };
        for (i, &gain) in gains.iter().enumerate() {
            let joint = matches!(self.gain_per_s, JointGain::PerJoint(_)).then_some(i + 1);
            check("gain_per_s", joint, gain, gain > 0.0, "positive")?;
        }
        Ok(Observer { gains_per_s: gains })
    }
}

/// State of the observer.
#[derive(Debug, Clone, PartialEq)]
pub struct ObserverState<const N: usize> {
    raw_nm: JointVector<N>,
    offset_nm: JointVector<N>,
    /// Sum and count while the offset is being averaged.
    averaging: Option<(JointVector<N>, u32)>,
    /// `p` and `C^T qd - g` of the previous sample.
    previous: Option<(JointVector<N>, JointVector<N>)>,
    /// Sampling time and `exp(-G dt)` for it.
    decay: (f64, [f64; N]),
}

impl<const N: usize> Default for ObserverState<N> {
    fn default() -> Self {
        let zero = JointVector::zeros();
        Self { raw_nm: zero, offset_nm: zero, averaging: None, previous: None, decay: (0.0, [1.0; N]) }
    }
}

impl<const N: usize> ObserverState<N> {
    /// External joint torques less the offset (N m).
    pub fn residual_nm(&self) -> JointVector<N> {
        self.raw_nm - self.offset_nm
    }

    /// Starts averaging the residual for [`ObserverState::finish_offset`]. Start a few time constants into steady motion and end before contact.
    pub fn begin_offset(&mut self) {
        self.averaging = Some((JointVector::zeros(), 0));
    }

    /// Uses the average since [`ObserverState::begin_offset`] as offset and returns it (N m). An error, without change, when there was no step in
    /// between.
    pub fn finish_offset(&mut self) -> Result<JointVector<N>, Error> {
        match self.averaging.take() {
            Some((sum, count)) if count > 0 => {
                self.offset_nm = sum / f64::from(count);
                Ok(self.offset_nm)
            }
            _ => Err(Error::Parameter {
                name: "offset_samples",
                joint: None,
                value: 0.0,
                expected: "at least 1 (call `begin_offset`, then step, then `finish_offset`)",
            }),
        }
    }
}

/// A checked observer; its state is an [`ObserverState`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observer<const N: usize> {
    gains_per_s: [f64; N],
}

impl<const N: usize> Observer<N> {
    /// One sample: model terms at the present `q, qd`, the torque that acted since the previous sample, the
    /// time since then. Returns the residual less the offset (N m). The first call sets `p(0)`. On an error
    /// the state is unchanged.
    ///
    /// Over the interval `dt`, `C^T qd - g` is integrated by the trapezoidal rule, and the mean external torque is the rest of the change of
    /// momentum: `tau_ext = (p - p_previous)/dt - tau - (C^T qd - g)`. The residual then follows it exactly as the continuous observer does for a
    /// torque constant over the interval: `r += (1 - exp(-G dt)) (tau_ext - r)`. Stable at any gain and sampling time; no integral grows with time.
    pub fn step(
        &self,
        state: &mut ObserverState<N>,
        terms: &MomentumTerms<N>,
        torque_nm: &JointVector<N>,
        dt_s: f64,
    ) -> Result<JointVector<N>, Error> {
        check("dt_s", None, dt_s, dt_s > 0.0, "positive")?;
        let p = terms.momentum_nms;
        let drift = terms.coriolis_transposed_nm - terms.gravity_nm;
        check_finite_joints("torque_nm", torque_nm.as_slice())?;
        check_finite_joints("momentum_nms", p.as_slice())?;
        check_finite_joints("coriolis_transposed_nm - gravity_nm", drift.as_slice())?;

        if let Some((p_before, drift_before)) = state.previous {
            if state.decay.0 != dt_s {
                state.decay = (dt_s, self.gains_per_s.map(|gain| libm::exp(-gain * dt_s)));
            }
            let external = (p - p_before) / dt_s - torque_nm - (drift + drift_before) * 0.5;
            for i in 0..N {
                state.raw_nm[i] += (1.0 - state.decay.1[i]) * (external[i] - state.raw_nm[i]);
            }
        }
        state.previous = Some((p, drift));
        if let Some((sum, count)) = &mut state.averaging {
            *sum += state.raw_nm;
            *count = count.saturating_add(1);
        }
        Ok(state.residual_nm())
    }
}
