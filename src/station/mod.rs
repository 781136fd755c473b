//! The station: links, plant, history, wired together. Polls with or without terminals.
//!
//! There is exactly one awaited send (link → plant). Everything else is `try_send` or `watch`, so the plant task never
//! blocks. Shutdown runs downstream: the links stop, the plant ends when all senders are dropped, the history
//! thread drains, flushes and ends.
//!
//! A reload ends only what its plant file has otherwise. The task of a line that is as it was, with its devices and tags and
//! their ids, is left alone; the plant [goes on](crate::plant::Plant::redefine) under its new definition with the values, alarms
//! and totals of what is as it was; the history takes the definition in between two records.
//!
//! # When a resource fails
//!
//! Polling and alarms go on in every row, at the start as in the middle. Faults of history, disk, audit log, alarm-state
//! file, users file, clock and line tasks are alarms of the station: [`StationFault`](crate::plant::station_fault::StationFault).
//!
//! | resource | what happens | how it ends |
//! |---|---|---|
//! | history: disk full, read-only, locked, not there | records wait in a bounded buffer, samples are dropped first; its fill is shown | retried after 1, 2, 4, 8 s; then caught up |
//! | history: damaged at the start | set aside, never deleted; a new file is begun; lost commits are counted and dated | acknowledged |
//! | history: a block cannot be read later | the report names the span and leaves it out | acknowledged |
//! | history: removed or replaced | noticed at the next commit, a new file is begun | acknowledged |
//! | disk nearly full | alarm before the first failure | space is free again |
//! | audit log, alarm-state file | what is done is shown as "not recorded" | retried each second; then recorded |
//! | users file: damaged, missing | login is disabled; for a missing one only the station's own user makes the first Supervisor | restored, and the station reloaded |
//! | system clock: set | followed at once, recorded; ages, delays and shelvings do not move | acknowledged |
//! | memory, CPU: too many queries | three at a time, two of one terminal, 20 s each, on connections of their own; a full queue of samples is counted as lost | the queue empties |
//! | line: cable, port | its values become bad, the port is opened again with backoff; a line alarm | answers come |
//! | line: too much to do | process values are stretched alike, alarm inputs keep their period; the header says so | demand falls |
//! | folder of reports: full, missing; command after a report fails | the report is tried again after 5 s to 10 min, the command five times | it works again |
//! | the station is stopped, or killed, while a procedure is at work | stopped: its safe state is written first, within 10 s; killed: an alarm, and the procedure is shown as interrupted | an abort writes the safe state |
//! | a line's task panics | started again after 1, 2, 5 s; the other lines do not notice | acknowledged |

pub mod session;
mod durability;
mod entries;
mod audit_queue;
mod found;
mod session_acceptor;
mod past;
pub mod liveness;
mod sets;
mod plant_task;
pub mod companions;
mod supervisor;
pub mod event_log;
mod blocking_jobs;
mod session_server;
pub mod io;

#[cfg(test)]
mod tests;

pub use session::{Request, Session};
pub use session_acceptor::SessionAcceptor;
pub use session_server::LifecycleRequest;
