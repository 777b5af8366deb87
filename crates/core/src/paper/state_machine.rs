//! Transitions of the paper's state machine as a table, for drawings and tests.

use crate::sample::State;

/// Condition of a transition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Trigger {
    /// The filtered force derivative exceeds its threshold, `g_f` rises to 1 \[S (1)\].
    DerivativeOn,
    /// The derivative falls back without counting as a rupture: detection is disabled, or trailing edges are switched off
    /// \[D\].
    DerivativeOff,
    /// The decision function `g` of the CUSUM crosses its threshold.
    CusumAlarm,
    /// `g_f` falls back to 0 without an alarm \[S sec. I\].
    TrailingEdge,
    /// The tip passes the far face of a layer of known depth.
    KnownFace,
    /// The next sample.
    NextSample,
    /// The drop is over: enough travel or time \[S `T_drop`\].
    DropOver,
    /// The needle reverses, which ends the waiting \[D\].
    Reversal,
    /// The layer is re-estimated, its friction compensated, and the needle has travelled on.
    Compensated,
}

impl Trigger {
    /// Short description.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Trigger::DerivativeOn => "force derivative above β",
            Trigger::DerivativeOff => "derivative back, detection disabled",
            Trigger::CusumAlarm => "CUSUM alarm",
            Trigger::TrailingEdge => "derivative's trailing edge",
            Trigger::KnownFace => "known far face",
            Trigger::NextSample => "next sample",
            Trigger::DropOver => "T_drop over",
            Trigger::Reversal => "needle reverses",
            Trigger::Compensated => "compensated",
        }
    }
}

/// One transition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transition {
    /// State before.
    pub from: State,
    /// State after.
    pub to: State,
    /// Conditions, any of which is sufficient.
    pub triggers: &'static [Trigger],
    /// Described in the supplement's Fig. 1 and sec. I; the others are completions \[D\].
    pub in_supplement: bool,
}

/// Every transition that [`crate::Enhancer`] can make.
pub const TRANSITIONS: [Transition; 8] = {
    use State::{DetectedRupture, ExpectedRupture, ForceCompensation, ForceDropMeasuring, NoRupture};
    use Trigger::{
        Compensated, CusumAlarm, DerivativeOff, DerivativeOn, DropOver, KnownFace, NextSample, Reversal,
        TrailingEdge,
    };
    const fn arrow(from: State, to: State, triggers: &'static [Trigger], in_supplement: bool) -> Transition {
        Transition { from, to, triggers, in_supplement }
    }
    [
        arrow(NoRupture, ExpectedRupture, &[DerivativeOn], true),
        arrow(ExpectedRupture, NoRupture, &[DerivativeOff], false),
        arrow(NoRupture, DetectedRupture, &[CusumAlarm, KnownFace], true),
        arrow(ExpectedRupture, DetectedRupture, &[CusumAlarm, TrailingEdge, KnownFace], true),
        arrow(DetectedRupture, ForceDropMeasuring, &[NextSample], true),
        arrow(DetectedRupture, ForceCompensation, &[Reversal], false),
        arrow(ForceDropMeasuring, ForceCompensation, &[DropOver, Reversal], true),
        arrow(ForceCompensation, NoRupture, &[Compensated], true),
    ]
};
