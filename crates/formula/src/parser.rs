//! Text to syntax tree, by recursive descent.
//!
//! Precedence from low to high: comparison, sum, product, sign, power. `-x^2` is `-(x^2)` and `2^3^2` is `2^(3^2)`.

use crate::formula_error::FormulaError;
use crate::function::{FUNCTIONS, Function};
use crate::syntax_tree::{Node, NodeKind};
use crate::token::{Token, TokenKind, tokenize};
use alloc::string::String;
use alloc::vec::Vec;
use alloc::{format, vec};

/// Longest text in bytes.
const MAX_LENGTH: usize = 1000;
/// Deepest nesting.
const MAX_DEPTH: usize = 60;

struct Parser<'a> {
    tokens: Vec<Token<'a>>,
    next: usize,
    depth: usize,
    inputs: &'a [&'a str],
    end: usize,
}

/// The syntax tree of a formula.
pub(crate) fn parse(text: &str, inputs: &[&str]) -> Result<Node, FormulaError> {
    if text.len() > MAX_LENGTH {
        let what = format!("a formula has at most {MAX_LENGTH} characters; this one has {}", text.len());
        return Err(FormulaError::new((0, 0), what));
    }
    let mut parser = Parser { tokens: tokenize(text)?, next: 0, depth: 0, inputs, end: text.len() };
    let tree = parser.comparison()?;
    match parser.peek() {
        None => Ok(tree),
        Some(Token { place, kind: TokenKind::Symbol(b')') }) => {
            Err(FormulaError::new(place, "this bracket was never opened"))
        }
        Some(token) => {
            Err(FormulaError::new(token.place, "an operator is missing before this, for example `*`"))
        }
    }
}

