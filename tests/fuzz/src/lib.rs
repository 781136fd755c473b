//! What others may send, type or put on the disk, each read by a function that is given any bytes at all: it must end, soon and
//! without a panic, and keep the promises that it states. `cargo fuzz` looks for bytes that break one of them; the tests replay
//! those that it found worth keeping. See README.md.

pub mod alarms;
pub mod ascii;
pub mod audit;
pub mod common;
pub mod decode;
pub mod device;
pub mod expression;
pub mod import;
pub mod listen;
pub mod mimic;
pub mod mqtt;
pub mod parameter_set;
pub mod plant;
pub mod register_list;
pub mod socket;
pub mod typed;

/// What reads bytes.
pub type Target = fn(&[u8]);

/// Every target, by the name of its corpus.
pub const TARGETS: &[(&str, Target)] = &[
    ("alarms", alarms::run),
    ("ascii", ascii::run),
    ("audit", audit::run),
    ("decode", decode::run),
    ("device", device::run),
    ("expression", expression::run),
    ("import", import::run),
    ("listen", listen::run),
    ("mimic", mimic::run),
    ("mqtt", mqtt::run),
    ("parameter_set", parameter_set::run),
    ("plant", plant::run),
    ("register_list", register_list::run),
    ("socket", socket::run),
    ("typed", typed::run),
];
