//! The scan: one request a unit and setting, any answer counts.

use super::{Ask, Job, Step, read};
use crate::plant::{
    def::Serial,
    diagnostics::{DiagnosticStep, Finding, Scan, UnitReply},
    fault::Fault,
    number::{to_u8, to_u32},
    tag::Table,
};

/// Most units of a scan with the same settings of which only corrupt bytes may come.
const CORRUPT_UNITS_MAX: usize = 3;

/// Steps of a scan.
pub(super) fn steps_in(scan: &Scan) -> u32 {
    units_of(scan) * to_u32(scan.serials.len().max(1))
}

/// Step `n`, from 0: all units with the first setting, then with the next.
pub(super) fn step_of(scan: &Scan, n: u32) -> Step {
    let units = units_of(scan).max(1);
    Step {
        serial: scan.serials.get((n / units) as usize).copied(),
        timeout: Some(scan.timeout),
        ask: Ask::Message(read(to_u8(u32::from(scan.first) + n % units), Table::Holding, 0, 1)),
    }
}

/// Units that a scan asks with each setting.
fn units_of(scan: &Scan) -> u32 {
    (u32::from(scan.last) + 1).saturating_sub(u32::from(scan.first))
}

impl Job {
    pub(super) fn add_unit(&mut self, step: &Step, answer: Result<Vec<u8>, Fault>) {
        let Ask::Message(request) = &step.ask else { return };
        let reply = match answer {
            // A broadcast has no response.
            Ok(answer) if answer.is_empty() => return,
            Ok(answer) => match answer.get(3..5) {
                Some([high, low]) => UnitReply::Register(u16::from_be_bytes([*high, *low])),
                _ => UnitReply::Answers,
            },
            Err(Fault::Exception(code)) if !code.is_of_gateway() => UnitReply::Exception(code),
            // Corrupt bytes are a trace too: a unit may be there with another parity or baud rate.
            Err(fault) if fault.is_corrupt() => return self.corrupt_units.push((request[0], step.serial, fault)),
            Err(_) => return,
        };
        self.found(Finding::Unit { unit: request[0], serial: step.serial, reply });
    }

    /// A few corrupt responses may be units; more of them with the same settings come from another sender.
    pub(super) fn conclude_corrupt_units(&mut self) {
        let corrupt_units = std::mem::take(&mut self.corrupt_units);
        for same in corrupt_units.chunk_by(|one, other| one.1 == other.1) {
            let (_, serial, fault) = same[0];
            if same.len() <= CORRUPT_UNITS_MAX {
                let unit = |(unit, serial, fault): &(u8, Option<Serial>, Fault)| Finding::Unit {
                    unit: *unit,
                    serial: *serial,
                    reply: UnitReply::Corrupt(*fault),
                };
                same.iter().for_each(|trace| self.found(unit(trace)));
                continue;
            }
            let what = DiagnosticStep::Addresses { count: same.len(), serial };
            self.found(Finding::Failed { what, fault });
        }
    }
}