impl Parser<'_> {
    fn peek(&self) -> Option<Token<'_>> {
        self.tokens.get(self.next).copied()
    }

    /// Consumes one of these symbols if it comes next.
    fn take(&mut self, symbols: &[u8]) -> Option<u8> {
        match self.peek()?.kind {
            TokenKind::Symbol(symbol) if symbols.contains(&symbol) => {
                self.next += 1;
                Some(symbol)
            }
            _ => None,
        }
    }

    fn comparison(&mut self) -> Result<Node, FormulaError> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            let place = self.peek().map_or((self.end, self.end), |t| t.place);
            return Err(FormulaError::new(place, format!("brackets are nested more than {MAX_DEPTH} deep")));
        }
        let mut left = self.sum()?;
        if let Some(symbol) = self.take(b"<>") {
            let right = self.sum()?;
            left = call(if symbol == b'<' { Function::Less } else { Function::Greater }, vec![left, right]);
        }
        self.depth -= 1;
        Ok(left)
    }

    fn sum(&mut self) -> Result<Node, FormulaError> {
        let mut left = self.product()?;
        while let Some(symbol) = self.take(b"+-") {
            let right = self.product()?;
            left = call(if symbol == b'+' { Function::Add } else { Function::Subtract }, vec![left, right]);
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Node, FormulaError> {
        let mut left = self.signed()?;
        while let Some(symbol) = self.take(b"*/") {
            let right = self.signed()?;
            left =
                call(if symbol == b'*' { Function::Multiply } else { Function::Divide }, vec![left, right]);
        }
        Ok(left)
    }

    fn signed(&mut self) -> Result<Node, FormulaError> {
        let mut negative = None;
        while let Some(token) = self.peek() {
            let TokenKind::Symbol(symbol @ (b'+' | b'-')) = token.kind else { break };
            let start = token.place.0;
            self.next += 1;
            let first = negative.map_or(start, |(first, _)| first);
            negative = Some((first, negative.is_some_and(|(_, n)| n) != (symbol == b'-')));
        }
        let mut out = self.power()?;
        if let Some((start, true)) = negative {
            out = call(Function::Negate, vec![out]);
            out.place.0 = start;
        }
        Ok(out)
    }

    fn power(&mut self) -> Result<Node, FormulaError> {
        let base = self.primary()?;
        if self.take(b"^").is_none() {
            return Ok(base);
        }
        // Right to left, by recursion of limited depth.
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(FormulaError::new(base.place, format!("more than {MAX_DEPTH} powers of powers")));
        }
        let exponent = self.signed()?;
        self.depth -= 1;
        Ok(call(Function::Power, vec![base, exponent]))
    }

    fn primary(&mut self) -> Result<Node, FormulaError> {
        let Some(token) = self.peek() else {
            let place = (self.end, self.end);
            return Err(FormulaError::new(place, "the formula ends where a value is expected"));
        };
        let place = token.place;
        match token.kind {
            TokenKind::Number(x) => {
                self.next += 1;
                Ok(Node { place, kind: NodeKind::Number(x) })
            }
            TokenKind::Symbol(b'(') => {
                self.next += 1;
                let mut inner = self.comparison()?;
                let end = self.close(place)?;
                inner.place = (place.0, end);
                Ok(inner)
            }
            TokenKind::Symbol(symbol) => {
                let what = format!("a value is expected here, not `{}`", char::from(symbol));
                Err(FormulaError::new(place, what))
            }
            TokenKind::Name(name) => {
                let found = FUNCTIONS.iter().find(|(known, _)| *known == name).map(|(_, function)| *function);
                let input = self.inputs.iter().position(|known| *known == name);
                let unknown = unknown_name(name, self.inputs);
                let name: String = name.into();
                self.next += 1;
                if let Some(index) = input {
                    return Ok(Node { place, kind: NodeKind::Input(index) });
                }
                match found {
                    Some(function) => self.arguments(&name, function, place),
                    None if name == "pi" => Ok(Node { place, kind: NodeKind::Number(core::f64::consts::PI) }),
                    None => Err(FormulaError::new(place, unknown)),
                }
            }
        }
    }

    fn arguments(
        &mut self,
        name: &str,
        function: Function,
        place: (usize, usize),
    ) -> Result<Node, FormulaError> {
        let opening = self.peek().map_or(place, |t| t.place);
        if self.take(b"(").is_none() {
            return Err(FormulaError::new(place, format!("`{name}` is a function; write `{name}(...)`")));
        }
        let mut arguments = vec![self.comparison()?];
        while self.take(b",").is_some() {
            arguments.push(self.comparison()?);
        }
        let end = self.close(opening)?;
        let place = (place.0, end);
        let expected = function.arguments();
        if arguments.len() != expected {
            let found = arguments.len();
            let what = format!(
                "`{name}` takes {expected} argument{}, not {found}",
                if expected == 1 { "" } else { "s" }
            );
            return Err(FormulaError::new(place, what));
        }
        Ok(Node { place, kind: NodeKind::Call(function, arguments) })
    }

    /// The closing bracket of the one at `opening`; returns the byte behind it.
    fn close(&mut self, opening: (usize, usize)) -> Result<usize, FormulaError> {
        match self.peek() {
            Some(Token { place, kind: TokenKind::Symbol(b')') }) => {
                let end = place.1;
                self.next += 1;
                Ok(end)
            }
            Some(token) if token.kind == TokenKind::Symbol(b',') => Err(FormulaError::new(
                token.place,
                "a comma is allowed only between the arguments of a function",
            )),
            Some(token) => Err(FormulaError::new(
                token.place,
                "an operator is missing before this, for example `*`, or the bracket before it was not closed",
            )),
            None => Err(FormulaError::new(opening, "this bracket is never closed")),
        }
    }
}

/// A call whose place spans its arguments.
fn call(function: Function, arguments: Vec<Node>) -> Node {
    let start = arguments.iter().map(|a| a.place.0).min().unwrap_or(0);
    let end = arguments.iter().map(|a| a.place.1).max().unwrap_or(0);
    Node { place: (start, end), kind: NodeKind::Call(function, arguments) }
}

fn unknown_name(name: &str, inputs: &[&str]) -> String {
    let inputs = inputs.join(", ");
    let functions: Vec<&str> = FUNCTIONS.iter().map(|(known, _)| *known).collect();
    format!("`{name}` is not known; known are {inputs}, pi, and the functions {}", functions.join(", "))
}
