//! What is true. No I/O, no clock: events and time come in as arguments, effects go out as values.
//!
//! ```text
//! Event ───┐                       ┌──> Effects { bus requests, records }
//! Command ─┼──> Plant (reducer) ───┤
//! tick  ───┘    image alarms       └──> Snapshot
//!               values alarms commands
//! ```

pub(crate) mod number;
pub mod exact;
pub(crate) mod time;
pub(crate) mod keyword;
pub mod visible;
pub mod history_def;
pub mod mqtt_request;
pub mod id;
pub mod north_def;
pub mod role;
pub mod request_refusal;
pub mod sample;
pub(crate) mod expr;
pub mod line;
pub(crate) mod line_check;
pub(crate) mod program;
pub mod traffic;
pub(crate) mod data_type;
pub(crate) mod decimals;
pub(crate) mod half;
pub(crate) mod mimic_def;
pub mod report;
pub(crate) mod report_def;
pub(crate) mod simulate;
pub mod bound;
pub(crate) mod confidence;
pub(crate) mod store_policy;
pub mod tag;
pub mod line_finding;
pub mod address;
pub mod raw_number;
pub mod alarm;
pub(crate) mod poll_class;
pub(crate) mod scale;
pub mod output;
pub mod batch;
pub mod def;
pub(crate) mod admission;
pub mod port_signals;
pub mod process_load;
pub mod station;
pub mod event;
pub mod line_trouble;
pub mod request_stats;
pub mod device_time;
pub(crate) mod ne107;
pub mod line_report;
pub(crate) mod line_minute;
pub mod live;
pub mod command;
pub(crate) mod energy;
pub mod control_run;
pub mod record;
pub mod procedure;
pub(crate) mod interlock;
pub mod parameter_set;
pub(crate) mod step_response;
pub(crate) mod tuning;
pub mod restore;
pub(crate) mod place;
pub mod sweep;
pub mod diagnostics;
pub mod snapshot;
pub mod entry;
pub mod losses;
pub(crate) mod totalizer;
pub(crate) mod delay;
pub(crate) mod clock_step;
pub(crate) mod heard;
pub(crate) mod redefinition;
pub(crate) mod calculation;
pub(crate) mod process_image;
pub mod counter;
pub(crate) mod commands;
pub(crate) mod reducer;
pub mod past;

#[cfg(test)]
pub mod fixture;

pub use def::PlantDef;
pub use reducer::{Effects, Plant, Redefined, SetWork};
pub use snapshot::Snapshot;
