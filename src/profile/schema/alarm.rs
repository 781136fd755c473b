//! The keys of an alarm.

use std::time::Duration;

use crate::{
    plant::{
        def::{AlarmClass, Priority},
        keyword::keyword_enum,
        signal::Signal,
    },
    profile::reader::{At, Choice, toml_tables},
};

toml_tables! {
    /// An `[[alarm]]`.
    AlarmTable, "an alarm" {
        opt "tag" tag: String,
        opt "device" device: String,
        opt "high_high" high_high: f64,
        opt "high" high: f64,
        opt "low" low: f64,
        opt "low_low" low_low: f64,
        opt "deviation" deviation: f64,
        opt "from" from: String,
        opt "is" is: Choice,
        opt "bit" bit: u8,
        /// Tag's unit per minute, measured `over` a time; below 0 for a fall.
        opt "rate" rate: f64,
        opt "over" over: Duration,
        opt "no_change" no_change: Duration,
        opt "no_update" no_update: Duration,
        /// This many changes `within` a time.
        opt "changes" changes: u32,
        opt "within" within: Duration,
        opt "line" line: String,
        /// With `line`: it has too much to do, instead of not connected.
        opt "overloaded" overloaded: bool,
        /// Beside `device`: it takes longer for a response than its profile states.
        opt "slower_than_stated" slower_than_stated: bool,
        /// `F`, `C`, `S` or `M`.
        opt "ne107" ne107: Signal,
        opt "enabled_when" enabled_when: String,
        opt "class" class: AlarmClass,
        opt "area" area: String,
        opt "latch" latch: bool,
        opt "ack_comment" ack_comment: Requirement,
        opt "re_alarm" re_alarm: Duration,
        opt "deadband" deadband: f64,
        opt "on_delay" on_delay: Duration,
        opt "off_delay" off_delay: Duration,
        need "priority" priority: Priority,
        need "message" message: String,
        /// Which alarm it is, whatever its message, tag or condition become.
        opt "id" id: String,
        opt "cause" cause: String,
        opt "effect" effect: String,
        opt "action" action: String,
        opt "response_time" response_time: Duration,
    }
}

impl AlarmTable {
    /// The name of what it watches.
    pub fn subject(&self) -> Option<&At<String>> {
        self.tag.as_ref().or(self.device.as_ref()).or(self.line.as_ref())
    }
}

keyword_enum! {
    /// Whether something must be written.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub(crate) enum Requirement: "need for a comment" {
        /// It must.
        Required => "required",
        /// It may.
        Optional => "optional",
    }
}
