//! The state machine as a table: what a drawing of it is made from, and what a test holds against the
//! transitions seen in runs (`tests/promises/state_machine.rs`).

use crate::sample::State;

/// What moves the machine from one state to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Trigger {
    /// The filtered force derivative exceeds its threshold, `g_f` rises to 1 \[S (1)\].
    DerivativeOn,
    /// The derivative falls back and that is not taken for a rupture: detection rests, or trailing edges
    /// are switched off \[D\].
    DerivativeOff,
    /// The CUSUM's decision function `g` crosses its threshold.
    CusumAlarm,
    /// `g_f` falls back to 0 without an alarm \[S sec. I\].
    TrailingEdge,
    /// The tip passes the far face of a layer of known depth.
    KnownFace,
    /// The next sample, whatever it is.
    NextSample,
    /// The drop is over: travelled far enough, waited long enough \[S `T_drop`\].
    DropOver,
    /// The needle turns back, which ends the wait \[D\].
    Reversal,
    /// The layer is re-estimated, its friction compensated, and the needle has travelled on.
    Compensated,
}

impl Trigger {
    /// In a few words.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Trigger::DerivativeOn => "force derivative above β",
            Trigger::DerivativeOff => "derivative back, detection at rest",
            Trigger::CusumAlarm => "CUSUM alarm",
            Trigger::TrailingEdge => "derivative's trailing edge",
            Trigger::KnownFace => "known far face",
            Trigger::NextSample => "next sample",
            Trigger::DropOver => "T_drop over",
            Trigger::Reversal => "needle turns back",
            Trigger::Compensated => "compensated",
        }
    }
}

/// One arrow of the state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transition {
    /// From this state
    pub from: State,
    /// to this one,
    pub to: State,
    /// for one of these reasons.
    pub triggers: &'static [Trigger],
    /// Whether the supplement's Fig. 1 and sec. I describe it; the others are completions.
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
