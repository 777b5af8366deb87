//! Why there is no plan.

/// What is wrong, and what would be right.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// A limit is no positive number.
    #[error("{field}: is {value}; it must be {right}")]
    Limit {
        /// Field of the limits.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What would be right.
        right: &'static str,
    },
    /// No motion keeps the limits.
    #[error("no insertion keeps these limits: {why}; {remedy}")]
    Infeasible {
        /// The limit that cannot be kept.
        why: String,
        /// What would help.
        remedy: String,
    },
    /// The law cannot be replayed.
    #[error("the law gives no finite force along a motion: {0}")]
    NoForce(String),
    /// A diagnosis failed.
    #[error(transparent)]
    Diagnose(#[from] stylet_diagnose::DiagnoseError),
    /// A planned insertion cannot be simulated.
    #[error("the planned insertion cannot be simulated: {0}")]
    Simulate(#[from] stylet_testbed::SimulateError),
}
