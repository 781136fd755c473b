//! sightglass: the control room of a small plant in a terminal.

pub mod plant;
pub mod bus;
pub mod report;
pub mod history;
pub mod station;
pub mod ui;
