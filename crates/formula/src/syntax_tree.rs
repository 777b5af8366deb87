//! The parsed formula.

use crate::function::Function;
use alloc::vec::Vec;

/// A part of a formula with its place in the text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    /// First byte, and the byte behind the part.
    pub place: (usize, usize),
    pub kind: NodeKind,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum NodeKind {
    Number(f64),
    Input(usize),
    Call(Function, Vec<Node>),
}

impl Node {
    /// Whether the input occurs.
    pub fn uses(&self, index: usize) -> bool {
        self.place_of(index).is_some()
    }

    /// The first place of the input.
    pub fn place_of(&self, index: usize) -> Option<(usize, usize)> {
        match &self.kind {
            NodeKind::Number(_) => None,
            NodeKind::Input(k) => (*k == index).then_some(self.place),
            NodeKind::Call(_, arguments) => arguments.iter().find_map(|a| a.place_of(index)),
        }
    }

    /// The value, if it is a number; with a sign, too.
    pub fn number(&self) -> Option<f64> {
        match &self.kind {
            NodeKind::Number(x) => Some(*x),
            NodeKind::Input(_) => None,
            NodeKind::Call(function, arguments) => {
                let mut values = [0.0; 3];
                for (value, argument) in values.iter_mut().zip(arguments) {
                    *value = argument.number()?;
                }
                Some(function.value(values))
            }
        }
    }
}
