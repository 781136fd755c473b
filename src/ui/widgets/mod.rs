//! Small drawings that tabs are made of.

pub mod chart;
pub mod line_trend;
pub mod list;
pub mod mimic;
pub mod spark;
pub mod text;
pub mod value;
