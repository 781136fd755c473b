//! Each fault in one row: its usual number, its name, its target, its texts, and the numbers that it can have.

use std::{mem::discriminant, time::Duration};

use super::syntax::{InjectedFault, PanelSwitch, Parameter, Position, TargetKind, Valve};

/// What is known of a fault.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    /// With its usual number.
    pub fault: InjectedFault,
    /// Its name, without its number.
    pub word: &'static str,
    pub target_kind: TargetKind,
    /// Its cause in the field.
    pub cause: &'static str,
    /// What an operator can see of it, and what not.
    pub symptoms: &'static str,
    /// What a good operator does.
    pub action: &'static str,
    /// What its number can be, if it has one.
    pub parameter: Option<Parameter>,
}

impl Row {
    const fn with_number(self, unit: &'static str, min: f64, max: f64, steps: &'static [f64]) -> Row {
        Row { parameter: Some(Parameter { unit, min, max, steps }), ..self }
    }
}

const fn row(
    fault: InjectedFault,
    word: &'static str,
    target_kind: TargetKind,
    cause: &'static str,
    symptoms: &'static str,
    action: &'static str,
) -> Row {
    Row { fault, word, target_kind, cause, symptoms, action, parameter: None }
}

impl InjectedFault {
    /// Its row. Only the number may differ from it; a valve and its position are part of the fault.
    pub(crate) fn row(self) -> &'static Row {
        let is_same = |row: &&Row| match self {
            InjectedFault::ValveStuck(..) | InjectedFault::Switch(_) => row.fault == self,
            _ => discriminant(&row.fault) == discriminant(&self),
        };
        ROWS.iter().find(is_same).expect("every fault has a row")
    }
}

