//! The integration tests: one binary, so that it links once. A new test belongs to one of these files:
//!
//! | file | what it holds |
//! |---|---|
//! | `architecture` | the laws: the line of modules, the io edge, sizes, style of tests, words |
//! | `archive` | closed hours as files: what `sightglass history` says of them, and what other engines read |
//! | `backup` | backups and restores by command, beside a station and on a full disk |
//! | `attach` | the station's socket: equal snapshots at both ends, stuck and hostile terminals, reconnecting |
//! | `commands` | the program as scripts see it: help, exit codes, messages, the headless demo and its report |
//! | `terminal` | the program as a person sees it, in a pseudo-terminal: starts, keys, leaves the terminal as it was |
//! | `peers` | our master against slaves that we did not write: pymodbus, libmodbus |
//! | `library` | every tag of every shipped profile against pymodbus as a master with a decoding of its own |
//! | `sunspec` | SunSpec devices of every model, by pysunspec2, against pysunspec2 as a reader |
//! | `masters` | our simulated slaves, and those of the benches, against masters that we did not write: mbpoll, pymodbus, minimalmodbus |
//! | `listen` | the line of a master and a slave that we did not write, heard over a tap: frames, values, capture; nothing is sent |
//! | `listening` | a station that only listens to such a line: its values, its refusals, a master that stops; nothing is sent |
//! | `listening_losses` | the lines of other masters in virtual time, with bytes and frames lost, flipped, merged, late: no wrong value is good |
//! | `mqtt` | data out to a broker that is stopped and killed, as the station is; TLS and passwords |
//! | `mqtt_requests` | requests from outside: written once, refused, repeated, before and after a kill |
//! | `capture` | saved traffic, opened by Wireshark's own reader |
//! | `shift` | a whole shift in virtual time, and its report read by an independent reader |
//! | `automatic_reports` | a station killed while it makes reports: each is there once, whole, and on record |
//! | `reports` | reports and exports as a user gets them: damaged history, suppressed alarms, a running station |
//! | `devices` | every shipped profile and plant against its simulated devices: a minute, every fault, golden frames |
//! | `rights` | every command, request and query through the socket, by everybody who may be at a terminal |
//! | `users` | wrong passwords, lockout, idle lock, second users, two operators at once |
//! | `kills` | stations killed during writes, acknowledgements, logins and reports: what was reported as done is in the audit log |
//! | `corpus` | bytes that fuzzing found worth keeping, read again by the functions that it calls |
//! | `crashes` | stations that end at any operation on the disk, by a kill or a loss of power, as seeds say |
//! | `outstanding` | stations killed and started again, with a slow device: a late reply to the old one is no value |
//! | `tampering` | the audit log changed by hand: what `sightglass audit verify` says |
//! | `hostile` | text of others, by every command: nothing of it acts on a terminal |
//! | `special_files` | pipes and devices where the station expects files, and secrets of its user: nothing waits, nothing is shown |
//! | `tools` | the tools for a line against peers that echo, chatter and lie |
//! | `odd_answers` | the same against odd answers, pasted bytes and a port that others have open; all functions of pymodbus |
//! | `logs` | logs of registers by `sightglass open`: killed, ended, shown again |
//! | `endings` | every way in which a terminal or its station can end, in a pseudo-terminal |
//! | `settings` | settings of a line: tried out, saved into the plant file; commands made before a reload |
//! | `exact` | counters of 64 bits from a slave to every screen, file and write: all digits; writes to all units of a line |
//! | `register_maps` | register maps of others by command: what becomes a profile, and what is said |
//! | `reload` | a plant file reloaded: what is as it was keeps its connections, values and curves |
//! | `durability` | killed, unplugged, locked, damaged |
//! | `guarded` | a station whose users must log in, for `rights` and `users` |
//! | `pty` | the program in a pseudo-terminal, for `terminal` and `endings` |
//! | `texts` | the catalogue of texts: it has each text that the program shows, and no other |
//! | `support` | what the others share: processes with deadlines, peers and their installation |
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]
#![allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

mod architecture;
mod archive;
mod automatic_reports;
mod sql;
mod attach;
mod backup;
mod capture;
mod commands;
mod corpus;
mod crashes;
mod devices;
mod durability;
mod endings;
mod enron;
mod exact;
mod formats;
mod guarded;
mod hostile;
mod kills;
mod library;
mod listen;
mod listening;
mod listening_losses;
mod logs;
mod masters;
mod mqtt;
mod mqtt_requests;
mod odd_answers;
mod one_device;
mod outstanding;
mod peers;
mod texts_written;
mod users;
mod pty;
mod register_maps;
mod reload;
mod reports;
mod rights;
mod settings;
mod shift;
mod special_files;
mod sunspec;
mod support;
mod tampering;
mod tasks;
mod terminal;
mod texts;
mod tools;
