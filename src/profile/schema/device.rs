//! Every table and key of a device profile.

use std::time::Duration;

use super::keys::{Choices, CounterKey, PollKey, Roles, WriteRole};
use crate::{
    plant::{
        def::Reauthentication,
        exact::Exact,
        keyword::keyword_enum,
        output::Output,
        tag::{Access, ByteOrder, Confidence, PollClass, StorePolicy, Table},
    },
    profile::{
        address::{Location, Modicon, Scheme},
        raw_pattern::{BadIf, RawPattern},
        reader::{Choice, Numbered, Raw, toml_tables},
        type_name::TypeName,
    },
};

toml_tables! {
    /// A device profile.
    ProfileFile, "the device profile" {
        need "vendor" vendor: String,
        need "model" model: String,
        opt "revision" revision: String,
        /// How well the map is known: `verified`, `manual` or `partial`.
        need "status" status: Status,
        need "source" source: String,
        opt "notes" notes: String,
        /// Always 0.
        opt "address_base" address_base: u8,
        opt "scheme" scheme: Scheme,
        /// The function codes that the device knows.
        list "functions" functions: u8,
        opt "limits" limits: Raw,
        /// Keys that every tag has unless it says otherwise.
        opt "default" default: Raw,
        /// The least role that may write the tags of a group.
        opt "roles" roles: Roles,
        /// Names of the eight states that function 07 reads.
        opt "exception_status" exception_status: Numbered,
        /// What its output is at the terminals.
        opt "output" output: Output,
        list "tag" tags: Raw,
        /// Tags that it has many times.
        list "repeat" repeats: RepeatTable,
        /// What each such device has alarms for.
        list "alarm" alarms: Raw,
        list "action" actions: ActionTable,
        opt "faceplate" faceplate: FaceplateTable,
        opt "program" program: ProgramTable,
        opt "signature" signature: SignatureTable,
        /// Its texts in other languages.
        opt "texts" texts: Raw,
    }

    /// A `[[repeat]]` of a profile, or a `[[device.repeat]]` of a plant file.
    RepeatTable, "a repeat" {
        opt "count" count: u16,
        list "names" names: String,
        /// The tag that says how many of them the device has.
        opt "count_from" count_from: String,
        /// From the address of one to that of the next.
        opt "step" step: u16,
        list "tag" tags: Raw,
    }

    /// By what a device is recognised.
    SignatureTable, "the signature" {
        list "probe" probes: ProbeTable,
    }

    /// What the raw number of a tag must be.
    ProbeTable, "a probe" {
        need "tag" tag: String,
        list "is" is: RawPattern,
        opt "range" range: [f64; 2],
        /// The first of 16 coils or discrete inputs that the word holds once more.
        opt "bits" bits: String,
    }

    /// What one request may hold.
    LimitsTable, "limits" {
        opt "read_registers_max" read_registers_max: u16,
        opt "read_bits_max" read_bits_max: u16,
        opt "write_registers_max" write_registers_max: u16,
        opt "gap_registers_max" gap_registers_max: u16,
        opt "alignment" alignment: u16,
        opt "in_flight_max" in_flight_max: u16,
        opt "request_gap_ms" request_gap_ms: u16,
        opt "write_gap_ms" write_gap_ms: u16,
        /// The longest that the device itself takes for a response: part of the worst case of its polls.
        opt "response_time_ms" response_time_ms: u16,
        /// Most devices on its line, as its manual says.
        opt "units_max" units_max: u16,
        opt "coil" coil: Raw,
        opt "discrete" discrete: Raw,
        opt "input" input: Raw,
        opt "holding" holding: Raw,
    }

    /// What reads of one table may hold.
    TableLimitsTable, "limits of a table" {
        opt "read_max" read_max: u16,
        opt "gap_max" gap_max: u16,
        opt "alignment" alignment: u16,
    }

    /// A `[[tag]]` of a profile, or a `[[device.tag]]` of a plant file.
    TagTable, "a tag" {
        need "name" name: String,
        opt "label" label: String,
        opt "meaning" meaning: String,
        opt "table" table: Table,
        opt "address" address: Location,
        opt "modicon" modicon: Modicon,
        opt "type" kind: TypeName,
        opt "order" order: ByteOrder,
        opt "field" field: Choice,
        /// What it is calculated from, instead of `address`.
        opt "expr" expr: String,
        opt "scale" scale: f64,
        opt "offset" offset: f64,
        opt "decimals" decimals: u8,
        opt "decimals_from" decimals_from: String,
        /// A tag that holds the power of ten by which it is multiplied.
        opt "scale_from" scale_from: String,
        opt "unit" unit: String,
        opt "unit_from" unit_from: String,
        opt "min" min: Exact,
        opt "max" max: Exact,
        opt "min_from" min_from: String,
        opt "max_from" max_from: String,
        /// Where the value usually lies.
        opt "normal" normal: [f64; 2],
        opt "access" access: Access,
        opt "verify" verify: bool,
        opt "confirm" confirm: String,
        /// What must be given again to write it.
        opt "reauthenticate" reauthenticate: Reauthentication,
        /// The least role that may write it; without it that of its group in `roles`.
        opt "role" role: WriteRole,
        opt "enum" enum_labels: Numbered,
        opt "bits" bits: Numbered,
        opt "bad_if" bad_if: BadIf,
        opt "quality_from" quality_from: String,
        opt "quality_mask" quality_mask: u64,
        /// What must hold for the device to have it.
        opt "when" when: String,
        opt "write_fc" write_fc: u8,
        /// Where it is written, if not where it is read.
        opt "write_address" write_address: Location,
        /// How a part of a register is written.
        opt "write" write: WriteWord,
        opt "write_unlock" write_unlock: UnlockTable,
        opt "group" group: String,
        opt "poll" poll: PollKey,
        opt "poll_class" poll_class: PollClass,
        opt "deadband" deadband: f64,
        opt "store" store: StorePolicy,
        opt "store_every" store_every: Duration,
        /// Counts up, or not: by its unit if this is not said.
        opt "counter" counter: CounterKey,
        /// The most that it counts in an hour.
        opt "max_rate" max_rate: f64,
        /// A report gives how long and how often it was on.
        opt "hours" hours: bool,
        opt "confidence" confidence: Confidence,
        opt "source" source: String,
        opt "simulate" simulate: SimulateTable,
        /// What the maker delivers it with.
        opt "default" default: Choice,
        /// Part of parameter sets, or not.
        opt "set" in_sets: bool,
    }

    /// How a counter counts.
    CounterTable, "counter" {
        need "modulus" modulus: f64,
    }

    /// How a simulated device fills a tag.
    SimulateTable, "simulate" {
        opt "start" start: Choice,
        list "case" cases: CaseTable,
        opt "range" range: [f64; 2],
        opt "noise" noise: f64,
        opt "pulse" pulse: Duration,
        opt "oscillate" oscillate: [f64; 2],
        opt "period" period: Duration,
        opt "follow" follow: String,
        list "sum" sum: String,
        list "mean" mean: String,
        list "product" product: String,
        list "difference" difference: String,
        list "quotient" quotient: String,
        list "reactive" reactive: String,
        opt "angle" angle: String,
        opt "integrate" integrate: String,
        opt "time_base" time_base: Duration,
        opt "rate" rate: f64,
        opt "lag" lag: Duration,
        opt "gain" gain: f64,
        opt "offset" offset: f64,
        opt "when" when: CheckTable,
        opt "idle" idle: f64,
    }

    /// A condition on another tag; without `is`, `above` and `below`: is it not 0?
    CheckTable, "when" {
        need "tag" tag: String,
        opt "field" field: Choice,
        opt "is" is: Choices,
        opt "above" above: f64,
        opt "below" below: f64,
        list "and" and: CheckTable,
    }

    /// A value for when something is so.
    CaseTable, "a case" {
        need "when" when: CheckTable,
        need "value" value: Choice,
    }

    /// What must be written before a tag takes a write.
    UnlockTable, "write_unlock" {
        need "tag" tag: String,
        need "value" value: Choice,
    }

    /// An `[[action]]` of a profile.
    ActionTable, "an action" {
        need "name" name: String,
        need "tag" tag: String,
        need "value" value: Choice,
        opt "settle_ms" settle_ms: u32,
        opt "stop" stop: bool,
        need "confirm" confirm: String,
        opt "saves" saves: bool,
        opt "role" role: WriteRole,
    }

    /// Which tags a controller is operated by.
    FaceplateTable, "the faceplate" {
        need "pv" pv: String,
        need "sv" sv: String,
        /// The setpoint in use, where a program or a ramp may move it.
        opt "sv_used" sv_used: String,
        opt "mv" mv: String,
        opt "run" run: String,
        opt "mode" mode: String,
        opt "tune" tune: String,
        list "tunes" tunes: String,
    }

    /// The ramp/soak program of a controller.
    ProgramTable, "the program" {
        need "position" position: String,
        need "command" command: String,
        need "run" run: Choice,
        opt "halt" halt: Choice,
        need "off" off: Choice,
        opt "pattern" pattern: String,
        /// First and last step of each pattern, from 1, in the order of the pattern's values.
        list "patterns" patterns: [u16; 2],
        opt "mode" mode: String,
        list "steps" steps: StepTable,
    }

    /// A step of a program.
    StepTable, "a step of the program" {
        need "sv" sv: String,
        need "ramp" ramp: String,
        need "soak" soak: String,
    }
}

keyword_enum! {
    /// How well a register map is known.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub(crate) enum Status: "status" {
        /// Tried on the device.
        Verified => "verified",
        /// Taken from the maker's manual.
        Manual => "manual",
        /// Parts are known.
        Partial => "partial",
    }
}
keyword_enum! {
    /// How a field of bits, or one byte of a register, is written.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub(crate) enum WriteWord: "way to write" {
        /// Read, set and written back.
        ReadModifyWrite => "rmw",
    }
}
keyword_enum! {
    /// How often a tag is read; the device says what fast and slow are.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub(crate) enum PollWord: "poll" {
        Fast => "fast",
        Slow => "slow",
        Once => "once",
        Never => "never",
    }
}
