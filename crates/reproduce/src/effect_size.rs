//! Effect sizes: the quantity of a claim as one number with its interval over the seeds, compared with a criterion.

use crate::seed_interval::{Interval, geometric_mean, mean, share};
use serde::{Serialize, Serializer};
use stylet_report::significant;

/// Share of the seeds that must give a value; with fewer there is no effect.
pub const MIN_SEED_SHARE: f64 = 0.8;

/// One experiment of an effect: a value per seed, or none.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentValues {
    /// The experiment.
    pub name: String,
    /// Values by seed.
    pub values: Vec<Option<f64>>,
}

impl ExperimentValues {
    /// Values by seed of the experiment `name`.
    #[must_use]
    pub fn new(name: impl Into<String>, values: impl IntoIterator<Item = Option<f64>>) -> Self {
        Self { name: name.into(), values: values.into_iter().collect() }
    }
}

/// Aggregation over the experiments of a seed, and over the seeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Geometric mean of ratios, over experiments that have one.
    Ratio,
    /// The smallest of ratios, if all exist; geometric mean over the seeds.
    SmallestRatio,
    /// The largest of ratios; geometric mean over the seeds.
    LargestRatio,
    /// Mean, over experiments that have a value.
    Mean,
    /// Share of the insertions, all counted.
    Share,
}

impl Scale {
    /// Aggregates the experiments of a seed.
    fn of_seed(self, values: &[Option<f64>]) -> Option<f64> {
        let some: Vec<f64> = values.iter().copied().flatten().collect();
        if some.is_empty() {
            return None;
        }
        let n = some.len() as f64;
        match self {
            Scale::Ratio => Some(libm::exp(some.iter().map(|x| libm::log(*x)).sum::<f64>() / n)),
            Scale::SmallestRatio => {
                (some.len() == values.len()).then(|| some.iter().copied().fold(f64::INFINITY, f64::min))
            }
            Scale::LargestRatio => Some(some.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
            Scale::Mean | Scale::Share => Some(some.iter().sum::<f64>() / n),
        }
    }

    fn over_seeds(self, values: &[f64]) -> Option<Interval> {
        match self {
            Scale::Ratio | Scale::SmallestRatio | Scale::LargestRatio => geometric_mean(values),
            Scale::Mean => mean(values),
            Scale::Share => share(values),
        }
    }
}

/// Measurements under a condition.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Aggregation.
    pub scale: Scale,
    /// The experiments.
    pub parts: Vec<ExperimentValues>,
}

/// An effect with its interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Effect {
    /// Value and 95 % interval; none when too few seeds give a value.
    #[serde(flatten)]
    pub interval: Option<Interval>,
    /// Number of seeds that gave a value.
    pub seeds: usize,
    /// Number of all seeds.
    pub of: usize,
}

impl Measured {
    /// The effect over all experiments.
    #[must_use]
    pub fn effect(&self) -> Effect {
        let of = self.parts.iter().map(|p| p.values.len()).min().unwrap_or(0);
        let seed = |i: usize| {
            let values: Vec<Option<f64>> = self.parts.iter().map(|p| p.values[i]).collect();
            self.scale.of_seed(&values)
        };
        Self::aggregate(self.scale, (0..of).map(seed))
    }

    /// The effect of each experiment alone.
    #[must_use]
    pub fn parts(&self) -> Vec<(String, Effect)> {
        let one =
            |p: &ExperimentValues| (p.name.clone(), Self::aggregate(self.scale, p.values.iter().copied()));
        self.parts.iter().map(one).collect()
    }

    fn aggregate(scale: Scale, values: impl Iterator<Item = Option<f64>>) -> Effect {
        let all: Vec<Option<f64>> = values.collect();
        let some: Vec<f64> = all.iter().copied().flatten().filter(|x| x.is_finite()).collect();
        let enough = some.len() as f64 >= MIN_SEED_SHARE * all.len() as f64;
        Effect { interval: scale.over_seeds(&some).filter(|_| enough), seeds: some.len(), of: all.len() }
    }
}

impl Effect {
    /// `0.93 (0.91 to 0.95)`, or how many seeds gave a value.
    #[must_use]
    pub fn words(&self) -> String {
        match self.interval {
            Some(i) => {
                let text = |x: f64| significant(x, 3);
                format!("{} ({} to {})", text(i.value), text(i.low), text(i.high))
            }
            None => format!("a value in {} of {} seeds only", self.seeds, self.of),
        }
    }
}

