use crate::formula_error::FormulaError;
use crate::parser;
use crate::program::Program;
use crate::syntax_tree::Node;
use crate::unit::Unit;
use crate::unit_check;
use alloc::string::String;

/// A parsed and compiled formula.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    text: String,
    tree: Node,
    program: Program,
}

impl Formula {
    /// Parses `text` with inputs of these names.
    ///
    /// # Errors
    /// [`FormulaError`] with its place in the text.
    pub fn parse(text: &str, inputs: &[&str]) -> Result<Self, FormulaError> {
        let tree = parser::parse(text, inputs)?;
        let program = Program::compile(&tree)?;
        Ok(Self { text: text.into(), tree, program })
    }

    /// The text.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The syntax tree.
    pub(crate) fn tree(&self) -> &Node {
        &self.tree
    }

    /// The compiled formula.
    #[must_use]
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Whether the formula contains input `index`.
    #[must_use]
    pub fn uses(&self, index: usize) -> bool {
        self.tree.uses(index)
    }

    /// First place of input `index` in the text, as a range of bytes.
    #[must_use]
    pub fn place_of(&self, index: usize) -> Option<(usize, usize)> {
        self.tree.place_of(index)
    }

    /// The unit of the formula for inputs with these units; `None` for a formula of zeros, which fits every unit.
    ///
    /// # Errors
    /// [`FormulaError`] at the part whose units do not fit.
    pub fn unit(&self, inputs: &[Unit]) -> Result<Option<Unit>, FormulaError> {
        unit_check::unit_of(&self.tree, inputs)
    }

    /// Checks that the formula has this unit.
    ///
    /// # Errors
    /// [`FormulaError`] at the part whose units do not fit, or at the whole formula.
    pub fn expect_unit(&self, inputs: &[Unit], expected: Unit) -> Result<(), FormulaError> {
        unit_check::expect_unit(&self.tree, inputs, expected)
    }
}
