//! How it is read and written: frames, codecs, blocks, the schedule; bytes move only in [`io`].
//!
//! ```text
//!   tags ──> plan ──> schedule ──> task ──> link ──> wire ──> port        asked
//!            blocks   whose turn   polls    one      silences,
//!            (gaps)   (classes)    writes   request  every byte on record
//!                                  tests    (replies)
//!   values <── codec <── task <── framing <─ ascii, frame <── port        answered
//! ```
//!
//! | module | what is decided there |
//! |---|---|
//! | [`frame`], [`ascii`], [`framing`], `cut` | where a frame begins and ends, whether its check fits, whether it answers what was asked |
//! | [`late_reply`] | which replies are outstanding, and what may be asked meanwhile |
//! | `pdu` | the fields of every function |
//! | [`codec`], [`interpret`] | words to numbers and back; everything that words may mean |
//! | [`plan`], [`admission`], [`schedule`], [`backoff`] | what is read together, whether it can all be in time, what is read next |
//! | [`hangup`], [`in_flight`], [`request_gap`], [`other_master`] | what ended a connection; how much a unit takes at once, and how soon; who else asks |
//! | [`identification`] | when a device is asked what it is, for the conditions of its profile |
//! | [`line_stats`] | what is counted |
//! | [`diagnostics`], [`live`], [`recognise`], `sunspec` | the steps of a diagnostic, of a live read and of a walk over models; which device it looks like |
//! | [`dissect`], [`names`], [`source_frame`] | the fields of a frame and their meaning |
//! | [`meaning`] | what a request means for the tags of the plant |
//! | [`listen`] | who says what on the line of another master |
//! | [`hex_input`], [`request_lint`], [`filter`], [`capture`] | what a technician types, looks for and takes home |

pub mod names;
pub(crate) mod pdu;
pub mod ascii;
pub mod frame;
pub mod framing;
pub mod wide_addresses;
mod frame_boundaries;
pub mod request_lint;
pub mod dissect;
pub mod hex_input;
pub mod filter;
pub mod capture;
pub mod codec;
pub mod source_frame;
pub mod interpret;
pub mod meaning;
pub mod plan;
pub mod backoff;
pub mod schedule;
pub mod admission;
pub mod late_reply;
pub mod hangup;
pub mod in_flight;
pub mod request_gap;
pub mod other_master;
pub mod diagnostics;
pub mod identification;
pub mod live;
pub mod recognise;
pub(crate) mod sunspec;
pub mod line_stats;
pub mod listen;
pub mod io;
