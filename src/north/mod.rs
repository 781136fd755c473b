//! Data out: the values of the plant on the topics of an MQTT broker.
//!
//! Two streams, which need nothing of each other:
//!
//! ```text
//!   snapshot ──> deadband ──> TOPIC/DEVICE            retained: what holds now, of all tags of a device
//!   history ───> forwarder ─> TOPIC/DEVICE/samples    every stored sample, in order of time, at least once
//!                    └────── cursor file              written when the broker has acknowledged
//! ```
//!
//! Only where the plant file names a user for it, a third one comes in:
//!
//! ```text
//!   TOPIC/DEVICE/request ──> list on disk ──> command of that user ──> outcome ──> TOPIC/DEVICE/response
//! ```
//!
//! The state is for those who look, the samples are for those who store. A sample goes from the history, never from memory: an
//! outage of any length, of the broker, the network or the station, delays it and loses nothing.

pub mod deadband;
pub mod forwarder;
pub(crate) mod refusals;
pub mod request;
pub mod payload;
pub(crate) mod request_log;
pub mod io;
pub(crate) mod requests;
