//! **sightglass**: the control room of a small plant in a terminal.
//!
//! A plant has Modbus controllers on an RS-485 line or on TCP. sightglass polls them, evaluates alarms, keeps everything
//! in DuckDB, draws the process as a live mimic, sets controllers with verified writes and writes shift reports.
//! It never shows a wrong value as a right one.
//!
//! # One binary, five ways to run it
//!
//! | command | what runs |
//! |---|---|
//! | `sightglass run PLANT` | the **station**: polls, alarms, history, a socket. No terminal: what an init system starts on a panel PC |
//! | `sightglass` | a **terminal** attached to the running station; any number at once |
//! | `sightglass PLANT` | station and terminal in one process, or a terminal at the station of that plant |
//! | `sightglass demo` | a simulated plant on real pseudo-terminals and sockets, station and terminal in one process |
//! | `sightglass open PORT` | a **bench**: station without history and terminal in one process, on one device without a plant file |
//!
//! `sightglass drill` is the sixth, without a terminal: station and simulated plant in virtual time, judged by a scenario.
//!
//! # How data flows
//!
//! ```text
//!  profiles/*.toml ──> profile::load ──> Arc<PlantDef>       immutable, given to everyone at start
//!
//!   device <──> link task                 one per serial line / TCP endpoint, owns the port
//!                  │   ▲
//!    Event         │   │ BusRequest         mpsc, try_send: full = the command is refused, visibly
//!    mpsc          │   │
//!    send().await  ▼   │
//!               plant task                sole owner of Plant; the only writer of facts
//!                  │   │   ▲
//!                  │   │   │ Command         mpsc, try_send: full = refused, visibly
//!    Record        │   │   └────────────────────┐
//!    mpsc,         │   │ watch<Arc<Snapshot>>   │
//!    loss counted  ▼   ▼   latest only          │
//! audit ──> history     session server ──── Session      one per terminal: channels, or the
//!  thread   thread  <─── Query / Answer        │          socket of `attach`
//!  (chain)  DuckDB       AccessControl      terminal (ui)
//! ```
//!
//! Every request of a terminal goes through the **session server**, the task around [`access::AccessControl`], which
//! alone decides what is permitted. What it refuses goes on to the plant as a refused command, so that it is seen and on
//! record like any other; only a command above the rate limit, of another run or with a used number does not reach the plant,
//! and only its terminal shows it. Actions are in the audit log and alarms in their state file, on disk, before a snapshot shows an
//! outcome as recorded; the history follows within a second.
//! Queries go to the history; one that reads registers goes to the line, which answers it between polls.
//! The history thread only writes; a second one answers queries, each on a connection of its own and for a bounded time.
//! Closed hours leave the database for an [archive](history::io::archive) of Parquet files, with minutes and hours as
//! aggregates; a query is cut into [pieces](history::tiers::pieces), each answered by the widest of these that has it.
//! A report becomes a [document](report::document) of sections once, in one language; each format only sets it.
//! What goes out to a broker comes from the history too, so that an [outage](north) loses nothing.
//! What is deleted when is a [decision](history::retention) over the list of files. A [past](plant::past) instant becomes a
//! snapshot like a live one; SQL of others is answered by an [engine of its own](history::io::tables), never by the station.
//!
//! The plant task never waits to send: links wait for it, everything else that it sends is `try_send` or `watch`. So it
//! never blocks, and no deadlock is possible by design. Shutdown runs downstream: the links stop, the plant ends
//! because no sender is left, the history thread drains, flushes and ends.
//!
//! # Laws
//!
//! 1. **One owner per fact.** The plant task owns what is true, each link task its port, the history thread the database
//!    file, the terminal only what its operator looks at.
//! 2. **One way.** device → [`bus`] → [`plant`] → snapshot → ([`history`], terminals). Back only as commands, whose
//!    outcome comes back inside a later snapshot.
//! 3. **Three pure reducers**: [`plant::Plant`] for facts, [`access::AccessControl`] for users and sessions, [`ui::update`] for the view.
//!    What is asynchronous is a thin loop around one of them; only a [link task](bus::io::task) is more than that, because
//!    on a line the time between two bytes has a meaning. What it decides is pure again: [`bus::schedule`],
//!    [`bus::late_reply`], [`bus::diagnostics`].
//! 4. **The outside world is in `io`.** Only `io` files, the station and the command line may name tokio, DuckDB,
//!    files, sockets, the terminal (but for its key events) or a clock. Time is an argument everywhere else.
//! 5. **A value never travels alone**: [`plant::sample::Sample`] is value, quality and time, on screen, in alarms, in the
//!    history and in exports; a figure of a report has its share of good time. Never a silent last value, never 0 for "no answer".
//!    The old value of a command and the value that raised an alarm are alone: they are as old as their command or alarm.
//! 6. **A write is never retried by itself, and is read back** unless nothing can be read: a write-only tag, a broadcast.
//!    Its outcome is a state in the snapshot.
//! 7. Every queue, list, wait and retry has a bound, and an overflow that an operator can see.
//! 8. UTC is stored, samples in whole milliseconds, events in microseconds; local time is a matter of display and of reports.
//!
//! # Glossary
//!
//! | word | meaning here |
//! |---|---|
//! | plant, line, device, unit | what one plant file describes; a serial port or TCP endpoint; a controller or meter on it; its Modbus address |
//! | tag, block | one value of a device by name; registers that one request reads |
//! | sample, quality | value with quality and time; good, uncertain or bad (OPC UA) |
//! | snapshot | everything that is true now, immutable, for terminals and the history |
//! | listening line, no traffic | one that another master polls: heard, never sent to; no frame is heard on it |
//! | bench, live read | one device without tags, for `open`; a read of its registers beside the polls |
//! | hole | an address that a device does not have, found by a live read, a sweep or a refused block |
//! | replay, present | a past instant that the tabs show; what is true now, while they do |
//! | hold | how long a stored value counts without a successor |
//! | source frame | the request and response that a sample was decoded from |
//! | command | what an operator asks of the plant, with a status from pending to verified, unchanged, refused, failed or not confirmed |
//! | session request | what a user asks beside commands and queries: log in, log out, lock, change users, export, back up, import, reload, stop |
//! | expected value | what a write must still find, because its operator saw it |
//! | condition, alarm, alarm event | what is evaluated; its state (ISA-18.2); a transition that the journal keeps |
//! | suppressed | shelved, suppressed by design, or out of service |
//! | first-out group | alarms raised within a window, shown under the first |
//! | interlock, actuator | what must hold before a command; what a command moves, with its feedback |
//! | mimic, faceplate, pen, trend | the picture of the process; a controller's values; a curve; its chart |
//! | SV, PV, MV | setpoint, measured value and output, as the controllers print them |
//! | poll class | critical, normal or background: which polls an overloaded line skips last |
//! | backoff | a device that does not answer is asked at growing intervals |
//! | outstanding reply, in sync | a response that may still come after its timeout; it is never taken for another |
//! | gap registers | registers read only because they lie between two tags of a block |
//! | audit log, chain hash, seal | who did what; links its entries; signs it with a key that is then replaced |
//! | automatic report | a report that the station makes at the end of each shift, day, week or month; on record in the history |
//! | data out, cursor | values for other systems, over MQTT; the instant before which the broker has acknowledged everything |
//! | request from outside | a write that another system asks for over MQTT, as a user of the plant file |
//! | epoch | counts the steps of the clock, so that records of a doubled time can be distinguished |
//! | batch, phase | what the plant makes between two conditions of its file; a value of its phase tag |
//! | control run | what a control loop did after a change of its setpoint, a program step or the start of a batch |
//! | procedure, safe state | steps of the plant file that the station carries out on request; what it writes when one fails or is aborted |
//! | total | what an expression adds up to: an integral, hours, starts |
//! | aggregate | mean, least and greatest of a period, from samples that hold until the next |
//! | tier, archive, manifest | samples, minutes or hours; the files of closed hours; the table that names these |
//! | fault, injected fault | why a request or the station failed; what a trainer puts into the simulated plant |
//! | scenario, drill | a scripted plant for tests; one that evaluates an operator |
//!
//! # Recipes
//!
//! | to add | touch |
//! |---|---|
//! | a device, a plant, a scenario | one TOML file under `profiles` |
//! | a form of register maps | its file in `register_map/format`, its rows in `register_map/mod.rs` and `format/foreign.rs` |
//! | a data type | its variant and rows in `plant/data_type.rs` |
//! | an alarm condition | `plant/alarm/condition.rs`, its keys in `profile/condition.rs`, one scenario |
//! | a symbol of the mimic | its kind in `profile/picture/symbol.rs`, its item in `plant/mimic_def.rs`, its drawing in `ui/widgets/mimic` |
//! | a theme | a column of the table in `ui/theme/palette.rs` |
//! | a report format | its file in `report`, its row in `report/mod.rs`, its name in `plant/report.rs` |
//! | a tab | its file in `ui/tabs`, its rows in `ui/tab.rs` and `ui/tabs/mod.rs` |
//! | a page with a list | a `Listing` in its file in `ui/tabs`, its rows in `list` and `list_mut` of the tab: see CONTRIBUTING.md |
//! | a window with fields | a `Form` of `ui/modal/form.rs` in its window, whose fields say what may be typed or chosen |
//! | what every list can | `ui/tabs/listing`; its key a row in `ui/tabs/listing/keys.rs` |
//! | a key of a tab | its row in the tab's table of keys, with the function that it calls; footer, help, palette and clash check read the row |
//! | a renamed TOML key | its row in `profile/renamed.rs` |
//! | a column of the history | one numbered migration |
//! | a language | a copy of `text/en.toml` with other values, its row in `text.rs` |
//!
//! # Modules, in reading order
//!
//! They form a line, not a graph: a module uses only what stands above it, and so does each room of it, in the order of its
//! `mod.rs`. A test holds this and law 4. They are private, so that the compiler finds what nothing uses: the program calls
//! [`main`], and tests, benches and fuzz targets use what the last one, [`api`], lists.

#![cfg_attr(test, allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_sign_loss))]

mod text;
mod plant;
mod profile;
mod bus;
mod register_map;
mod sim;
mod report;
mod history;
mod access;
mod north;
mod station;
mod attach;
mod ui;
mod cli;
pub mod api;

pub use cli::main;
