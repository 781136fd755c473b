//! Rows that are calculated from registers of others.

use crate::register_map::named::Named;

/// A row without a register of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Calculated {
    /// Its name, unit, decimals, group and line; the rest means nothing.
    pub named: Named,
    /// What it is calculated from, in order.
    pub pieces: Vec<Piece>,
}

/// A part of an expression.
#[derive(Debug, Clone, PartialEq)]
pub enum Piece {
    /// As it stands in a profile.
    Text(&'static str),
    /// The value of a register, which has a row of its own or not.
    Of(Box<Named>),
}
