//! What to check next where nothing was read yet, in the order of likelihood.

use super::Registers;
use crate::plant::{
    def::{Framing, Transport},
    fault::{Fault, FaultKind},
    line_state::LineState,
};
use crate::ui::tabs::prelude::*;

/// Lines of advice, while no register of the unit was ever read; none once something was, or nothing is known yet.
pub fn advice(tab: &Registers, cx: &ViewContext) -> Vec<String> {
    if !tab.cells.is_blank() {
        return Vec::new();
    }
    let fault = tab.last.as_ref().and_then(|last| last.parts.first()?.words.as_ref().err().copied());
    let Some(fault) = fault else { return of_connection(cx, tab.line) };
    let serial = matches!(cx.def().lines[tab.line.index()].transport, Transport::Serial { .. });
    let mut lines: Vec<String> = of_fault(fault, serial).into_iter().map(str::to_owned).collect();
    if let Fault::WrongUnit { got, .. } = fault {
        lines.insert(0, t!("the device has unit address {got}: U, then {got}", got));
    }
    if cx.snapshot.lines[tab.line.index()].counters.echoes && !lines.is_empty() {
        lines.insert(0, t!("local echo: the adapter gives back what it sends (removed from responses)").to_owned());
    }
    lines
}

/// Where nothing was asked, because the connection does not come about or does not last.
fn of_connection(cx: &ViewContext, line: LineId) -> Vec<String> {
    let (state, transport) = (&cx.snapshot.line(line).state, &cx.def().line(line).transport);
    let (LineState::Waiting { .. }, Transport::Network { framing, .. }) = (state, transport) else {
        return Vec::new();
    };
    let other = match framing {
        Framing::Mbap => t!("Modbus RTU over TCP: quit, and open with --mode rtu-over-tcp"),
        Framing::Rtu | Framing::Ascii => t!("Modbus TCP: quit, and open with --mode tcp"),
    };
    let lines = [
        t!("no Modbus server there, or another protocol on this TCP port; 502 is usual"),
        other,
        t!("the device accepts one connection, and another program holds it"),
        t!("a firewall, or a device that answers certain hosts only"),
    ];
    lines.map(str::to_owned).to_vec()
}

fn of_fault(fault: Fault, serial: bool) -> Vec<&'static str> {
    if let Fault::WrongUnit { .. } = fault {
        return vec![
            t!("a gateway that puts its own address into every response"),
            t!("another master on the line, whose traffic interferes"),
        ];
    }
    match fault.kind() {
        FaultKind::Timeout if serial => vec![
            t!("another unit address: U; or a scan of all: tab Bus"),
            t!("another baud rate or parity: quit, and open without --baud and --parity"),
            t!("A and B swapped, or the device without power"),
            t!("no termination or common ground, another master on the line"),
        ],
        FaultKind::Timeout => vec![
            t!("another unit address: U; 255 and 0 are usual of devices, 1 behind a gateway"),
            t!("no device behind the gateway, or the device without power"),
            t!("other serial settings in the gateway than in the device"),
            t!("the device accepts one connection, and another program holds it"),
            t!("another protocol on this TCP port"),
        ],
        FaultKind::Exception(code) if code.is_of_gateway() => vec![
            t!("the gateway answers, the device behind it does not: another unit address: U"),
            t!("the device without power, or its serial line disconnected"),
            t!("other serial settings in the gateway than in the device"),
        ],
        FaultKind::Corrupt => vec![
            if serial {
                t!("another baud rate or parity: quit, and open without --baud and --parity")
            } else {
                t!("other serial settings in the gateway than in the device")
            },
            t!("two devices with the same unit address, or another master on the line"),
            t!("noise: shield, termination, common ground; tab Bus shows every byte"),
        ],
        FaultKind::Exception(_)
        | FaultKind::OutOfSync
        | FaultKind::NotANumber
        | FaultKind::NotConnected
        | FaultKind::BackedOff
        | FaultKind::NotHeard
        | FaultKind::Unproven => Vec::new(),
    }
}
