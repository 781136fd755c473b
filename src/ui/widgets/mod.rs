//! Small drawings that tabs are made of.

pub mod mimic;
pub mod text;
pub mod value;
