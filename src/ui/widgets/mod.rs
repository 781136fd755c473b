//! Small drawings that tabs are made of.

pub(crate) mod actuator_mark;
pub(crate) mod axes;
pub(crate) mod chart;
pub(crate) mod line_trend;
pub(crate) mod list;
pub(crate) mod mimic;
pub(crate) mod rows;
pub(crate) mod spark;
pub(crate) mod text;
pub(crate) mod value;
