//! Describes each fault: its cause in the field, what a master can see of it, and the response.

use super::syntax::{Fault, Position, Valve};

/// Texts about a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Description {
    /// Its cause in the field.
    pub cause: &'static str,
    /// What an operator can see of it, and what not.
    pub symptoms: &'static str,
    /// What a good operator does.
    pub response: &'static str,
}

impl Fault {
    /// Texts about it.
    pub fn description(self) -> Description {
        let describe = |cause, symptoms, response| Description { cause, symptoms, response };
        match self {
            Fault::Noise(_) => describe(
                "Interference, a missing termination or a bad screen: bits change on the way, in requests and in answers.",
                "The check of a frame finds every single wrong bit: no value is wrong, some are missing. Corrupt answers and \
                 timeouts of all units on the line are counted on Bus; values grow old only when it is bad.",
                "Compare the units on Bus: all of them suffering points to the cable, one to that unit.",
            ),
            Fault::Silent => describe(
                "The unit has no power, the wrong address or baud rate, or its wire is off.",
                "Its values are uncertain at once and bad after three failed requests, when its alarm \"not answering\" comes; \
                 other units go on. Whether the unit still works its process cannot be known from here.",
                "Inspect the unit; treat all it controls as unknown.",
            ),
            Fault::Late(_) => describe(
                "The unit is overloaded or sits behind a slow radio or converter.",
                "An answer within the timeout is only slower. A later one is a timeout; when it then arrives it is thrown away \
                 as stale and never taken for the answer to the next request.",
                "See the answer times on Bus; raise timeout_ms of the line if the unit is meant to be slow.",
            ),
            Fault::BadCrc => describe(
                "The check of each answer is wrong: a defective driver, or two units with one address.",
                "No value is taken from such an answer. A write may have been done although its answer is not readable: its \
                 outcome is \"may have taken effect\".",
                "Read the value back before writing again.",
            ),
            Fault::Cut => describe(
                "Each answer ends in the middle: the driver switches off too early, or the unit restarts.",
                "An answer that is too short is no answer. As with a wrong check, a write may have been done.",
                "See the frames on Bus: where they end shows which side switches off.",
            ),
            Fault::Exception(_) => describe(
                "The unit understands and refuses: no such register, busy, or its own failure.",
                "Values are bad with the why_not_applicable as their cause. The unit counts as answering, so its alarm \"not answering\" \
                 does not come.",
                "Press w on a value and read why it is bad; the code says what the unit objects to.",
            ),
            Fault::Stuck => describe(
                "The measuring part of the unit hangs while its communication goes on: every answer is good and old.",
                "The line shows nothing. A master sees it only by a value that should move and does not: by another \
                 measurement, by its effect, or by an alarm on no change, where there is one.",
                "Compare with what the process must do: heating without a change of temperature is not possible.",
            ),
            Fault::Torn => describe(
                "The unit updates a 32-bit value between its two words: one word is new, one is of the reading before.",
                "Inside one good answer no master can see it. It shows as a jump that the next reading takes back; only a value \
                 outside of the range of the tag is refused.",
                "Distrust single spikes; ask the maker for a register that latches.",
            ),
            Fault::WordOrder => describe(
                "The unit was replaced or set to another word order.",
                "The bits are good and mean another number. It is refused only where it is no number or outside of the range \
                 of the tag; what happens to be inside is shown as good.",
                "After a replacement compare one value with the face of the unit; set `order` in the profile.",
            ),
            Fault::SensorBurnout => describe(
                "The wire of the sensor breaks; the unit knows it and says so.",
                "The value is bad at once with the cause \"sensor fault\" and the alarm of the unit comes. A controller in \
                 operation puts its output to the fail-safe value.",
                "Stop the sequence, check the terminals; do not heat by hand without a temperature.",
            ),
            Fault::HeaterBurnout => describe(
                "The heating element is open: the controller asks for power and none is taken.",
                "MV rises to 100 % and the heater's power stays at 0 W. No alarm until the temperature is away from SV for long.",
                "Compare MV with the power that is measured.",
            ),
            Fault::ValveStuck(Valve::Drain, Position::Open) => describe(
                "SV-1 does not close: TK-1 runs empty into TK-3.",
                "The PLC shows what it commands (SHUT), not where the valve is. Flow out of TK-1 and a falling level show \
                 that it is open.",
                "Stop; close the hand valve under TK-1.",
            ),
            Fault::ValveStuck(Valve::Drain, Position::Closed) => describe(
                "SV-1 does not open: TK-1 keeps its hot water.",
                "The PLC shows OPEN, but no flow out and the level stands. After the time of the step the sequence fails with \
                 an alarm.",
                "Stop and check the coil of the valve; the water is hot.",
            ),
            Fault::ValveStuck(Valve::Fill, Position::Open) => describe(
                "SV-2 does not close: TK-2 runs into TK-1.",
                "The PLC shows SHUT, but there is flow in and the level rises to its alarm.",
                "Close the hand valve under TK-2 before TK-1 overflows.",
            ),
            Fault::ValveStuck(Valve::Fill, Position::Closed) => describe(
                "SV-2 does not open: TK-1 is not filled.",
                "The PLC shows OPEN, but no flow in. The sequence fails after the time of the step; the interlock keeps the \
                 heater off without level.",
                "Check the water in TK-2, then the coil of the valve.",
            ),
            Fault::Leak(_) => describe(
                "TK-1 loses water to the floor.",
                "The level falls while both valves are closed and no flow is shown. The alarm of a low level waits \
                 half an hour, because TK-1 is empty between batches: the sum of the three tanks shows it earlier.",
                "Stop heating; inspect the tank.",
            ),
            Fault::PumpFailed => describe(
                "P-1 does not turn: its motor protection is off or its shaft is broken.",
                "The PLC shows ON, but no pump flow. TK-3 stays full and the sequence fails in RETURN.",
                "Check the motor protection switch.",
            ),
            Fault::AgitatorFailed => describe(
                "M-1 does not turn: the water forms layers.",
                "Nothing measures the agitator: the PLC shows ON. The temperature follows the heater late and swings more.",
                "Inspect the tank when the control swings without a change of settings.",
            ),
        }
    }
}
