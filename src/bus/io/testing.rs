//! Carries the steps of a line diagnostic over a link.

use super::{
    clock::Clock,
    link::{Link, LinkError},
    transport::Connector,
    wire::Memory,
};
use crate::{
    bus::diagnostics::{Ask, Job, Step, StepResult},
    plant::{
        def::{LineDef, Transport},
        diagnostics::{DiagnosticRun, DiagnosticState},
        event::Fault,
    },
};

/// One step. `Err` only when the port is gone.
pub async fn step(link: &mut Link, step: &Step) -> Result<StepResult, LinkError> {
    match &step.ask {
        Ask::Raw(bytes) => link.send_raw(bytes).await.map(|(bytes, reply)| StepResult::Bytes(bytes, reply)),
        Ask::Message(message) => {
            let (usual, unanswered) = (link.timeout(), link.unanswered);
            link.set_timeout(step.timeout.unwrap_or(usual));
            // An outstanding reply would be shown as the answer to this.
            if let (true, Some(unit)) = (link.is_ambiguous(message), message.first()) {
                match link.loopback(*unit).await {
                    Ok(()) => {}
                    Err(LinkError::Fault(_)) => drop(link.forget_outstanding(*unit)),
                    Err(gone) => return Err(gone),
                }
            }
            let sent = if link.is_ambiguous(message) {
                Err(LinkError::Fault(Fault::BackedOff))
            } else {
                link.exchange(message).await
            };
            // Absent units are what a scan asks for: they say nothing of the connection.
            link.unanswered = unanswered;
            let answer = match sent {
                Ok(answer) => Ok(Ok(answer)),
                Err(LinkError::Fault(fault)) => Ok(Err(fault)),
                Err(gone) => Err(gone),
            };
            link.set_timeout(usual);
            let exchange = link.last.clone().ok_or(LinkError::Fault(Fault::Timeout))?;
            Ok(StepResult::Answer(answer?, exchange))
        }
    }
}

/// The settings of a line with the serial parameters that a step wants.
pub fn settings_for(line: &LineDef, step: &Step) -> LineDef {
    let mut settings = line.clone();
    if let (Transport::Serial { serial, .. }, Some(wanted)) = (&mut settings.transport, step.serial) {
        *serial = wanted;
    }
    settings
}

/// Runs a diagnostic to its end on a line that is not polled; `progress` sees every step and may stop it by `false`.
pub async fn run(line: &LineDef, mut job: Job, mut progress: impl FnMut(&DiagnosticRun) -> bool) -> DiagnosticRun {
    let mut connector = Connector::Real(line.transport.clone());
    let mut memory = Memory::new(line, Clock::real());
    let mut open: Option<(LineDef, Link)> = None;
    while let Some(next) = job.next().cloned() {
        let wanted = settings_for(line, &next);
        let mut link = match open.take().filter(|(settings, _)| *settings == wanted) {
            Some((_, link)) => link,
            None => match connector.open_as(&wanted.transport).await {
                Ok(opened) => Link::new(opened, &wanted, Clock::real(), memory.clone()),
                Err(why) => {
                    job.stop(DiagnosticState::Failed(why));
                    break;
                }
            },
        };
        match step(&mut link, &next).await {
            Ok(result) => job.on_result(result),
            Err(LinkError::Gone(why)) => job.stop(DiagnosticState::Failed(why)),
            Err(LinkError::Fault(fault)) => job.stop(DiagnosticState::Failed(fault.to_string())),
        }
        if !progress(job.run()) {
            job.stop(DiagnosticState::Cancelled);
        }
        memory = link.memory();
        open = Some((wanted, link));
    }
    job.run().clone()
}
