//! Inverse kinematics within the joint limits.

use crate::arm_posture::{Arm, JointVector};
use crate::error::{Error, check, check_finite_joints};
use crate::kinematics::damped_inverse;
use crate::pose::Pose;
use nalgebra::Vector6;

/// Tolerances and effort of inverse kinematics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IkConfig {
    /// Largest distance of the tip from its target.
    pub position_tolerance_m: f64,
    /// Largest angle between the tip's frame and its target.
    pub orientation_tolerance_rad: f64,
    /// Steps per start.
    pub max_iterations: u32,
    /// Largest change of a joint angle per step.
    pub max_step_rad: f64,
    /// Further starts, spread over the joint ranges, when the given start fails. Zero keeps the solution near the start.
    pub restarts: u32,
}

impl Default for IkConfig {
    fn default() -> Self {
        Self {
            position_tolerance_m: 1e-10,
            orientation_tolerance_rad: 1e-10,
            max_iterations: 200,
            max_step_rad: 0.3,
            restarts: 20,
        }
    }
}

impl IkConfig {
    pub(crate) fn validate(&self) -> Result<(), Error> {
        let Self { position_tolerance_m: p, orientation_tolerance_rad: o, max_step_rad: s, .. } = *self;
        check("position_tolerance_m", None, p, p > 0.0, "positive")?;
        check("orientation_tolerance_rad", None, o, o > 0.0, "positive")?;
        check("max_step_rad", None, s, s > 0.0, "positive")
    }
}

/// Result of one start.
struct Attempt<const N: usize> {
    q: JointVector<N>,
    position_error_m: f64,
    orientation_error_rad: f64,
}

impl<const N: usize> Arm<N> {
    /// Joint angles at which the tip's frame coincides with `target` (base coordinates), starting from
    /// `start_rad`.
    ///
    /// Gauss-Newton on the pose error with Levenberg-Marquardt damping proportional to the squared error
    /// (Sugihara, IEEE T-RO 2011), so that steps to far targets are limited and near ones converge
    /// quadratically. A joint that would cross a limit stays on it and the others compensate (Flacco, De Luca and Khatib, ICRA 2012). If that
    /// fails, further starts are tried in a fixed order; the error reports the best of all.
    pub fn inverse_kinematics(
        &self,
        target: &Pose,
        start_rad: &JointVector<N>,
        config: &IkConfig,
    ) -> Result<JointVector<N>, Error> {
        config.validate()?;
        target.validate("target", None)?;
        check_finite_joints("start_rad", start_rad.as_slice())?;
        let mut best: Option<Attempt<N>> = None;
        for start in 0..=config.restarts {
            let from = if start == 0 { *start_rad } else { self.spread_start(start) };
            let attempt = self.approach(target, from, config);
            if attempt.position_error_m <= config.position_tolerance_m
                && attempt.orientation_error_rad <= config.orientation_tolerance_rad
            {
                return Ok(attempt.q);
            }
            let cost = |a: &Attempt<N>| libm::hypot(a.position_error_m, a.orientation_error_rad);
            if best.as_ref().is_none_or(|b| cost(&attempt) < cost(b)) {
                best = Some(attempt);
            }
        }
        let (position_error_m, orientation_error_rad, joint_at_limit) = match &best {
            Some(a) => (a.position_error_m, a.orientation_error_rad, self.joint_at_limit(&a.q)),
            None => (f64::NAN, f64::NAN, None),
        };
        Err(Error::Unreachable { position_error_m, orientation_error_rad, joint_at_limit })
    }

    fn approach(&self, target: &Pose, from: JointVector<N>, config: &IkConfig) -> Attempt<N> {
        let limits = self.limits();
        let mut q = JointVector::<N>::from_fn(|i, _| from[i].clamp(limits[i].lower_rad, limits[i].upper_rad));
        let mut iteration = 0;
        loop {
            let (tip, jacobian) = self.at(&q).tip_and_jacobian();
            let dx = target.position_m - tip.position_m;
            let turn = tip.rotation_vector_to(target);
            let (position_error_m, orientation_error_rad) = (dx.norm(), turn.norm());
            let done = position_error_m <= config.position_tolerance_m
                && orientation_error_rad <= config.orientation_tolerance_rad;
            if done || iteration == config.max_iterations {
                return Attempt { q, position_error_m, orientation_error_rad };
            }
            iteration += 1;

            let mut error = Vector6::new(dx.x, dx.y, dx.z, turn.x, turn.y, turn.z);
            let damping2 = 0.1 * error.norm_squared() + 1e-12;
            let (mut free, mut step) = (jacobian, JointVector::<N>::zeros());
            let mut fixed = [false; N];
            for _ in 0..=N {
                let change = damped_inverse(&free, &error, damping2);
                let mut hit = false;
                for i in 0..N {
                    if fixed[i] {
                        continue;
                    }
                    let (down, up) = (limits[i].lower_rad - q[i], limits[i].upper_rad - q[i]);
                    step[i] = change[i].clamp(down, up);
                    if step[i] != change[i] {
                        (fixed[i], hit) = (true, true);
                        error -= jacobian.column(i) * step[i];
                        free.column_mut(i).fill(0.0);
                    }
                }
                if !hit {
                    break;
                }
            }
            let largest = step.amax();
            if largest > config.max_step_rad {
                step *= config.max_step_rad / largest;
            }
            q += step;
            for i in 0..N {
                q[i] = q[i].clamp(limits[i].lower_rad, limits[i].upper_rad);
            }
        }
    }

    /// Start `k = 1, 2, ...`: the middle of all ranges, then an additive recurrence (Roberts 2018) over their
    /// inner 80 %.
    fn spread_start(&self, k: u32) -> JointVector<N> {
        let limits = self.limits();
        // Root of x^(N+1) = x + 1, the generalised golden ratio.
        let mut phi = 1.5;
        for _ in 0..50 {
            phi = libm::pow(1.0 + phi, 1.0 / (N as f64 + 1.0));
        }
        let mut weight = 1.0;
        JointVector::from_fn(|i, _| {
            weight /= phi;
            let x = 0.5 + weight * f64::from(k - 1);
            let fraction = 0.1 + 0.8 * (x - libm::floor(x));
            limits[i].lower_rad + fraction * (limits[i].upper_rad - limits[i].lower_rad)
        })
    }

    fn joint_at_limit(&self, q: &JointVector<N>) -> Option<usize> {
        let at = |i: &usize| {
            let l = &self.model().links[*i].limits;
            q[*i] - l.lower_rad < 1e-9 || l.upper_rad - q[*i] < 1e-9
        };
        (0..N).find(at).map(|i| i + 1)
    }
}
