//! Errors of planning.

/// Error of planning, with the remedy.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// A limit is not a positive number.
    #[error("{field} is {value}; it must be {expected}")]
    Limit {
        /// Field of the limits.
        field: &'static str,
        /// Its value.
        value: f64,
        /// An admissible value.
        expected: &'static str,
    },
    /// No motion satisfies the limits.
    #[error("no motion satisfies these limits: {why}; {remedy}")]
    Infeasible {
        /// The limit that cannot be satisfied.
        why: String,
        /// What would help.
        remedy: String,
    },
    /// The model's force is not finite.
    #[error("the model gives no finite force along the motion: {0}")]
    NoForce(String),
    /// A diagnosis failed.
    #[error(transparent)]
    Diagnose(#[from] stylet_diagnose::DiagnoseError),
    /// A planned insertion cannot be simulated.
    #[error("the planned insertion cannot be simulated: {0}")]
    Simulate(#[from] stylet_testbed::SimulateError),
}

impl PlanError {
    /// The model of the scenario cannot be replayed.
    pub(crate) fn no_force() -> Self {
        Self::NoForce("check stiffness, friction and effects of the scenario".to_owned())
    }
}