/// In the order of the page.
pub(super) const ROWS: [Row; 22] = [
    row(
        InjectedFault::Noise(10),
        "noise",
        TargetKind::Line,
        "Interference, a missing termination or a bad shield: bits change on the way, in requests and in responses.",
        "The check of a frame finds every single wrong bit: no value is wrong, some are missing. Corrupt responses and \
         timeouts of all units on the line are counted on Bus; values grow old only when it is bad.",
        "Compare the units on Bus: errors of all units point to the cable, errors of one to that unit.",
    )
    .with_number("%", 1.0, 100.0, &[1.0, 5.0, 10.0, 20.0, 50.0]),
    row(
        InjectedFault::Silent,
        "silent",
        TargetKind::Unit,
        "The unit has no power, the wrong address or baud rate, or a loose wire.",
        "Its values are uncertain at once and bad after three failed requests, when its alarm \"not responding\" comes; other units go on. Whether the unit still controls its process cannot be known from here.",
        "Inspect the unit; treat all it controls as unknown.",
    ),
    row(
        InjectedFault::Late(Duration::from_secs(2)),
        "late",
        TargetKind::Unit,
        "The unit is overloaded or sits behind a slow radio or converter.",
        "A response within the timeout is only slower. A later one is a timeout; when it then arrives it is discarded as stale and never taken for the response to the next request.",
        "See the response times on Bus; raise timeout_ms of the line if the unit is meant to be slow.",
    )
    .with_number("s", 0.05, 60.0, &[0.2, 0.5, 1.0, 2.0, 5.0]),
    row(
        InjectedFault::BadCrc,
        "bad crc",
        TargetKind::Unit,
        "The check of each response is wrong: a defective driver, or two units with one address.",
        "No value is taken from such a response. A write may have been done although its response is not readable: its \
         outcome is \"may have taken effect\".",
        "Read the value back before writing again.",
    ),
    row(
        InjectedFault::Cut,
        "cut",
        TargetKind::Unit,
        "Each response ends in the middle: the driver switches off too early, or the unit restarts.",
        "A response that is too short is no response. As with a wrong check, a write may have been done.",
        "See the frames on Bus: where they end shows which side switches off.",
    ),
    row(
        InjectedFault::Exception(4),
        "exception",
        TargetKind::Unit,
        "The unit understands and refuses: no such register, busy, or its own failure.",
        "Values are bad with the exception as their cause. The unit counts as responding, so its alarm \"not responding\" \
         does not come.",
        "Press w on a value and read why it is bad; the code says what the unit objects to.",
    )
    .with_number("", 1.0, 255.0, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 11.0]),
    row(
        InjectedFault::Stuck,
        "stuck value",
        TargetKind::Value,
        "The measuring part of the unit hangs while its communication goes on: every response is valid but old.",
        "The line shows nothing. A master sees it only by a value that should move and does not: by another \
         measurement, by its effect, or by an alarm on no change, where there is one.",
        "Compare with what the process must do: heating without a change of temperature is not possible.",
    ),
    row(
        InjectedFault::Torn,
        "torn value",
        TargetKind::Value,
        "The unit updates a 32-bit value between its two words: one word is new, one is of the reading before.",
        "Inside one good response no master can see it. It shows as a jump that the next reading reverses; only a value outside the range of the tag is refused.",
        "Distrust single spikes; ask the maker for a register that latches.",
    ),
    row(
        InjectedFault::WordOrder,
        "word order",
        TargetKind::Value,
        "The unit was replaced or set to another word order.",
        "The bits are good but mean another number. It is refused only where it is not a number or outside the range of the tag; what happens to be inside is shown as good.",
        "After a replacement compare one value with the front panel of the unit; set `order` in the profile.",
    ),
    row(
        InjectedFault::SensorBurnout,
        "sensor burnout",
        TargetKind::Value,
        "The wire of the sensor breaks; the unit knows it and says so.",
        "The value is bad at once with the cause \"sensor fault\" and the alarm of the unit comes. A controller in \
         operation puts its output to the fail-safe value.",
        "Stop the sequence, check the terminals; do not heat by hand without a temperature.",
    ),
    row(
        InjectedFault::HeaterBurnout,
        "heater burnout",
        TargetKind::Process,
        "The heating element is open: the controller asks for power and none is taken.",
        "MV rises to 100 % and the heater's power stays at 0 W. No alarm until the temperature is away from SV for long.",
        "Compare MV with the power that is measured.",
    ),
    row(
        InjectedFault::ValveStuck(Valve::Drain, Position::Open),
        "SV-1 stuck open",
        TargetKind::Process,
        "SV-1 does not close: TK-1 runs empty into TK-3.",
        "The PLC shows what it commands (CLOSED), not where the valve is. Flow out of TK-1 and a falling level show \
         that it is open.",
        "Stop; close the hand valve under TK-1.",
    ),
    row(
        InjectedFault::ValveStuck(Valve::Drain, Position::Closed),
        "SV-1 stuck closed",
        TargetKind::Process,
        "SV-1 does not open: TK-1 keeps its hot water.",
        "The PLC shows OPEN, but no flow out and the level stands. After the time of the step the sequence fails with \
         an alarm.",
        "Stop and check the coil of the valve; the water is hot.",
    ),
    row(
        InjectedFault::ValveStuck(Valve::Fill, Position::Open),
        "SV-2 stuck open",
        TargetKind::Process,
        "SV-2 does not close: TK-2 runs into TK-1.",
        "The PLC shows CLOSED, but there is flow in and the level rises to its alarm.",
        "Close the hand valve under TK-2 before TK-1 overflows.",
    ),
    row(
        InjectedFault::ValveStuck(Valve::Fill, Position::Closed),
        "SV-2 stuck closed",
        TargetKind::Process,
        "SV-2 does not open: TK-1 is not filled.",
        "The PLC shows OPEN, but no flow in. The sequence fails after the time of the step; the interlock keeps the \
         heater off without level.",
        "Check the water in TK-2, then the coil of the valve.",
    ),
    row(
        InjectedFault::Leak(2_000),
        "leak",
        TargetKind::Process,
        "TK-1 loses water to the floor.",
        "The level falls while both valves are closed and no flow is shown. The alarm of a low level waits \
         half an hour, because TK-1 is empty between batches: the sum of the three tanks shows it earlier.",
        "Stop heating; inspect the tank.",
    )
    .with_number("l/min", 0.01, 20.0, &[0.2, 0.5, 1.0, 2.0, 5.0]),
    row(
        InjectedFault::PumpFailed,
        "pump failed",
        TargetKind::Process,
        "P-1 does not turn: its motor protection is off or its shaft is broken.",
        "The PLC shows ON, but no pump flow. TK-3 stays full and the sequence fails in RETURN.",
        "Check the motor protection switch.",
    ),
    row(
        InjectedFault::AgitatorFailed,
        "agitator failed",
        TargetKind::Process,
        "M-1 does not turn: the water forms layers.",
        "Nothing measures the agitator: the PLC shows ON. The temperature follows the heater late and swings more.",
        "Inspect the tank when the control swings without a change of settings.",
    ),
    row(
        InjectedFault::Switch(PanelSwitch::Pump),
        "switch X0 on",
        TargetKind::Process,
        "The switch X0 on the panel is on: pump P-1 by hand.",
        "In MANUAL the output is ON though its command is OFF. The lamps of the PLC show the input.",
        "Look at the lamps of the PLC, then at the panel.",
    ),
    row(
        InjectedFault::Switch(PanelSwitch::Agitator),
        "switch X1 on",
        TargetKind::Process,
        "The switch X1 on the panel is on: agitator M-1 by hand.",
        "In MANUAL the output is ON though its command is OFF. The lamps of the PLC show the input.",
        "Look at the lamps of the PLC, then at the panel.",
    ),
    row(
        InjectedFault::Switch(PanelSwitch::Drain),
        "switch X2 on",
        TargetKind::Process,
        "The switch X2 on the panel is on: valve SV-1 by hand.",
        "In MANUAL the output is ON though its command is OFF. The lamps of the PLC show the input.",
        "Look at the lamps of the PLC, then at the panel.",
    ),
    row(
        InjectedFault::Switch(PanelSwitch::Fill),
        "switch X3 on",
        TargetKind::Process,
        "The switch X3 on the panel is on: valve SV-2 by hand.",
        "In MANUAL the output is ON though its command is OFF. The lamps of the PLC show the input.",
        "Look at the lamps of the PLC, then at the panel.",
    ),
];