/// Position of an effect relative to its criterion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CriterionResult {
    /// The whole interval on the claim's side.
    Supports,
    /// The whole interval on the other side.
    Contradicts,
    /// The interval contains the limit of the criterion, or there is no effect.
    Undecided,
}

impl CriterionResult {
    /// In words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            CriterionResult::Supports => "supports",
            CriterionResult::Contradicts => "contradicts",
            CriterionResult::Undecided => "undecided",
        }
    }
}

/// Condition of a claim on its effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Criterion {
    /// Above a number.
    Above(f64),
    /// Below a number.
    Below(f64),
    /// Between two numbers.
    Between(f64, f64),
}

impl Criterion {
    /// `between 0.75 and 1`.
    #[must_use]
    pub fn words(self) -> String {
        let text = |x: f64| if x != 0.0 && x.abs() < 1e-3 { format!("{x:e}") } else { format!("{x}") };
        match self {
            Criterion::Above(x) => format!("above {}", text(x)),
            Criterion::Below(x) => format!("below {}", text(x)),
            Criterion::Between(a, b) => format!("between {} and {}", text(a), text(b)),
        }
    }

    fn holds(self, x: f64) -> bool {
        match self {
            Criterion::Above(bar) => x > bar,
            Criterion::Below(bar) => x < bar,
            Criterion::Between(low, high) => low < x && x < high,
        }
    }

    /// Position of an effect relative to this condition.
    #[must_use]
    pub fn evaluate(self, effect: &Effect) -> CriterionResult {
        let Some(Interval { low, high, .. }) = effect.interval else { return CriterionResult::Undecided };
        let outside = match self {
            Criterion::Above(bar) => high <= bar,
            Criterion::Below(bar) => low >= bar,
            Criterion::Between(from, to) => high <= from || low >= to,
        };
        if self.holds(low) && self.holds(high) {
            CriterionResult::Supports
        } else if outside {
            CriterionResult::Contradicts
        } else {
            CriterionResult::Undecided
        }
    }

    /// The side of the point estimate; `None` without an effect.
    #[must_use]
    pub fn side(self, effect: &Effect) -> Option<bool> {
        effect.interval.map(|i| self.holds(i.value))
    }
}

impl Serialize for Criterion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.words())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effect(low: f64, value: f64, high: f64) -> Effect {
        Effect { interval: Some(Interval { value, low, high }), seeds: 50, of: 50 }
    }

    #[test]
    fn the_whole_interval_decides() {
        assert_eq!(Criterion::Below(1.0).evaluate(&effect(0.8, 0.9, 0.99)), CriterionResult::Supports);
        assert_eq!(Criterion::Below(1.0).evaluate(&effect(0.8, 0.9, 1.01)), CriterionResult::Undecided);
        assert_eq!(Criterion::Below(1.0).evaluate(&effect(1.0, 1.1, 1.2)), CriterionResult::Contradicts);
        assert_eq!(
            Criterion::Between(0.75, 1.0).evaluate(&effect(0.5, 0.6, 0.7)),
            CriterionResult::Contradicts
        );
        assert_eq!(
            Criterion::Between(0.75, 1.0).evaluate(&effect(0.7, 0.8, 0.9)),
            CriterionResult::Undecided
        );
        let none = Effect { interval: None, seeds: 3, of: 50 };
        assert_eq!(Criterion::Above(0.0).evaluate(&none), CriterionResult::Undecided);
        assert_eq!(none.words(), "a value in 3 of 50 seeds only");
    }

    #[test]
    fn too_few_values_are_no_effect_and_a_missing_experiment_is_no_smallest_ratio() {
        let values = |some: usize| (0..10).map(move |i| (i < some).then_some(2.0));
        let of = |parts| Measured { scale: Scale::SmallestRatio, parts }.effect();
        assert!(of(vec![ExperimentValues::new("a", values(8))]).interval.is_some());
        assert!(of(vec![ExperimentValues::new("a", values(7))]).interval.is_none());
        let two = of(vec![ExperimentValues::new("a", values(10)), ExperimentValues::new("b", values(7))]);
        assert_eq!((two.interval, two.seeds), (None, 7));
        let share = Measured {
            scale: Scale::Share,
            parts: vec![
                ExperimentValues::new("a", [Some(1.0); 50]),
                ExperimentValues::new("b", [Some(0.0); 50]),
            ],
        };
        assert_eq!(share.effect().interval.map(|i| i.value), Some(0.5));
        assert_eq!(share.parts()[0].1.interval.map(|i| i.high), Some(1.0));
    }
}
