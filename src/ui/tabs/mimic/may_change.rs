//! Which commands can be given now, and what forbids the others, before a key is pressed.

use super::attention::AttentionRow;
use crate::ui::{interlock, tabs::prelude::*};

/// The commands of actuators and the setpoints of controllers: those that are allowed, then the others by what forbids them.
pub fn rows(cx: &ViewContext) -> Vec<AttentionRow> {
    if cx.is_past() {
        return Vec::new();
    }
    let def = cx.def();
    let actuators = def.logic.actuators.iter().map(|actuator| (actuator.output, actuator.command));
    let setpoints = def.devices.iter().filter_map(|device| device.faceplate.as_ref());
    let setpoints = setpoints.map(|faceplate| (faceplate.sv, faceplate.sv)).filter(|(sv, _)| def.tag(*sv).writable());
    let mut allowed = Vec::new();
    let mut forbidden: Vec<(String, Vec<&str>)> = Vec::new();
    for (shown, command) in actuators.chain(setpoints) {
        let tag = def.tag(shown);
        let mut outputs = def.logic.actuators.iter().map(|actuator| def.tag(actuator.output));
        let is_alone = !outputs.any(|other| other.id != shown && other.short == tag.short);
        let name = if shown != command && is_alone { &tag.short } else { &tag.name };
        match interlock::forbidden_text(cx, command) {
            None => allowed.push(name.as_str()),
            Some(why) => match forbidden.iter_mut().find(|(other, _)| *other == why) {
                Some((_, names)) => names.push(name),
                None => forbidden.push((why, vec![name])),
            },
        }
    }
    let mark = cx.theme.pick("✓", "ok");
    let allowed = (!allowed.is_empty())
        .then(|| (t!("{mark} {names}: allowed", mark, names = allowed.join(", ")), cx.theme.normal()));
    let row = |(why, names): (String, Vec<&str>)| (format!("{}: {why}", names.join(", ")), cx.theme.normal());
    allowed.into_iter().chain(forbidden.into_iter().map(row)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::fixture::{Fixture, with_cx};

    fn said(fixture: &Fixture) -> Vec<String> {
        with_cx(&fixture.snapshot(), rows).into_iter().map(|(text, _)| text).collect()
    }

    #[test]
    fn what_forbids_a_command_is_said_before_it_is_given() {
        let mut fixture = Fixture::normal();
        let shown = said(&fixture);
        assert_eq!(shown[0], "✓ TIC-1.SV: allowed");
        assert!(shown[1].starts_with("P-1: effective in MANUAL only"), "{shown:?}");
        fixture.set("PLC-1.AUTO", 0.0);
        assert_eq!(said(&fixture), ["✓ P-1, TIC-1.SV: allowed"]);
        fixture.set("PLC-1.TK-2", 19.5);
        assert!(said(&fixture)[1].starts_with("P-1: ⊘ no pumping into a full tank"), "{:?}", said(&fixture));
        // Where the state of the command is unknown nothing is promised.
        let command = fixture.tag("PLC-1.MAN.P-1");
        fixture.samples[command.index()].quality =
            crate::plant::sample::Quality::Bad(crate::plant::sample::Cause::Timeout);
        assert!(said(&fixture)[1].contains("unknown"), "{:?}", said(&fixture));
        assert!(said(&Fixture::line_down()).iter().all(|row| !row.contains("allowed")));
    }

    #[test]
    fn a_command_that_is_not_read_is_not_called_unknown() {
        use crate::plant::tag::{Access, Poll};
        for (access, poll) in [(Access::Write, Poll::Never), (Access::ReadWrite, Poll::Never)] {
            let mut fixture = Fixture::normal();
            fixture.set("PLC-1.AUTO", 0.0);
            let command = fixture.tag("PLC-1.MAN.P-1");
            let tag = &mut fixture.def.tags[command.index()];
            (tag.access, tag.poll) = (access, poll);
            fixture.samples[command.index()].quality =
                crate::plant::sample::Quality::Bad(crate::plant::sample::Cause::NotRead);
            assert_eq!(said(&fixture), ["✓ P-1, TIC-1.SV: allowed"]);
        }
    }

    #[test]
    fn a_viewer_reads_which_role_a_command_needs() {
        let snapshot = Fixture::normal().snapshot();
        let shown = with_cx(&snapshot, |cx| {
            let session = crate::access::SessionStatus::default();
            rows(&ViewContext { session: &session, ..*cx })
        });
        assert!(shown.len() == 1 && shown[0].0.contains("needs Technician"), "{shown:?}");
    }
}
