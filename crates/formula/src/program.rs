//! Evaluation: the syntax tree in the order of its evaluation, on a stack of fixed size.

use crate::formula_error::FormulaError;
use crate::function::Function;
use crate::syntax_tree::{Node, NodeKind};
use alloc::format;
use alloc::vec::Vec;

/// Most values that an evaluation holds at once.
pub const MAX_STACK: usize = 24;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Number(f64),
    Input(u16),
    /// A function of the latest values.
    Call(Function),
    /// A function of the latest value and an input, or a number.
    CallInput(Function, u16),
    CallNumber(Function, f64),
}

/// A compiled formula.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    steps: Vec<Step>,
}

impl Program {
    /// Compiles a syntax tree; constant parts are evaluated once.
    pub(crate) fn compile(tree: &Node) -> Result<Self, FormulaError> {
        let mut steps = Vec::new();
        let deepest = push(tree, &mut steps, 0);
        if deepest > MAX_STACK {
            let what =
                format!("the formula holds {deepest} values at once; at most {MAX_STACK} are possible");
            return Err(FormulaError::new(tree.place, what));
        }
        Ok(Self { steps })
    }

    /// The value for these inputs, in the order of the names that the formula was parsed with; missing ones are NaN. NaN or
    /// infinite where the formula has no value.
    #[must_use]
    pub fn evaluate(&self, inputs: &[f64]) -> f64 {
        let mut stack = [0.0; MAX_STACK];
        let input = |k: u16| inputs.get(usize::from(k)).copied().unwrap_or(f64::NAN);
        let mut top = 0;
        for step in &self.steps {
            match *step {
                Step::Number(x) => push_value(&mut stack, &mut top, x),
                Step::Input(k) => push_value(&mut stack, &mut top, input(k)),
                Step::CallInput(function, k) => binary(&mut stack, top, function, input(k)),
                Step::CallNumber(function, x) => binary(&mut stack, top, function, x),
                Step::Call(function) => {
                    let values = arguments(&stack, &mut top, function);
                    push_value(&mut stack, &mut top, function.value(values));
                }
            }
        }
        stack[0]
    }

    /// The value, and its derivative by input `index`.
    #[must_use]
    pub fn evaluate_with_derivative(&self, inputs: &[f64], index: usize) -> (f64, f64) {
        let mut stack = [(0.0, 0.0); MAX_STACK];
        let input = |k: u16| {
            let seed = f64::from(u8::from(usize::from(k) == index));
            (inputs.get(usize::from(k)).copied().unwrap_or(f64::NAN), seed)
        };
        let mut top = 0;
        for step in &self.steps {
            match *step {
                Step::Number(x) => push_value(&mut stack, &mut top, (x, 0.0)),
                Step::Input(k) => push_value(&mut stack, &mut top, input(k)),
                Step::CallInput(function, k) => {
                    push_value(&mut stack, &mut top, input(k));
                    let values = arguments(&stack, &mut top, function);
                    push_value(&mut stack, &mut top, function.dual(values));
                }
                Step::CallNumber(function, x) => {
                    push_value(&mut stack, &mut top, (x, 0.0));
                    let values = arguments(&stack, &mut top, function);
                    push_value(&mut stack, &mut top, function.dual(values));
                }
                Step::Call(function) => {
                    let values = arguments(&stack, &mut top, function);
                    push_value(&mut stack, &mut top, function.dual(values));
                }
            }
        }
        stack[0]
    }
}

/// Appends the steps of a node; returns how many values are held at most, with `held` before it.
fn push(node: &Node, steps: &mut Vec<Step>, held: usize) -> usize {
    if let Some(number) = node.number() {
        steps.push(Step::Number(number));
        return held + 1;
    }
    match &node.kind {
        NodeKind::Number(x) => {
            steps.push(Step::Number(*x));
            held + 1
        }
        NodeKind::Input(k) => {
            steps.push(Step::Input(*k as u16));
            held + 1
        }
        NodeKind::Call(function, all) => {
            let mut deepest = held + 1;
            if let [left, right] = &all[..] {
                deepest = deepest.max(push(left, steps, held));
                // One more is held where the derivative is computed.
                let last = match (&right.kind, right.number()) {
                    (_, Some(number)) => Step::CallNumber(*function, number),
                    (NodeKind::Input(k), _) => Step::CallInput(*function, *k as u16),
                    _ => {
                        deepest = deepest.max(push(right, steps, held + 1));
                        Step::Call(*function)
                    }
                };
                steps.push(last);
                return deepest.max(held + 2);
            }
            for (k, argument) in all.iter().enumerate() {
                deepest = deepest.max(push(argument, steps, held + k));
            }
            steps.push(Step::Call(*function));
            deepest
        }
    }
}

#[inline]
fn push_value<T>(stack: &mut [T; MAX_STACK], top: &mut usize, value: T) {
    // The size was checked when the formula was compiled.
    if let Some(slot) = stack.get_mut(*top) {
        *slot = value;
        *top += 1;
    }
}

#[inline]
fn binary(stack: &mut [f64; MAX_STACK], top: usize, function: Function, right: f64) {
    if let Some(value) = stack.get_mut(top.wrapping_sub(1)) {
        *value = function.value([*value, right, 0.0]);
    }
}

/// Takes the arguments of a function from the stack.
#[inline]
fn arguments<T: Copy + Default>(stack: &[T; MAX_STACK], top: &mut usize, function: Function) -> [T; 3] {
    let count = function.arguments();
    *top = top.saturating_sub(count);
    let mut out = [T::default(); 3];
    for (value, from) in out.iter_mut().zip(stack.iter().skip(*top)).take(count) {
        *value = *from;
    }
    out
}
